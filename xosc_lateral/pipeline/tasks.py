"""Tasks handed to workers that may die: what was lost is tried again, what kills its worker is found.

Workers are pools around `concurrent.futures` executors, so the loop that feeds them is the same for all. joblib's
`Parallel` is not in between because it ends, and on dask waits for ever, when one task takes its worker down; here that
costs one row.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from types import TracebackType
from typing import Self, TypeVar

from xosc_lateral.errors import XoscLateralError

Task = TypeVar("Task")
Result = TypeVar("Result")

AHEAD = 2
"""Tasks handed out per worker: one at work, one to begin with at once."""

LONG_TRY = 60.0
"""A task that was alone and worked for so long before its worker died is not tried again: that was no accident. [s]"""

TRIES_ALONE = 3
"""Tries of a task that may have killed its worker; more than one, for a worker may be killed from outside as well.

On a cluster one is enough: its scheduler has had the task on several workers before it says so, and each further try
takes more of them down.
"""

CHECK_EVERY = 5.0
"""How often it is looked whether a pool that does not answer still has workers. [s]"""


class ClusterError(XoscLateralError):
    """The cluster can't be reached, or is gone."""


class WorkerDiedError(XoscLateralError):
    """A task took down its worker, time and again."""


class Pool:
    """Workers, used as a context: here none, a task runs in this process when it is handed out.

    Attributes
    ----------
    tries_alone : int
        How often a task that may have killed its worker is tried by itself.
    """

    tries_alone = TRIES_ALONE

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
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


def run_tasks(
    pool: Pool, work: Callable[[Task], Result], tasks: Iterable[Task]
) -> Iterator[tuple[Task, Result | WorkerDiedError]]:
    """Results as they come, in any order.

    When a worker dies, whatever had been handed out is tried again, one by one: what kills its worker then as well is
    the culprit and gives a `WorkerDiedError`; the rest is fine.

    Raises
    ------
    ClusterError
        When the cluster is gone.
    Exception
        What `work` raises.
    """
    waiting = iter(tasks)
    running: dict[Future[Result], Task] = {}
    suspects: list[Task] = []
    while True:
        if not suspects:
            suspects += _feed(pool, work, waiting, running)
        if not running:
            if not suspects:
                return
            pool.recover()
            while suspects:
                task = suspects.pop(0)
                yield task, _alone(pool, work, task)
            continue
        done = wait(running, CHECK_EVERY, FIRST_COMPLETED).done
        if not done:
            pool.check()
        for future in done:
            task = running.pop(future)
            try:
                result = future.result()
            except (Exception, CancelledError) as error:
                if not pool.lost(error):
                    raise
                suspects.append(task)
            else:
                yield task, result


def _feed(
    pool: Pool, work: Callable[[Task], Result], waiting: Iterator[Task], running: dict[Future[Result], Task]
) -> list[Task]:
    """Hand out as many as may be; returns the task during whose submission the pool turned out to be broken."""
    while len(running) < pool.capacity():
        try:
            task = next(waiting)
        except StopIteration:
            break
        try:
            running[pool.submit(work, task)] = task
        except BrokenExecutor:
            return [task]
    return []


def _alone(pool: Pool, work: Callable[[Task], Result], task: Task) -> Result | WorkerDiedError:
    deaths = 1
    for _ in range(pool.tries_alone):
        begin = time.monotonic()
        try:
            future = pool.submit(work, task)
            while not wait([future], CHECK_EVERY).done:
                pool.check()
            return future.result()
        except (Exception, CancelledError) as error:
            if not pool.lost(error):
                raise
            pool.recover()
        deaths += 1
        if time.monotonic() - begin > LONG_TRY:
            break
    return WorkerDiedError(f"its worker process died {deaths} times (killed, out of memory, or a crash in a library)")
