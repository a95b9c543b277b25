"""What a person or a log collector sees of a running batch; all of it on standard error."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from enum import StrEnum
from typing import TextIO

from xosc_lateral.base.names import in_terminal
from xosc_lateral.workflows.batch.batch import JobOutcome, JobState

NO_VEHICLE = "nobody"
"""Where no vehicle is under test."""

LINES_EVERY = 30.0
"""Without a terminal a line of progress comes this often. [s]"""


class Display(StrEnum):
    """How a batch is followed; failures are a line each unless it is by nothing."""

    AUTO = "auto"  # a bar on a terminal, a line now and then elsewhere
    QUIET = "quiet"
    JSON = "json"  # an object a line for every output, at the start and at the end
    NOTHING = "nothing"  # for callers that look at the outcomes themselves


@dataclass(slots=True)
class Summary:
    """How a batch went, in jobs."""

    total: int
    written: int = 0
    up_to_date: int = 0
    failed: int = 0
    stale: int = 0  # of the failed ones: those whose output of a former run is kept
    seconds: float = 0.0  # from start to end
    failures: list[tuple[str, str]] = field(default_factory=list)  # output and error
    with_warnings: int = 0
    anew: dict[str, int] = field(default_factory=dict)  # why outputs that were there were made anew -> how many
    kept: dict[str, int] = field(default_factory=dict)  # the same of those that were to be kept as they are
    cut_off: list[str] = field(default_factory=list)  # outputs of runs that the time limit cut off
    under_test: dict[str, int] = field(default_factory=dict)  # names of vehicles under test -> in how many outputs
    nobody_enriched: dict[str, int] = field(default_factory=dict)  # why no entity got offsets -> in how many outputs
    became: dict[str, tuple[JobState, float]] = field(default_factory=dict, repr=False)  # by output; what it took [s]
    _shown: set[tuple[str, str]] = field(default_factory=set, repr=False)

    def count(self, outcome: JobOutcome) -> None:
        """Take one more outcome into account."""
        row = outcome.row
        self.became[row.output] = outcome.state, outcome.seconds
        if outcome.state is JobState.FAILED:
            self.failed += 1
            self.stale += row.stale
            self.failures.append((row.output, row.error))
            return
        self.written += outcome.state is JobState.WRITTEN
        self.up_to_date += outcome.state is JobState.UP_TO_DATE
        if outcome.why:
            reasons = self.anew if outcome.state is JobState.WRITTEN else self.kept
            reasons[outcome.why] = reasons.get(outcome.why, 0) + 1
        self.with_warnings += bool(row.warnings)
        vehicles = " and ".join(row.ego) or NO_VEHICLE
        self.under_test[vehicles] = self.under_test.get(vehicles, 0) + 1
        if row.cut_off:
            self.cut_off.append(row.output)
        if not row.enriched:
            why = "; ".join(sorted({why for why in row.why_not.values() if why})) or "there are no entities"
            self.nobody_enriched[why] = self.nobody_enriched.get(why, 0) + 1

    def new_failure(self, outcome: JobOutcome) -> str:
        """A failure's line, if it was not met yet: one that all variants of a scenario share is one line."""
        key = (outcome.row.scenario, outcome.row.error)
        if outcome.state is not JobState.FAILED or key in self._shown:
            return ""
        self._shown.add(key)
        return in_terminal(f"xosc-lateral: {outcome.row.error}")

    @property
    def finished(self) -> int:
        """Jobs of which the outcome is known."""
        return self.written + self.up_to_date + self.failed + sum(self.kept.values())

    @property
    def rate(self) -> float:
        """Conversions per second so far; what was up to date doesn't count. [1/s]"""
        return (self.written + self.failed) / self.seconds if self.seconds > 0 else 0.0

    @property
    def time_left(self) -> float | None:
        """At this rate; None as long as there is none. [s]"""
        return (self.total - self.finished) / self.rate if self.rate > 0 else None

    def remarks(self) -> list[str]:
        """What a person has to know besides the counts, a line each."""
        lines = []
        if self.under_test:
            names = sorted(self.under_test.items(), key=lambda item: (item[0] == NO_VEHICLE, -item[1], item[0]))
            lines.append(f"  under test, left as written: {', '.join(f'{who} in {count}' for who, count in names)}")
        if self.with_warnings:
            lines.append(f"  {self.with_warnings} with warnings (column `warnings` of the manifest)")
        if self.nobody_enriched:
            lines.append(f"  {sum(self.nobody_enriched.values())} in which nobody was enriched:")
            reasons = sorted(self.nobody_enriched.items(), key=lambda item: (-item[1], item[0]))
            lines += [f"    {count}: {why}" for why, count in reasons]
        if self.cut_off:
            lines.append(f"  {len(self.cut_off)} end at the time limit, not by themselves ({self.cut_off[0]})")
        return lines

    def to_dict(self) -> dict[str, object]:
        """Plain JSON values."""
        values = {name: getattr(self, name) for name in self.__slots__ if name not in ("failures", "became", "_shown")}
        failures = [{"output": output, "error": error} for output, error in self.failures]
        return values | {"seconds": round(self.seconds, 3), "failures": failures}

    def text(self) -> str:
        """One line."""
        parts = [f"{self.written} written{_counted(self.anew, 'anew')}"]
        parts += [f"{self.up_to_date} up to date"] if self.up_to_date else []
        parts += [f"{sum(self.kept.values())} old ones kept{_counted(self.kept, '')}"] if self.kept else []
        kept = f" (of {self.stale} the former output is kept, stale)" if self.stale else ""
        parts += [f"{self.failed} failed{kept}"] if self.failed else []
        return f"{', '.join(parts)} of {self.total} in {_clock(self.seconds)} ({self.rate:.1f} per second)"


def follow(
    outcomes: Iterable[JobOutcome],
    total: int,
    display: Display = Display.AUTO,
    stream: TextIO | None = None,
    report: Callable[[JobOutcome], object] | None = None,
) -> Summary:
    """Run a batch of `total` outcomes to its end; show how it goes, on standard error or a `stream`; report each."""
    stream = stream or sys.stderr
    summary = Summary(total)
    start = time.monotonic()
    shower: AbstractContextManager[Show] = nullcontext(lambda outcome: None)
    if display is Display.JSON:
        shower = _json_lines(summary, stream)
    elif display is Display.AUTO and stream.isatty():
        shower = _bar(summary, stream)
    elif display is not Display.NOTHING:
        shower = nullcontext(_lines(summary, stream, LINES_EVERY if display is Display.AUTO else math.inf))
    with shower as show:
        for outcome in outcomes:
            summary.seconds = time.monotonic() - start
            summary.count(outcome)
            if report is not None:
                report(outcome)
            show(outcome)
        summary.seconds = time.monotonic() - start
    return summary


def _counted(reasons: Mapping[str, int], what: str) -> str:
    """How many of which reason, in brackets."""
    listed = ", ".join(f"{count} {why}" for why, count in sorted(reasons.items()))
    return f" ({what}{': ' if what else ''}{listed})" if listed else ""


Show = Callable[[JobOutcome], None]


@contextmanager
def _json_lines(summary: Summary, stream: TextIO) -> Iterator[Show]:
    def say(event: str, **values: object) -> None:
        print(json.dumps({"event": event, "time": round(time.time(), 3), **values}), file=stream, flush=True)

    def show(outcome: JobOutcome) -> None:
        row = outcome.row
        failed = {"error": row.error, "stale": row.stale}
        details = failed if row.error else {"sha256": row.output_sha256, "warnings": list(row.warnings)}
        say(outcome.state.value, output=row.output, scenario=row.scenario, seconds=round(outcome.seconds, 4), **details)

    say("start", total=summary.total)
    yield show
    counts = {name: value for name, value in summary.to_dict().items() if name != "failures"}
    say("end", **counts, rate=round(summary.rate, 3))


@contextmanager
def _bar(summary: Summary, stream: TextIO) -> Iterator[Show]:
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = (BarColumn(), MofNCompleteColumn(), TextColumn("{task.fields[pace]}"))
    with Progress(*columns, console=Console(file=stream), transient=True) as progress:
        task = progress.add_task("", total=summary.total, pace="")

        def show(outcome: JobOutcome) -> None:
            if failure := summary.new_failure(outcome):
                progress.console.print(failure, markup=False, highlight=False, soft_wrap=True)
            progress.update(task, completed=summary.finished, pace=_pace(summary))

        yield show


def _lines(summary: Summary, stream: TextIO, every: float) -> Show:
    next_line = every

    def show(outcome: JobOutcome) -> None:
        nonlocal next_line
        if failure := summary.new_failure(outcome):
            print(failure, file=stream, flush=True)
        if summary.seconds >= next_line:
            next_line = summary.seconds + every
            print(f"{summary.finished} of {summary.total}, {_pace(summary)}", file=stream, flush=True)

    return show


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
