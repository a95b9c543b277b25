"""What a job may take, and where jobs run: in this process, in processes on this machine's cores, on a dask cluster.

Each task runs in a process with limits (`base/process.py`), also on a cluster: one that takes its process down costs
its own row, and is tried again, for a process may be killed from outside as well.
"""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import (
    ALL_COMPLETED,
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ThreadPoolExecutor,
    wait,
)
from dataclasses import dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any, Self, TypeVar, cast

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.base.limits import JOB_MEMORY, JOB_TIMEOUT
from xosc_lateral.base.process import ProcessEndedError, Processes, address_space, cores
from xosc_lateral.base.signals import Interrupted, TimeOver, pending_signal, time_limit
from xosc_lateral.base.version import __version__

Task = TypeVar("Task")
Result = TypeVar("Result")


# ---- what one job may take: work that exceeds it ends as an error of that job ----
class JobLimitError(XoscLateralError):
    """A job took more time or memory than it may."""


@dataclass(frozen=True, slots=True)
class JobLimits:
    """What one job may take: time [s], and memory on top of what the process has when the job begins [MB]."""

    timeout: float = JOB_TIMEOUT.value
    memory: float = JOB_MEMORY.value
    fixed: bool = False  # The verb has no options that raise them.

    @property
    def too_much(self) -> str:
        """Why a job was ended that took more memory."""
        return f"took more than {self.memory:g} MB of memory" + "; --job-limit raises the limit" * (not self.fixed)

    @property
    def too_long(self) -> str:
        """Why a job was ended that took more time."""
        return f"took longer than {self.timeout:g} s" + "; --job-limit raises the limit" * (not self.fixed)


def within_limits(work: Callable[[Task], Result], task: Task, limits: JobLimits) -> Result:
    """Run ``work(task)``. Raises `JobLimitError`: it took too long, or too much memory."""
    try:
        with address_space(limits.memory), time_limit(limits.timeout):
            return work(task)
    except MemoryError as error:
        raise JobLimitError(limits.too_much) from error
    except TimeOver as error:
        raise JobLimitError(limits.too_long) from error


def for_one(work: Callable[[Path], Result], path: Path, limits: JobLimits | None = None) -> Result:
    """``work(path)`` within limits, else those of a batch's scenario. Raises `JobLimitError`, which names the file."""
    try:
        return within_limits(work, path, limits or JobLimits(fixed=True))
    except JobLimitError as error:
        raise JobLimitError(f"{path}: {error}") from error


# ---- where jobs run ----
TASKS_AHEAD = 2
"""Tasks handed out per worker: one at work, one to begin with at once."""

TRIES = 4
"""Times that a task may take its process, or its machine, down."""

LONG_TRY = 60.0
"""A task that worked for so long before its process died is not tried again: that was no accident. [s]"""

ENDING_TIME = 30.0
"""A job that has not ended so long after it was told to is killed with its process. [s]"""

CHECK_EVERY = 5.0
"""How often it is looked whether a pool that does not answer still has workers. [s]"""

SIGNAL_EVERY = 0.2
"""How often it is looked whether a signal has come. [s]"""

FINISH_TIME = 10.0
"""What is handed out when a signal comes may go on for so long. [s]"""


class ClusterError(XoscLateralError):
    """The cluster can't be reached, or is gone."""


class WorkerDiedError(XoscLateralError):
    """A task took down its worker, time and again, or did not end."""


def _processes() -> Processes:
    # one thread each for libraries of numpy and numba: as many processes as cores are busy already
    environment = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    return Processes("xosc_lateral.base.process:serve", environment)


_of_this_machine = cache(_processes)
"""Of a cluster's worker, whose threads share them."""


def in_process(
    processes: Processes | None, limits: JobLimits, work: Callable[[Task], Result], task: Task
) -> Result | WorkerDiedError:
    """``work(task)`` in a process of its own; an error where that ends time and again, or does not end."""
    begin, seconds = time.monotonic(), limits.timeout + ENDING_TIME
    processes = processes or _of_this_machine()
    for _ in range(TRIES):
        try:
            return cast(Result, processes.call(work, task, seconds=seconds, megabytes=limits.memory))
        except ProcessEndedError as ended:
            if ended.late:
                return WorkerDiedError(limits.too_long)
        if time.monotonic() - begin > LONG_TRY:
            break
    return _died()


def _died() -> WorkerDiedError:
    return WorkerDiedError("its worker process died time and again (killed, out of memory, or a crash in a library)")


class Pool:
    """Workers, used as a context: here none, a task runs in this process when it is handed out."""

    def __init__(self, limits: JobLimits) -> None:
        self._limits = limits

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        """End the workers: at once after an error."""

    def capacity(self) -> int:
        """How many tasks may be handed out at once."""
        return 1

    def submit(self, work: Callable[[Task], Result], task: Task) -> Future[Result | WorkerDiedError]:
        """Hand out a task."""
        future: Future[Result | WorkerDiedError] = Future()
        future.set_result(work(task))
        return future

    def lost(self, error: BaseException) -> bool:
        """Whether a future's error means that its machine is gone, rather than that the task raised it."""
        return False

    def check(self) -> None:
        """Raise `ClusterError` when no result can come any more; called every few seconds without one."""


class _LocalProcesses(Pool):
    """So many processes on this machine, a thread waiting for each."""

    def __init__(self, limits: JobLimits, count: int) -> None:
        super().__init__(limits)
        self._count, self._threads, self._processes = count, ThreadPoolExecutor(count), _processes()

    def __exit__(self, *raised: object) -> None:
        if raised[1] is not None:
            self._processes.end()
        self._threads.shutdown(cancel_futures=True)
        self._processes.end()

    def capacity(self) -> int:
        return TASKS_AHEAD * self._count

    def submit(self, work: Callable[[Task], Result], task: Task) -> Future[Result | WorkerDiedError]:
        return self._threads.submit(in_process, self._processes, self._limits, work, task)


CONNECT_TIMEOUT = 10.0
"""A scheduler that has not answered after this is not there. [s]"""

WORKERLESS = 120.0
"""A cluster without workers for so long is given up; restarting one takes seconds. [s]"""


class _Cluster(Pool):
    """Workers of a dask.distributed cluster, whose scheduler itself gives a dead worker's tasks to another.

    They have to see the same files under the same paths, and have the same version of this package.
    """

    def __init__(self, limits: JobLimits, address: str) -> None:
        super().__init__(limits)
        try:
            import distributed
        except ImportError as error:
            raise ClusterError("dask.distributed is not installed: pip install 'xosc-lateral[cluster]'") from error
        try:
            library: Any = distributed
            self._client: Any = library.Client(address, set_as_default=False, timeout=CONNECT_TIMEOUT)
        except (OSError, ValueError, TimeoutError) as error:
            raise ClusterError(f"no dask scheduler answers at {address}: {error}") from error
        self._address, self._had_workers = address, time.monotonic()
        self._check_versions()
        # pure=False: the key of a task must not come from its arguments, a repeated task has to run again
        self._executor: Executor = self._client.get_executor(pure=False)

    def __exit__(self, *raised: object) -> None:
        self._executor.shutdown(wait=raised[1] is None)
        self._client.close()

    def capacity(self) -> int:
        # of the workers that there are now; they may come and go
        return TASKS_AHEAD * max(1, sum(map(int, self._client.nthreads().values())))

    def submit(self, work: Callable[[Task], Result], task: Task) -> Future[Result | WorkerDiedError]:
        self._require_scheduler()
        return self._executor.submit(in_process, None, self._limits, work, task)

    def _require_scheduler(self) -> None:
        if self._client.status != "running":  # else the scheduler sees to it
            raise ClusterError(f"the dask scheduler at {self._address} is gone; what is finished is kept, run it again")

    def lost(self, error: BaseException) -> bool:
        from distributed import KilledWorker, cfexecutor

        self._require_scheduler()
        # dask's executor itself fails where a result comes at the very moment in which its worker dies
        innermost = [call.filename for call in traceback.extract_tb(error.__traceback__)[-1:]]
        return isinstance(error, KilledWorker | CancelledError) or innermost == [cfexecutor.__file__]

    def check(self) -> None:
        self._require_scheduler()
        if self._client.nthreads():
            self._had_workers = time.monotonic()
        elif time.monotonic() - self._had_workers > WORKERLESS:
            raise ClusterError(f"the dask scheduler at {self._address} has no workers left; run it again with some")

    def _check_versions(self) -> None:
        """Before the first job: afterwards every one of them would fail."""
        try:
            versions: dict[str, str] = self._client.run(installed_version)
        except Exception as error:  # what a worker without this package raises, dask hands on
            self._client.close()
            raise ClusterError(f"the workers at {self._address} can't run xosc-lateral: {error}") from error
        wrong = {worker: version for worker, version in versions.items() if version != __version__}
        if wrong:
            self._client.close()
            worker, version = min(wrong.items())
            raise ClusterError(
                f"{len(wrong)} of {len(versions)} workers at {self._address} have another version of xosc-lateral "
                f"({worker}: {version}, here: {__version__}); nothing was converted"
            )


def installed_version() -> str:
    """Version of this package where the call is run."""
    return __version__


def open_pool(workers: int, cluster: str | None, limits: JobLimits) -> Pool:
    """Pool for so many processes on this machine (-1: one per core; 0: this process), or for a cluster.

    Raises `ClusterError`: the cluster can't be reached; `ValueError`: fewer than none.
    """
    if cluster is not None:
        return _Cluster(limits, cluster)
    workers = cores() if workers == -1 else workers
    if workers < 0:
        raise ValueError(f"{workers} workers; at least 0 (this process), or -1 for one per core")
    return Pool(limits) if workers == 0 else _LocalProcesses(limits, workers)


def run_tasks(
    pool: Pool, work: Callable[[Task], Result], tasks: Iterable[Task]
) -> Iterator[tuple[Task, Result | WorkerDiedError]]:
    """Results as they come, in any order.

    What is lost with the machine that it ran on is handed out again, `TRIES` times at most.

    Raises `ClusterError`: the cluster is gone; `Interrupted`: a signal has come (`deferring_signals`), and results of
    what was at work have come as well; whatever `work` raises.
    """
    waiting = iter(tasks)
    running: dict[Future[Result | WorkerDiedError], tuple[Task, int]] = {}
    while True:
        if (number := pending_signal()) is not None:
            yield from _finished(running)
            raise Interrupted(number)
        for task in islice(waiting, max(pool.capacity() - len(running), 0)):
            running[pool.submit(work, task)] = task, 1
        if not running:
            return
        for future in _wait_for_any(pool, running):
            task, tried = running.pop(future)
            try:
                result = future.result()
            except (Exception, CancelledError) as error:
                if not pool.lost(error):
                    raise
                if tried < TRIES:
                    running[pool.submit(work, task)] = task, tried + 1
                    continue
                result = _died()
            yield task, result


def _wait_for_any(pool: Pool, running: Collection[Future[Result]]) -> Collection[Future[Result]]:
    """What is done; nothing once a signal has come."""
    begin = time.monotonic()
    while pending_signal() is None:
        if done := wait(running, SIGNAL_EVERY, FIRST_COMPLETED).done:
            return done
        if time.monotonic() - begin > CHECK_EVERY:
            pool.check()
            begin = time.monotonic()
    return ()


def _finished(running: Mapping[Future[Result], tuple[Task, int]]) -> Iterator[tuple[Task, Result]]:
    """Results of what was handed out, as far as it ends well within `FINISH_TIME`; workers may hold it already."""
    for future in wait(running, FINISH_TIME, ALL_COMPLETED).done:
        if not future.cancelled() and future.exception() is None:
            yield running[future][0], future.result()
