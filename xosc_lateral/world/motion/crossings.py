"""The way across of lane changes and lane offsets: as the file writes it, and as drivers take it.

Drivers' lateral speed in a lane change is a bell that is slightly early: that of a beta distribution over time, fitted
to 323 lane changes of 164 vehicles on one motorway [1]_, in which neither drivers nor sides nor classes differ. The
bell takes the place of a written shape with the same times at a tenth and at nine tenths of the way. Its ends then lie
before the written begin and after the written end, where it has done or has left 0.4 to 0.8 % of the way: centimetres.

It holds below 0.13 Hz, for lane changes of 6 to 13 s at 90 to 130 km/h: faster shapes are hidden by the recording's
filter, and a sinusoid through that filter fits as well.

References
----------
.. [1] DLR, "DLR Highway Traffic dataset" (DLR-HT), 2023: 542 lane changes, those apart from others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from msgspec import Struct

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.motion.segments import SegmentKind, SegmentSpan
from xosc_lateral.world.scenario.private_actions import LaneChangeAction, LaneOffsetAction

PEAK_SHARE = 0.469
"""When drivers are fastest, of the bell's duration: the mean of 323, standard error 0.006. [-]"""
CONCENTRATION = 8.0
"""Sum of the beta distribution's exponents plus two. Between 6 and 12 the way differs by at most 0.4 % of it. [-]"""
ALPHA = 1.0 + PEAK_SHARE * (CONCENTRATION - 2.0)
BETA = CONCENTRATION - ALPHA
TENTH, NINE_TENTHS = 0.257102, 0.699345
"""Of the bell's duration, when it has done so much of the way. [-]"""
SHORTEST_DURATION, LONGEST_DURATION = 3.0, 13.0
"""Durations of actions that get the bell; below 6 s it is extrapolated. [s]"""
LARGEST_SPEED_RATIO = 1.1
"""Times the written peak of lateral speed, at most. [-]"""


class Crossing(Struct, frozen=True, eq=False):
    """One lane change or lane offset action in a run."""

    first: int  # rows before and after its movement
    last: int
    way: FloatArray  # how far across on these rows, from its begin, positive to the left of travel [m]
    stays: str  # why it keeps the written way; empty: it can have the bell
    is_lane_change: bool


def crossings(motion: NominalMotion, entity: EntityMotion, runs: Sequence[Sequence[SegmentSpan]]) -> Iterator[Crossing]:
    """Lane changes and lane offsets of an entity that its movement goes on through (`movement_runs`)."""
    kinds = (LaneChangeAction, LaneOffsetAction)
    actions = [one for one in motion.actions if one.actor == entity.name and isinstance(one.action.content, kinds)]
    for run in runs:
        for span in run:
            if span.kind is SegmentKind.LATERAL_ACTION:
                running = [one for one in actions if one.start <= span.end and span.start <= (one.end or np.inf)]
                first, last = max(span.first - 1, run[0].first), span.last
                way = _way(entity, first, last)
                stays = "another action overrules it, or it does not end" if len(running) != 1 else ""
                stays = stays or _why_not(entity, run, first, last, way)
                is_lane_change = any(isinstance(one.action.content, LaneChangeAction) for one in running)
                yield Crossing(first, last, way, stays, is_lane_change)


def beside_written(entity: EntityMotion, crossing: Crossing) -> tuple[slice, FloatArray]:
    """Rows on which the bell is beside the written way, and by how much, positive left. [m]"""
    begin, duration = _bell_time(entity, crossing)
    rows = slice(*np.searchsorted(entity.time, (begin, begin + duration)))
    rows = slice(min(rows.start, crossing.first), max(rows.stop, crossing.last + 1))
    done = bell_share(np.clip((entity.time[rows] - begin) / duration, 0.0, 1.0))
    written = np.interp(np.arange(rows.start, rows.stop), np.arange(crossing.first, crossing.last + 1), crossing.way)
    return rows, np.asarray(crossing.way[-1] * done - written)


def bell_share(u: FloatArray) -> FloatArray:
    """Share of the way over share of the bell's duration, 0 to 1, any shape. [-]"""
    from scipy.special import betainc

    return np.asarray(betainc(ALPHA, BETA, u), dtype=np.float64)


def _way(entity: EntityMotion, first: int, last: int) -> FloatArray:
    """From the first row on, over lanes: where the lane changes under the vehicle, it goes on as before and after."""
    rows = slice(first, last + 1)
    along = np.where(np.cos(entity.heading_relative[rows]) >= 0.0, 1.0, -1.0)
    steps = along[1:] * np.diff(entity.offset[rows])
    same = (np.diff(entity.lane[rows]) == 0) & (np.diff(entity.road[rows]) == 0)
    known = np.flatnonzero(same)
    if len(known):
        steps = np.interp(np.arange(len(steps)), known, steps[known])
    return np.concatenate(([0.0], np.cumsum(steps)))


def _bell_time(entity: EntityMotion, crossing: Crossing) -> tuple[float, float]:
    """Begin and duration of the bell that is at a tenth and at nine tenths of the way when the written shape is. [s]"""
    share = np.maximum.accumulate(crossing.way / crossing.way[-1])
    tenth, nine_tenths = np.interp((0.1, 0.9), share, entity.time[crossing.first : crossing.last + 1])
    duration = float(nine_tenths - tenth) / (NINE_TENTHS - TENTH)
    return float(tenth) - TENTH * duration, duration


def _why_not(entity: EntityMotion, run: Sequence[SegmentSpan], first: int, last: int, way: FloatArray) -> str:
    taken = float(entity.time[last] - entity.time[first])
    if not SHORTEST_DURATION - entity.time[1] <= taken <= LONGEST_DURATION + entity.time[1]:
        return f"it takes {taken:.1f} s, the bell is for {SHORTEST_DURATION:g} to {LONGEST_DURATION:g} s"
    if abs(way[-1]) < 1e-3 or np.max(np.abs(way)) > 1.001 * abs(way[-1]):
        return "it leads nowhere, or beyond its end"
    begin, duration = _bell_time(entity, Crossing(first, last, way, "", False))
    before, behind = run[0].first, run[-1].last
    starts_there = before == 0 or bool(entity.activity[before] & Activity.TELEPORTED)
    if (begin < entity.time[before] and not starts_there) or (
        begin + duration > entity.time[behind] and behind < len(entity.time) - 1
    ):
        return "there is no time for the bell before or after it"
    peak = PEAK_SHARE ** (ALPHA - 1.0) * (1.0 - PEAK_SHARE) ** (BETA - 1.0) / _beta_function(ALPHA, BETA) / duration
    written = float(np.max(np.abs(np.diff(way)) / np.diff(entity.time[first : last + 1]))) / abs(way[-1])
    return (
        ""
        if peak <= LARGEST_SPEED_RATIO * written
        else f"the bell would be {peak / written:.2f} times as fast sideways"
    )


def _beta_function(a: float, b: float) -> float:
    from math import gamma

    return gamma(a) * gamma(b) / gamma(a + b)
