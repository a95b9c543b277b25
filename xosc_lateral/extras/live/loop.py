"""A simulation with drivers in it, step by step from its start to its end, whatever simulates; and what it did."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any, Protocol

from xosc_lateral.base.errors import XoscLateralError
from xosc_lateral.base.grouping import grouped

Row = tuple[Any, ...]
"""Of one vehicle at one time, by `call.TRACE_COLUMNS`."""

Spans = Mapping[str, Collection[tuple[float, float]]]
"""From when to when actions ran, by their path in the storyboard. [s]"""

SAME_DURATION = 0.05
"""Two frames of a player at its slowest usual rate. [s]"""


class RunningSimulation(Protocol):
    """What runs, with drivers in it."""

    def time(self) -> float:
        """Now. [s]"""

    def is_over(self) -> bool:
        """Whether it has ended by itself."""

    def rows(self) -> Iterable[Row]:
        """Where everybody is now."""

    def drive(self, step: float) -> None:
        """On by a step [s], everybody in it. Raises `SimulationError`: it can't."""


def run_to_end(simulation: RunningSimulation, end: float, step: float) -> list[Row]:
    """Rows of all steps [s] until the end [s], or its own; the first are those of its start."""
    rows: list[Row] = []
    while True:
        rows.extend(simulation.rows())
        if simulation.is_over() or simulation.time() > end - 0.5 * step:
            return rows
        simulation.drive(step)


def later_actions(scenario: Path, spans: Spans, end: float) -> list[str]:
    """Lateral actions that took longer, or less long, from where a driver was than from where they would have begun.

    As the same scenario is played without drivers until its `end` [s]: one that moves at a given rate, or within an
    acceleration, takes as long as its way. A line each.
    """
    from xosc_lateral.workflows.conversion.load import play_scenario

    if not spans:
        return []
    try:
        played = play_scenario(scenario, time_limit=end).motion.actions
    except XoscLateralError as error:
        return [f"whether lateral actions end later than without drivers is not known: {' '.join(str(error).split())}"]
    durations = {"::".join(one.path): one.end - one.start for one in played if one.end is not None}
    lines = []
    for path, runs in spans.items():
        for begin, over in runs:
            usual = durations.get(path, over - begin)
            if abs(over - begin - usual) > SAME_DURATION:
                what = f"lateral action {path.rpartition('::')[2]!r} at {begin:.2f} s took {over - begin:.2f} s"
                lines.append(f"{what} from where the driver was, {usual:.2f} s without drivers")
    return lines


def not_driven(why: Mapping[str, str]) -> list[str]:
    """Vehicles that had no driver of ours, by the reason for it: a line each."""
    names = grouped((reason, repr(name)) for name, reason in why.items())
    return [f"not driven, {reason}: {', '.join(sorted(who))}" for reason, who in names.items()]
