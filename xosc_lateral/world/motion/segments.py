"""Which segments of an entity's motion are road-following, why the rest is none, and how lane changes lead across it.

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
from enum import Enum
from math import inf

import numpy as np
from msgspec import Struct

from xosc_lateral.base.arrays import BoolArray, FloatArray, blocks
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.private_actions import LaneChangeAction, LaneOffsetAction, LateralDistanceAction

ACROSS_LANE = np.pi / 4
"""Heading relative to the lane, whichever way it is driven, beyond which the vehicle does not follow it. [rad]"""


class SegmentKind(Enum):
    """What a segment is; every value but the first is a reason why no offsets are sampled there."""

    ROAD_FOLLOWING = "road-following"
    ABSENT = "not in the scenario at that time"
    NOT_A_VEHICLE = "not a vehicle"
    TRAILER = "trailer"
    OFF_ROAD = "off the road"
    STEERED = "steered by a controller"
    TRAJECTORY = "follows a trajectory"
    LATERAL_ACTION = "lateral action"
    NOT_DRIVING_LANE = "not in a driving lane"
    ACROSS_LANE = "not heading along its lane"
    BACKWARDS = "driving backwards"
    ROAD_END = "at the end of the road"


_KINDS = tuple(SegmentKind)


class SegmentSpan(Struct, frozen=True):
    """A segment as the rows ``first`` to ``last`` (both included) of one entity, of one kind throughout."""

    kind: SegmentKind
    first: int
    last: int  # first, last: rows of the entity's motion
    start: float
    end: float  # start, end: time of those rows [s]

    @property
    def is_road_following(self) -> bool:
        """Whether offsets are sampled here."""
        return self.kind is SegmentKind.ROAD_FOLLOWING


class SegmentRow(Struct, frozen=True):
    """One segment of one entity."""

    entity: str
    start: float
    end: float  # start, end [s]
    road_following: bool
    why: str  # why it is no road-following segment; empty if it is one
    road: str
    lane: int  # road, lane: where it begins; empty and 0 off the road


def cut_segments(
    motion: EntityMotion, network: RoadNetwork, *, is_trailer: bool = False, respects_controllers: bool = True
) -> tuple[SegmentSpan, ...]:
    """Cut an entity's motion into segments, each row into exactly one; teleports cut, trailers have no driver."""
    firsts: list[tuple[int, int]] = []  # rows at which segments begin, and their kinds
    before = -1
    for rows in blocks(len(motion.time)):
        kinds = np.zeros(rows.stop - rows.start, dtype=np.int64)
        # The first reason that applies, in the enum's order.
        for kind, applies in reversed(_reasons(motion, network, rows, is_trailer, respects_controllers).items()):
            kinds[applies] = _KINDS.index(kind)
        placed_anew = (motion.activity[rows] & Activity.TELEPORTED) != 0
        cut = np.flatnonzero((np.diff(kinds, prepend=before) != 0) | placed_anew)
        firsts += zip((rows.start + cut).tolist(), kinds[cut].tolist(), strict=True)
        before = kinds[-1]
    lasts = [*(first - 1 for first, _ in firsts[1:]), len(motion.time) - 1]
    return tuple(
        SegmentSpan(_KINDS[kind], a, b, float(motion.time[a]), float(motion.time[b]))
        for (a, kind), b in zip(firsts, lasts, strict=True)
    )


def movement_runs(
    motion: NominalMotion, entity: EntityMotion, network: RoadNetwork, spans: Sequence[SegmentSpan]
) -> tuple[tuple[SegmentSpan, ...], ...]:
    """Road-following segments together with the lane changes and lane offsets between and beside them.

    A driver does not hold still to change lanes: what moves him inside his lane goes on. Not where he keeps a distance
    sideways from somebody, nor where he drives backwards, is put elsewhere at once, or is on no driving lane.
    """
    runs: list[list[SegmentSpan]] = [[]]
    for span in spans:
        if span.is_road_following or _goes_on_through(motion, entity, network, span):
            placed_anew = bool(entity.activity[span.first] & Activity.TELEPORTED)
            runs += [[span]] if placed_anew else []
            runs[-1] += [] if placed_anew else [span]
        elif runs[-1]:
            runs.append([])
    return tuple(tuple(run) for run in runs if any(span.is_road_following for span in run))


def _goes_on_through(motion: NominalMotion, entity: EntityMotion, network: RoadNetwork, span: SegmentSpan) -> bool:
    if span.kind is not SegmentKind.LATERAL_ACTION:
        return False
    kept = (one for one in motion.actions if isinstance(one.action.content, LateralDistanceAction))
    if any(one.actor == entity.name and one.start <= span.end and span.start <= (one.end or inf) for one in kept):
        return False
    ignored = (SegmentKind.LATERAL_ACTION, SegmentKind.ACROSS_LANE)
    for rows in blocks(span.last + 1, span.first):
        reasons = _reasons(entity, network, rows, is_trailer=False, respects_controllers=True)
        if any(np.any(applies) for kind, applies in reasons.items() if kind not in ignored):
            return False
    return True


def _reasons(
    motion: EntityMotion, network: RoadNetwork, rows: slice, is_trailer: bool, respects_controllers: bool
) -> dict[SegmentKind, BoolArray | bool]:
    """Where in these rows each kind applies, by the enum's order."""
    activity, road, lane, s = motion.activity[rows], motion.road[rows], motion.lane[rows], motion.s[rows]
    on_road = (road >= 0) & ((activity & Activity.OFF_ROAD) == 0)
    in_driving_lane = np.zeros(len(road), dtype=bool)
    in_driving_lane[on_road] = network.lane_index(road[on_road], lane[on_road], s[on_road])[0] >= 0
    return {
        SegmentKind.ABSENT: (activity & Activity.ACTIVE) == 0,
        SegmentKind.NOT_A_VEHICLE: not motion.entity.is_vehicle,
        SegmentKind.TRAILER: is_trailer,
        SegmentKind.OFF_ROAD: ~on_road,
        SegmentKind.STEERED: respects_controllers and (activity & Activity.STEERED) != 0,
        SegmentKind.TRAJECTORY: (activity & Activity.TRAJECTORY) != 0,
        SegmentKind.LATERAL_ACTION: (activity & Activity.LATERAL) != 0,
        SegmentKind.NOT_DRIVING_LANE: on_road & ~in_driving_lane,
        # Who overtakes on the lane of those who come towards him follows that lane.
        SegmentKind.ACROSS_LANE: np.abs(np.sin(motion.heading_relative[rows])) > np.sin(ACROSS_LANE),
        SegmentKind.BACKWARDS: motion.speed[rows] < 0.0,
        SegmentKind.ROAD_END: (activity & Activity.ROAD_END) != 0,
    }


# ---- the way across of lane changes and lane offsets: as the file writes it, and as drivers take it ----
PEAK_SHARE = 0.469
"""When drivers are fastest, of the bell's duration: the mean of 323, standard error 0.006. [-]"""
CONCENTRATION = 8.0
"""Sum of the beta distribution's exponents plus two. Between 6 and 12 the way differs by at most 0.4 % of it. [-]"""
ALPHA = 1.0 + PEAK_SHARE * (CONCENTRATION - 2.0)
BETA = CONCENTRATION - ALPHA
TENTH, NINE_TENTHS = 0.257102, 0.699345
"""Of the bell's duration, when it has done so much of the way. [-]"""
SHORTEST_DURATION, LONGEST_DURATION = 2.0, 20.0
"""Durations of actions that get the bell; below 6 s it is extrapolated. [s]"""


class Crossing(Struct, frozen=True, eq=False):
    """One lane change or lane offset action in a run."""

    first: int  # rows before and after its movement
    last: int
    way: FloatArray  # how far across on these rows, from its begin, positive to the left of travel [m]
    stays: str  # why it keeps the written way; empty: it can have the bell
    is_lane_change: bool
    path: tuple[str, ...] = ()  # of the action: its names from the story down; empty: of no single one


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
                yield Crossing(first, last, way, stays, is_lane_change, running[0].path if len(running) == 1 else ())


def leads_left(entity: EntityMotion, network: RoadNetwork, begin: float, end: float) -> bool:
    """Whether the lane that an entity is in at a time lies left of the one that it was in at an earlier one. [s]"""
    first, last = (min(int(np.searchsorted(entity.time, t)), len(entity.time) - 1) for t in (begin, end))
    aside = int(entity.lane[last]) - int(entity.lane[first])
    way = int(entity.way(np.array([first]))[0]) * network.travel_direction(
        int(entity.road[first]), int(entity.lane[first])
    )
    return aside * way > 0


def beside_written(entity: EntityMotion, crossing: Crossing) -> tuple[slice, FloatArray]:
    """Rows on which the bell is beside the written way, and by how much, positive left. [m]"""
    begin, duration = bell_time(entity, crossing)
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
    along = entity.way(rows)
    steps = along[1:] * np.diff(entity.offset[rows])
    same = (np.diff(entity.lane[rows]) == 0) & (np.diff(entity.road[rows]) == 0)
    known = np.flatnonzero(same)
    if len(known):
        steps = np.interp(np.arange(len(steps)), known, steps[known])
    return np.concatenate(([0.0], np.cumsum(steps)))


def bell_time(entity: EntityMotion, crossing: Crossing) -> tuple[float, float]:
    """Begin and duration of the bell that is at a tenth and at nine tenths of the way when the written shape is. [s]"""
    share = np.maximum.accumulate(crossing.way / crossing.way[-1])
    tenth, nine_tenths = np.interp((0.1, 0.9), share, entity.time[crossing.first : crossing.last + 1])
    duration = float(nine_tenths - tenth) / (NINE_TENTHS - TENTH)
    return float(tenth) - TENTH * duration, duration


def _why_not(entity: EntityMotion, run: Sequence[SegmentSpan], first: int, last: int, way: FloatArray) -> str:
    taken = float(entity.time[last] - entity.time[first])
    if not SHORTEST_DURATION - entity.time[1] <= taken <= LONGEST_DURATION + entity.time[1]:
        return f"it takes {taken:.2f} s, the bell is for {SHORTEST_DURATION:g} to {LONGEST_DURATION:g} s"
    if abs(way[-1]) < 1e-3 or np.max(np.abs(way)) > 1.001 * abs(way[-1]):
        return "it leads nowhere, or beyond its end"
    begin, duration = bell_time(entity, Crossing(first, last, way, "", False))
    before, behind = run[0].first, run[-1].last
    starts_there = before == 0 or bool(entity.activity[before] & Activity.TELEPORTED)
    if (begin < entity.time[before] and not starts_there) or (
        begin + duration > entity.time[behind] and behind < len(entity.time) - 1
    ):
        return "there is no time for the bell before or after it"
    return ""
