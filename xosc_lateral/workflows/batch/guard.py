"""One job within limits of time and memory: what exceeds them ends as an error of that job.

A thread beside the job raises it inside; a job stuck in a library's code takes its worker process with it, which is its
row. The system limits memory as well (`RLIMIT_AS`), so that one call that asks for too much fails at once.
"""

from __future__ import annotations

import ctypes
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.base.limits import JOB_MEMORY, JOB_TIMEOUT
from xosc_lateral.base.memory import address_space, status_bytes

Task = TypeVar("Task")
Result = TypeVar("Result")

WATCH_INTERVAL = 0.2
"""How often time and memory are looked at. [s]"""

ENDING_TIME = 30.0
"""A job that has not ended so long after it was told to takes its worker process with it. [s]"""

_worker_may_die = False


class JobLimitError(XoscLateralError):
    """A job took more time or memory than it may."""


class _Interrupted(BaseException):
    """Raised inside the job; no `except Exception` on the way holds it up."""


@dataclass(frozen=True, slots=True)
class JobLimits:
    """What one job may take: time [s], and memory on top of what the process has when the job begins [MB]."""

    timeout: float = JOB_TIMEOUT.value
    memory: float = JOB_MEMORY.value
    fixed: bool = False  # The verb has no options that raise them.

    @property
    def too_much(self) -> str:
        """Why a job was ended that took more memory."""
        return f"took more than {self.memory:g} MB of memory" + "; --job-memory raises the limit" * (not self.fixed)

    @property
    def too_long(self) -> str:
        """Why a job was ended that took more time."""
        return f"took longer than {self.timeout:g} s" + "; --job-timeout raises the limit" * (not self.fixed)


def let_worker_die() -> None:
    """This process is a worker that others replace: a job that does not end may take it down."""
    global _worker_may_die
    _worker_may_die = True


def within_limits(work: Callable[[Task], Result], task: Task, limits: JobLimits) -> Result:
    """Run ``work(task)``. Raises `JobLimitError`: it took too long, or too much memory."""
    watch = _Watch(limits)
    try:
        with address_space(limits.memory), watch:
            return work(task)
    except MemoryError as error:
        raise JobLimitError(limits.too_much) from error
    except _Interrupted as error:
        raise JobLimitError(watch.why) from error


def for_one(work: Callable[[Path], Result], path: Path, limits: JobLimits | None = None) -> Result:
    """``work(path)`` within limits, else those of a batch's scenario. Raises `JobLimitError`, which names the file."""
    try:
        return within_limits(work, path, limits or JobLimits(fixed=True))
    except JobLimitError as error:
        raise JobLimitError(f"{path}: {error}") from error


class _Watch:
    """Interrupts the thread that it is entered in; outside it, no interruption can come any more."""

    def __init__(self, limits: JobLimits) -> None:
        self._limits, self.why = limits, ""
        self._ended, self._lock = threading.Event(), threading.Lock()
        self._job = threading.get_ident()
        self._begin, self._resident = time.monotonic(), status_bytes(1)

    def __enter__(self) -> None:
        threading.Thread(target=self._run, daemon=True, name="watch job").start()

    def __exit__(self, *_: object) -> None:
        try:
            with self._lock:
                self._ended.set()
        except _Interrupted:  # told to end in the very moment in which it ended
            self._ended.set()
            raise
        if self.why:  # raised already or about to be: here, and not somewhere after us
            time.sleep(WATCH_INTERVAL)

    def _run(self) -> None:
        while not self._ended.wait(WATCH_INTERVAL):
            why = self._exceeded()
            if not why:
                continue
            with self._lock:
                if self._ended.is_set():
                    return
                self.why = why
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._job), ctypes.py_object(_Interrupted))
            if not self._ended.wait(ENDING_TIME) and _worker_may_die:
                os._exit(1)
            return

    def _exceeded(self) -> str:
        if time.monotonic() - self._begin > self._limits.timeout:
            return self._limits.too_long
        if status_bytes(1) - self._resident > 1e6 * self._limits.memory:
            return self._limits.too_much
        return ""
