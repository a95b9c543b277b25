"""What a person or a log collector sees of a running batch; all of it on standard error."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from typing import TextIO

from xosc_lateral.pipeline.batch import Outcome, State

LINES_EVERY = 30.0
"""Without a terminal a line of progress comes this often. [s]"""


class Display(StrEnum):
    """How a batch is followed."""

    AUTO = "auto"
    """A bar on a terminal, a line now and then elsewhere; every failure and warning a line."""
    QUIET = "quiet"
    """Failures alone."""
    JSON = "json"
    """One JSON object a line for every output, at the start and at the end."""


@dataclass(slots=True)
class Summary:
    """How a batch went.

    Parameters
    ----------
    total, written, up_to_date, failed : int
        Jobs.
    seconds : float
        From start to end. [s]
    failures : list of (str, str)
        Output and error.
    """

    total: int
    written: int = 0
    up_to_date: int = 0
    failed: int = 0
    seconds: float = 0.0
    failures: list[tuple[str, str]] = field(default_factory=list)

    def count(self, outcome: Outcome) -> None:
        """Take one more outcome into account."""
        if outcome.state is State.WRITTEN:
            self.written += 1
        elif outcome.state is State.UP_TO_DATE:
            self.up_to_date += 1
        else:
            self.failed += 1
            self.failures.append((outcome.row.output, outcome.row.error))

    @property
    def finished(self) -> int:
        """Jobs of which the outcome is known."""
        return self.written + self.up_to_date + self.failed

    @property
    def rate(self) -> float:
        """Conversions per second so far; what was up to date doesn't count. [1/s]"""
        return (self.written + self.failed) / self.seconds if self.seconds > 0 else 0.0

    @property
    def time_left(self) -> float | None:
        """At this rate; None as long as there is none. [s]"""
        return (self.total - self.finished) / self.rate if self.rate > 0 else None

    def text(self) -> str:
        """One line."""
        parts = [f"{self.written} written"]
        parts += [f"{self.up_to_date} up to date"] if self.up_to_date else []
        parts += [f"{self.failed} failed"] if self.failed else []
        return f"{', '.join(parts)} of {self.total} in {_clock(self.seconds)} ({self.rate:.1f} per second)"


def follow(
    outcomes: Iterable[Outcome], total: int, display: Display = Display.AUTO, stream: TextIO | None = None
) -> Summary:
    """Run a batch to its end and show how it goes.

    Parameters
    ----------
    outcomes : iterable of Outcome
        From `convert_many`.
    total : int
        How many there will be.
    display : Display
    stream : text stream, optional
        Default: standard error.
    """
    stream = stream or sys.stderr
    summary = Summary(total)
    start = time.monotonic()
    with _shower(display, summary, stream) as show:
        for outcome in outcomes:
            summary.seconds = time.monotonic() - start
            summary.count(outcome)
            show(outcome)
        summary.seconds = time.monotonic() - start
    return summary


Show = Callable[[Outcome], None]


@contextmanager
def _shower(display: Display, summary: Summary, stream: TextIO) -> Iterator[Show]:
    if display is Display.JSON:
        with _json_lines(summary, stream) as show:
            yield show
    elif display is Display.QUIET:
        yield lambda outcome: _say_failure(outcome, stream)
    elif stream.isatty():
        with _bar(summary, stream) as show:
            yield show
    else:
        yield _lines(summary, stream)


@contextmanager
def _json_lines(summary: Summary, stream: TextIO) -> Iterator[Show]:
    def say(event: str, **values: object) -> None:
        print(json.dumps({"event": event, "time": round(time.time(), 3), **values}), file=stream, flush=True)

    def show(outcome: Outcome) -> None:
        row = outcome.row
        details = {"error": row.error} if row.error else {"sha256": row.output_hash, "warnings": list(row.warnings)}
        say(outcome.state.value, output=row.output, scenario=row.scenario, seconds=round(outcome.seconds, 4), **details)

    say("start", total=summary.total)
    yield show
    say("end", **{name: value for name, value in asdict(summary).items() if name != "failures"}, rate=summary.rate)


@contextmanager
def _bar(summary: Summary, stream: TextIO) -> Iterator[Show]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[pace]}"))
    with Progress(*columns, console=Console(file=stream), transient=True) as progress:
        task = progress.add_task("", total=summary.total, pace="")

        def show(outcome: Outcome) -> None:
            if outcome.state is State.FAILED:
                progress.console.print(_failure(outcome), markup=False, highlight=False, soft_wrap=True)
            progress.update(task, completed=summary.finished, pace=_pace(summary))

        yield show


def _lines(summary: Summary, stream: TextIO) -> Show:
    next_line = LINES_EVERY

    def show(outcome: Outcome) -> None:
        nonlocal next_line
        _say_failure(outcome, stream)
        if summary.seconds >= next_line:
            next_line = summary.seconds + LINES_EVERY
            print(f"{summary.finished} of {summary.total}, {_pace(summary)}", file=stream, flush=True)

    return show


def _say_failure(outcome: Outcome, stream: TextIO) -> None:
    if outcome.state is State.FAILED:
        print(_failure(outcome), file=stream, flush=True)


def _failure(outcome: Outcome) -> str:
    return f"xosc-lateral: {outcome.row.error}"


def _pace(summary: Summary) -> str:
    left = "" if summary.time_left is None else f", {_clock(summary.time_left)} left"
    failed = f", {summary.failed} failed" if summary.failed else ""
    return f"{summary.rate:.1f} per second{left}{failed}"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(seconds, 60.0)
    if minutes < 1:
        return f"{rest:.1f} s"
    hours, minutes = divmod(int(minutes), 60)
    return f"{hours}:{minutes:02d}:{int(rest):02d}" if hours else f"{minutes}:{int(rest):02d} min"
