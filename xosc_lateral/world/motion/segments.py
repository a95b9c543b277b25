"""Which segments of an entity's motion are road-following, and why the rest is none."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from math import inf

import numpy as np
from msgspec import Struct

from xosc_lateral.base.arrays import BoolArray, IntArray
from xosc_lateral.base.rows import blocks
from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.private_actions import LateralDistanceAction

_ACROSS_LANE = np.pi / 4
"""Heading relative to the lane, whichever way it is driven, beyond which the vehicle does not follow it. [rad]"""

_SPEED_SLACK = 1e-6
"""40 km/h written as 11.1111 in a scenario is meant as 40 km/h. [m/s, relative]"""


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
    SLOW = "below 40 km/h"
    ROAD_END = "at the end of the road"


_KINDS = tuple(SegmentKind)


class SegmentSpan(Struct, frozen=True):
    """A segment as the rows ``first`` to ``last`` (both included) of one entity, of one kind throughout."""

    kind: SegmentKind
    first: int
    last: int
    """Rows of the entity's motion."""
    start: float
    end: float
    """Time of those rows. [s]"""

    @property
    def is_road_following(self) -> bool:
        """Whether offsets are sampled here."""
        return self.kind is SegmentKind.ROAD_FOLLOWING


class SegmentRow(Struct, frozen=True):
    """One segment of one entity."""

    entity: str
    start: float
    end: float
    """[s]"""
    road_following: bool
    why: str
    """Why it is no road-following segment; empty if it is one."""
    road: str
    lane: int
    """Where it begins; empty and 0 off the road."""


def cut_segments(
    motion: EntityMotion, network: RoadNetwork, *, is_trailer: bool = False, heeds_controllers: bool = True
) -> tuple[SegmentSpan, ...]:
    """Cut an entity's whole motion into segments, each row into exactly one; teleports always cut.

    `is_trailer`: the entity is pulled by another, and has no driver; `heeds_controllers`: where one steers, no driver
    does.
    """
    firsts: list[tuple[int, int]] = []  # rows at which segments begin, and their kinds
    before = -1
    for rows in blocks(len(motion.time)):
        kinds = _row_kinds(motion, network, rows, is_trailer, heeds_controllers)
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
    sideways from somebody, nor where he drives too slowly, is put elsewhere at once, or is on no driving lane.
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
        reasons = _reasons(entity, network, rows, is_trailer=False, heeds_controllers=True)
        if any(np.any(applies) for kind, applies in reasons.items() if kind not in ignored):
            return False
    return True


def _row_kinds(
    motion: EntityMotion, network: RoadNetwork, rows: slice, is_trailer: bool, heeds_controllers: bool
) -> IntArray:
    """Kind of each of these rows, as its index in `SegmentKind`; the first reason that applies, in the enum's order."""
    kinds = np.zeros(rows.stop - rows.start, dtype=np.int64)
    for kind, applies in reversed(_reasons(motion, network, rows, is_trailer, heeds_controllers).items()):
        kinds[applies] = _KINDS.index(kind)
    return kinds


def _reasons(
    motion: EntityMotion, network: RoadNetwork, rows: slice, is_trailer: bool, heeds_controllers: bool
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
        SegmentKind.STEERED: heeds_controllers and (activity & Activity.STEERED) != 0,
        SegmentKind.TRAJECTORY: (activity & Activity.TRAJECTORY) != 0,
        SegmentKind.LATERAL_ACTION: (activity & Activity.LATERAL) != 0,
        SegmentKind.NOT_DRIVING_LANE: on_road & ~in_driving_lane,
        # Who overtakes on the lane of those who come towards him follows that lane.
        SegmentKind.ACROSS_LANE: np.abs(np.sin(motion.heading_relative[rows])) > np.sin(_ACROSS_LANE),
        SegmentKind.SLOW: motion.speed[rows] < MINIMUM_SPEED * (1.0 - _SPEED_SLACK),
        SegmentKind.ROAD_END: (activity & Activity.ROAD_END) != 0,
    }
