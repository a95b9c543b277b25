"""Jobs in processes of this machine: joblib's executor, workers that end with their parent."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future
from types import TracebackType
from typing import Any, Self

from xosc_lateral.pipeline.guard import let_worker_die
from xosc_lateral.pipeline.tasks import AHEAD, TRIES_ALONE, Result, Task

PARENT_CHECK = 0.5
"""How often a worker looks whether its run is still there. [s]"""

PR_SET_PDEATHSIG = 1
"""Of Linux's prctl(2), from <linux/prctl.h>: the signal that this process gets when its parent ends."""


class LocalProcesses:
    """Worker processes of joblib's executor (loky).

    Parameters
    ----------
    count : int
        How many.
    """

    tries_alone = TRIES_ALONE

    def __init__(self, count: int) -> None:
        self._count = count
        self._executor = self._start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._executor.shutdown(wait=True, kill_workers=error is not None)

    def capacity(self) -> int:
        """A few per worker."""
        return AHEAD * self._count

    def submit(self, work: Callable[[Task], Result], task: Task) -> Future[Result]:
        """Hand out a task."""
        future: Future[Result] = self._executor.submit(work, task)
        return future

    def recover(self) -> None:
        """Start anew."""
        self._executor.shutdown(wait=True, kill_workers=True)
        self._executor = self._start()

    def lost(self, error: BaseException) -> bool:
        """Whether the pool broke."""
        return isinstance(error, BrokenExecutor)

    def check(self) -> None:
        """The executor sees by itself when a process is gone."""

    def _start(self) -> Any:
        from joblib.externals.loky import ProcessPoolExecutor

        # One thread each for numpy's and numba's libraries: as many workers as cores are busy already.
        threads = dict.fromkeys(
            ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
        )
        return ProcessPoolExecutor(
            max_workers=self._count, env=threads, initializer=_end_with_parent, initargs=(os.getpid(),)
        )


def _end_with_parent(parent: int) -> None:
    """End this worker with the run that it works for, even if that was killed and could not say so.

    On Linux the kernel sees to it at once: nothing is left that could still write when the next run begins. Elsewhere,
    and if the run was gone before this was said, a thread looks every `PARENT_CHECK`.
    """
    let_worker_die()
    if sys.platform.startswith("linux"):
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_CHECK)
        os._exit(1)

    threading.Thread(target=watch, daemon=True, name="watch parent").start()
