"""What one job may take: work that exceeds it ends as an error of that job."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.base.limits import JOB_MEMORY, JOB_TIMEOUT
from xosc_lateral.base.memory import address_space
from xosc_lateral.base.signals import TimeOver, time_limit

Task = TypeVar("Task")
Result = TypeVar("Result")


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
