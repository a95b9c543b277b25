"""Where jobs run: in this process, on this machine's cores (joblib's executor), on a dask.distributed cluster."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from types import TracebackType
from typing import Self

from xosc_lateral.pipeline.local_processes import LocalProcesses
from xosc_lateral.pipeline.tasks import TRIES_ALONE, Pool, Result, Task


class ThisProcess:
    """No workers: a task runs when it is handed out."""

    tries_alone = TRIES_ALONE

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def capacity(self) -> int:
        """One."""
        return 1

    def submit(self, work: Callable[[Task], Result], task: Task) -> Future[Result]:
        """Run it."""
        future: Future[Result] = Future()
        future.set_result(work(task))
        return future

    def recover(self) -> None:
        """Nothing to do: if a task takes this process down, that was it."""

    def lost(self, error: BaseException) -> bool:
        """Never."""
        return False

    def check(self) -> None:
        """It answers at once."""


def open_pool(workers: int, cluster: str | None) -> Pool:
    """Pool for so many processes on this machine (-1: one per core; 0: this process), or for a cluster.

    Raises
    ------
    ClusterError
        The cluster can't be reached.
    ValueError
        Fewer than none.
    """
    if cluster is not None:
        from xosc_lateral.pipeline.cluster import Cluster

        return Cluster(cluster)
    if workers == -1:
        import joblib

        workers = joblib.cpu_count()
    if workers < 0:
        raise ValueError(f"{workers} workers; at least 0 (this process), or -1 for one per core")
    return ThisProcess() if workers == 0 else LocalProcesses(workers)
