"""Where jobs run: in this process, on this machine's cores (joblib's executor), on a dask.distributed cluster.

Workers may die: what was lost is tried again, what kills its worker is found. joblib's `Parallel` is not in between
because it ends, and on dask waits for ever, when one task takes its worker down; here that costs one row.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import ALL_COMPLETED, FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import contextmanager
from itertools import islice
from typing import Any, Self, TypeVar

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.base.signals import ENDING, Interrupted, pending_signal
from xosc_lateral.base.version import __version__
from xosc_lateral.workflows.batch.guard import let_worker_die

Task = TypeVar("Task")
Result = TypeVar("Result")

TASKS_AHEAD = 2
"""Tasks handed out per worker: one at work, one to begin with at once."""

LONG_TRY = 60.0
"""A task that was alone and worked for so long before its worker died is not tried again: that was no accident. [s]"""

TRIES_ALONE = 3
"""Tries of a task that may have killed its worker; more than one, for a worker may be killed from outside as well."""

CHECK_EVERY = 5.0
"""How often it is looked whether a pool that does not answer still has workers. [s]"""

SIGNAL_EVERY = 0.2
"""How often it is looked whether a signal has come. [s]"""

FINISH_TIME = 10.0
"""What is handed out when a signal comes may go on for so long. [s]"""


class ClusterError(XoscLateralError):
    """The cluster can't be reached, or is gone."""


class WorkerDiedError(XoscLateralError):
    """A task took down its worker, time and again."""


class Pool:
    """Workers, used as a context: here none, a task runs in this process when it is handed out."""

    tries_alone = TRIES_ALONE

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        """End the workers: at once after an error."""

    def capacity(self) -> int:
        """How many tasks may be handed out at once."""
        return 1

    def submit(self, work: Callable[[Task], Result], task: Task) -> Future[Result]:
        """Hand out a task."""
        future: Future[Result] = Future()
        future.set_result(work(task))
        return future

    def recover(self) -> None:
        """Get fit again after a worker died; raises `ClusterError` if that can't be."""

    def lost(self, error: BaseException) -> bool:
        """Whether a future's error means that its worker died, rather than that the task raised it."""
        return False

    def check(self) -> None:
        """Raise `ClusterError` when no result can come any more; called every few seconds without one."""


PARENT_CHECK = 0.5
"""How often a worker looks whether its run is still there. [s]"""

PR_SET_PDEATHSIG = 1
"""Of Linux's prctl(2), from <linux/prctl.h>: the signal that this process gets when its parent ends."""


class _LocalProcesses(Pool):
    """So many worker processes of joblib's executor (loky), which sees by itself when one is gone."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._executor = self._start()

    def __exit__(self, *raised: object) -> None:
        self._executor.shutdown(wait=True, kill_workers=raised[1] is not None)

    def capacity(self) -> int:
        return TASKS_AHEAD * self._count

    def submit(self, work: Callable[[Task], Result], task: Task) -> Future[Result]:
        with _safe_path():
            future: Future[Result] = self._executor.submit(work, task)
        return future

    def recover(self) -> None:
        self._executor.shutdown(wait=True, kill_workers=True)
        self._executor = self._start()

    def lost(self, error: BaseException) -> bool:
        return isinstance(error, BrokenExecutor)

    def _start(self) -> Any:
        from joblib.externals.loky import ProcessPoolExecutor

        # One thread each for numpy's and numba's libraries: as many workers as cores are busy already.
        environment = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMBA")} | {_SAFE: "1"}
        if sys.platform != "win32":
            from multiprocessing.resource_tracker import ensure_running

            with _safe_path():
                ensure_running()  # it unblocks signals: before workers start, which are to have them blocked
        with _safe_path():
            return ProcessPoolExecutor(
                max_workers=self._count, env=environment, initializer=_end_with_parent, initargs=(os.getpid(),)
            )


_SAFE = "PYTHONSAFEPATH"


@contextmanager
def _safe_path() -> Iterator[None]:
    """Python processes that start meanwhile import nothing from the working folder, which may be anybody's.

    Workers are told in their own environment; joblib's process that tracks their resources has this one's. And no
    signal that a terminal sends to everybody reaches them: the run decides what becomes of its workers.
    """
    before = os.environ.get(_SAFE)
    os.environ[_SAFE] = "1"
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ENDING) if hasattr(signal, "pthread_sigmask") else None
    try:
        yield
    finally:
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        del os.environ[_SAFE]
        if before is not None:
            os.environ[_SAFE] = before


def _end_with_parent(parent: int) -> None:
    """End this worker with its run, even if that was killed: on Linux at once, so that nothing is left that could still
    write when the next run begins; elsewhere, and if the run was gone already, a thread looks every `PARENT_CHECK`.
    """
    let_worker_die()
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True, name="watch parent").start()


CONNECT_TIMEOUT = 10.0
"""A scheduler that has not answered after this is not there. [s]"""

WORKERLESS = 120.0
"""A cluster without workers for so long is given up; restarting one takes seconds. [s]"""


class _Cluster(Pool):
    """Workers of a dask.distributed cluster, whose scheduler itself gives a dead worker's tasks to another.

    They have to see the same files under the same paths, and have the same version of this package.
    """

    tries_alone = 1  # the scheduler has had a task on several workers before it gives it up, and a try costs some more

    def __init__(self, address: str) -> None:
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

    def submit(self, work: Callable[[Task], Result], task: Task) -> Future[Result]:
        self.recover()
        return self._executor.submit(work, task)

    def recover(self) -> None:
        if self._client.status != "running":  # else the scheduler sees to it
            raise ClusterError(f"the dask scheduler at {self._address} is gone; what is finished is kept, run it again")

    def lost(self, error: BaseException) -> bool:
        from distributed import KilledWorker, cfexecutor

        self.recover()
        # dask's executor itself fails where a result comes at the very moment in which its worker dies
        innermost = [call.filename for call in traceback.extract_tb(error.__traceback__)[-1:]]
        return isinstance(error, KilledWorker | CancelledError) or innermost == [cfexecutor.__file__]

    def check(self) -> None:
        self.recover()
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


def open_pool(workers: int, cluster: str | None) -> Pool:
    """Pool for so many processes on this machine (-1: one per core; 0: this process), or for a cluster.

    Raises `ClusterError`: the cluster can't be reached; `ValueError`: fewer than none.
    """
    if cluster is not None:
        return _Cluster(cluster)
    if workers == -1:
        import joblib

        workers = joblib.cpu_count()
    if workers < 0:
        raise ValueError(f"{workers} workers; at least 0 (this process), or -1 for one per core")
    return Pool() if workers == 0 else _LocalProcesses(workers)


def run_tasks(
    pool: Pool, work: Callable[[Task], Result], tasks: Iterable[Task]
) -> Iterator[tuple[Task, Result | WorkerDiedError]]:
    """Results as they come, in any order.

    When a worker dies, whatever had been handed out is tried again, one by one: what kills its worker then as well is
    the culprit and gives a `WorkerDiedError`; the rest is fine.

    Raises `ClusterError`: the cluster is gone; `Interrupted`: a signal has come (`deferring_signals`), and results of
    what was at work have come as well; whatever `work` raises.
    """
    waiting = iter(tasks)
    running: dict[Future[Result], Task] = {}
    suspects: list[Task] = []
    while True:
        if (number := pending_signal()) is not None:
            yield from _finished(running)
            raise Interrupted(number)
        if not suspects:
            for task in islice(waiting, max(pool.capacity() - len(running), 0)):
                try:
                    running[pool.submit(work, task)] = task
                except BrokenExecutor:
                    suspects.append(task)
                    break
        if not running:
            if not suspects:
                return
            pool.recover()
            while suspects:
                task = suspects.pop(0)
                yield task, _alone(pool, work, task)
            continue
        for future in _wait_for_any(pool, running):
            task = running.pop(future)
            try:
                result = future.result()
            except (Exception, CancelledError) as error:
                if not pool.lost(error):
                    raise
                suspects.append(task)
            else:
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


def _finished(running: Mapping[Future[Result], Task]) -> Iterator[tuple[Task, Result]]:
    """Results of what was handed out, as far as it ends well within `FINISH_TIME`; workers may hold it already."""
    for future in wait(running, FINISH_TIME, ALL_COMPLETED).done:
        if not future.cancelled() and future.exception() is None:
            yield running[future], future.result()


def _alone(pool: Pool, work: Callable[[Task], Result], task: Task) -> Result | WorkerDiedError:
    deaths = 1
    for _ in range(pool.tries_alone):
        begin = time.monotonic()
        try:
            future = pool.submit(work, task)
            if not _wait_for_any(pool, [future]):
                raise Interrupted(pending_signal() or signal.SIGINT)
            return future.result()
        except (Exception, CancelledError) as error:
            if not pool.lost(error):
                raise
            pool.recover()
        deaths += 1
        if time.monotonic() - begin > LONG_TRY:
            break
    return WorkerDiedError(f"its worker process died {deaths} times (killed, out of memory, or a crash in a library)")
