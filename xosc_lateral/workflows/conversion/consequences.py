"""What lifelike motion brings about: lane departures, gaps between vehicles, headways."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.base.rows import blocks, slices_where, stored
from xosc_lateral.workflows.conversion.result import EntityResult, LaneDeparture
from xosc_lateral.world.motion.gaps import BoxPath, Gap, smallest_gaps
from xosc_lateral.world.motion.headways import Following, RoadPath, closest_following
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.motion.trajectory import WorldTrajectory
from xosc_lateral.world.road.network import RoadNetwork

GAP_STEP = 0.1
"""Between rows that gaps are measured on. [s]"""


HalfWidths = dict[tuple[str, int], FloatArray]
"""Half of the width of lanes from a row of an entity on, shape (n,). [m]"""


def lane_departures(entity: EntityResult, network: RoadNetwork, known: HalfWidths | None = None) -> list[LaneDeparture]:
    """Where the enriched reference point is outside the nominal lane although the nominal one is inside: worst row.

    `known` keeps half widths for other variants of the same motion.
    """
    found: list[LaneDeparture] = []
    motion = entity.motion
    if not entity.deviation.any():
        return found
    spans = [(segment.span.first, segment.span.last) for segment in entity.segments]
    for first, last in spans + _lateral_within_a_lane(motion):
        worst: LaneDeparture | None = None
        for rows in blocks(last + 1, first):
            half = None if known is None else known.get((entity.name, rows.start))
            if half is None:
                half = 0.5 * network.lane_width(motion.road[rows], motion.lane[rows], motion.s[rows])
            if known is not None:
                known[entity.name, rows.start] = half
            along_lane = np.where(np.cos(motion.heading_relative[rows]) >= 0.0, 1.0, -1.0)
            beyond = np.abs(motion.offset[rows] + along_lane * entity.deviation[rows]) - half
            left = (beyond > 0.0) & (np.abs(motion.offset[rows]) <= half)
            k = int(np.argmax(np.where(left, beyond, -np.inf)))
            if left[k] and (worst is None or beyond[k] > worst.beyond):
                worst = LaneDeparture(entity.name, float(motion.time[rows][k]), float(beyond[k]))
        found += [] if worst is None else [worst]
    return found


def _lateral_within_a_lane(motion: EntityMotion) -> list[tuple[int, int]]:
    """First and last row of lateral actions that keep to one lane: distances kept beside others, offsets in the lane.

    Lane changes cross markings anyway.
    """

    def lateral(rows: slice) -> BoolArray:
        activity = motion.activity[rows]
        at_work = ((activity & Activity.LATERAL) != 0) & ((activity & Activity.ACTIVE) != 0)
        return np.asarray(at_work & (motion.road[rows] >= 0))

    def in_one_lane(part: slice) -> bool:
        return all((motion.lane[rows] == motion.lane[part.start]).all() for rows in blocks(part.stop, part.start))

    parts = slices_where(len(motion.time), lateral)
    return [(part.start, part.stop - 1) for part in parts if in_one_lane(part)]


def touching(motion: NominalMotion) -> dict[tuple[str, str], float]:
    """Pairs of vehicles that touch in a run, and when they overlap most. [s]"""
    return {gap.names: gap.time for gap in gaps_of(motion, motion.entities) if gap.touches}


def gaps_of(motion: NominalMotion, trajectories: Sequence[WorldTrajectory | EntityMotion]) -> tuple[Gap, ...]:
    """Smallest gap of each pair of vehicles that meet; `trajectories`: one per entity."""
    every = max(1, round(GAP_STEP / motion.step))
    vehicles = [both for both in zip(motion.entities, trajectories, strict=True) if both[0].entity.is_vehicle]
    if len(vehicles) < 2:
        return ()
    paths = []
    for entity, path in vehicles:
        box = entity.entity.bounding_box
        absent = (entity.activity[::every] & Activity.ACTIVE) == 0
        x = np.where(absent, np.nan, path.x[::every])
        x, y, heading = (stored(values) for values in (x, path.y[::every], path.heading[::every]))
        paths.append(BoxPath(entity.name, x, y, heading, box.length, box.width, box.center_x))
    return smallest_gaps(motion.entities[0].time[::every], paths)


def followings_of(
    entities: Sequence[EntityResult], network: RoadNetwork, *, enriched: bool
) -> dict[tuple[str, str], Following]:
    """Smallest headway and time to collision by (follower, leader), of the nominal or the enriched motion."""
    vehicles = [entity for entity in entities if entity.motion.entity.is_vehicle]
    return closest_following([_road_path(entity, network, enriched) for entity in vehicles])


def _road_path(entity: EntityResult, network: RoadNetwork, enriched: bool) -> RoadPath:
    motion, box = entity.motion, entity.motion.entity.bounding_box
    every = max(1, round(GAP_STEP / (motion.time[1] - motion.time[0]))) if len(motion.time) > 1 else 1
    road, lane, s = motion.road[::every], motion.lane[::every], motion.s[::every]
    present = (motion.activity[::every] & Activity.ACTIVE) != 0
    along = np.where(np.cos(motion.heading_relative[::every]) >= 0.0, 1, -1)
    offset = motion.offset[::every] + (along * entity.deviation[::every] if enriched else 0.0)
    t, forward = np.full(len(s), np.nan), np.ones(len(s), dtype=np.int_)
    on_road = road >= 0
    t[on_road] = network.offset_to_t(road[on_road], lane[on_road], s[on_road], offset[on_road])
    forward[on_road] = along[on_road] * network.travel_directions(road[on_road], lane[on_road])
    path = entity.trajectory if enriched else motion
    x, y = (np.where(present, values[::every], np.nan) for values in (path.x, path.y))
    speed = path.speed[::every]
    return RoadPath(entity.name, x, y, road, s, t, forward, speed, box.length, box.width, box.center_x)
