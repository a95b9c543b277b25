"""Signals that end a program: an exception at once, or, while work is shared out, a wish that the work asks for."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

ENDING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Interrupted(BaseException):
    """A signal ended the run. Not a KeyboardInterrupt, which typer swallows.

    `number`: which; `finished`: how many of the outputs that were planned are there, -1 where none were planned.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number, self.finished = number, -1


_waits = False
_pending: int | None = None


def _receive(number: int, frame: FrameType | None) -> None:
    global _pending
    if not _waits or _pending is not None:  # the second one is not waited with
        raise Interrupted(number)
    _pending = number


@contextmanager
def raising_signals() -> Iterator[None]:
    """While the block runs, signals that end a program raise `Interrupted`; in a thread, nothing changes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.getsignal(number) for number in ENDING}
    for number, handler in before.items():
        if handler is not signal.SIG_IGN:  # `nohup`
            signal.signal(number, _receive)
    try:
        yield
    finally:
        for number, handler in before.items():
            if handler is not None:
                signal.signal(number, handler)


@contextmanager
def deferring_signals() -> Iterator[None]:
    """While the block runs, the first such signal is noted only: see `pending_signal`."""
    global _waits, _pending
    _waits, _pending = True, None
    try:
        yield
    finally:
        _waits, _pending = False, None


def pending_signal() -> int | None:
    """The signal that was noted."""
    return _pending


class TimeOver(BaseException):
    """The time of a block is over; no `except Exception` on the way holds it up."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Raise `TimeOver` in the block after so long; without effect in a thread, and where systems have no such alarm.

    And again ten seconds later: what is raised while garbage is collected, Python only prints. Not sooner, so that what
    ends in good order has the time for it.
    """
    if not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def over(number: int, frame: FrameType | None) -> None:
        raise TimeOver

    before = signal.signal(signal.SIGALRM, over)
    signal.setitimer(signal.ITIMER_REAL, seconds, 10.0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
