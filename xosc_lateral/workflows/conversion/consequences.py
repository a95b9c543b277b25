"""What lifelike motion brings about: lane departures, gaps, headways, and what a reactive output does when played."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.base.rows import blocks, slices_where, stored
from xosc_lateral.workflows.conversion.load import ending_at
from xosc_lateral.workflows.conversion.result import Enriched, EntityResult, LaneDeparture, untouched
from xosc_lateral.world.motion.gaps import BoxPath, Following, Gap, RoadPath, closest_following, smallest_gaps
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.motion.segments import SegmentKind
from xosc_lateral.world.motion.trajectory import WorldTrajectory
from xosc_lateral.world.player.player import play
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.scenario import Scenario

GAP_STEP = 0.1
"""Between rows that gaps are measured on. [s]"""
CHANGES = "with offsets, what happens would happen otherwise"


def lane_departures(entity: EntityResult, network: RoadNetwork) -> Iterator[LaneDeparture]:
    """Where the enriched reference point is outside the nominal lane although the nominal one is inside: worst row."""
    motion = entity.motion
    if not entity.deviation.any():
        return
    spans = [(segment.span.first, segment.span.last) for segment in entity.segments]
    for first, last in spans + _lateral_within_a_lane(motion):
        worst: LaneDeparture | None = None
        for rows in blocks(last + 1, first):
            half = 0.5 * network.lane_width(motion.road[rows], motion.lane[rows], motion.s[rows])
            along_lane = np.where(np.cos(motion.heading_relative[rows]) >= 0.0, 1.0, -1.0)
            beyond = np.abs(motion.offset[rows] + along_lane * entity.deviation[rows]) - half
            left = (beyond > 0.0) & (np.abs(motion.offset[rows]) <= half)
            k = int(np.argmax(np.where(left, beyond, -np.inf)))
            if left[k] and (worst is None or beyond[k] > worst.beyond):
                worst = LaneDeparture(entity.name, float(motion.time[rows][k]), float(beyond[k]))
        if worst is not None:
            yield worst


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


def as_played(
    enriched: Enriched, written: Scenario, run: NominalMotion, moved: Collection[str], left: Collection[str]
) -> Enriched:
    """What a reactive output does when it is played, in place of what was sampled.

    - `written`, `run`: the output and its nominal run, which may end earlier than the one that was sampled for
    - `moved`, `left`: entities that keep their maneuvers: those with lane offsets, and those that stay as they are
    """
    motion = enriched.motion
    if run.end_time < motion.end_time - motion.step:
        run = play(
            ending_at(written, motion.end_time),
            enriched.network,
            step=motion.step,
            time_limit=motion.end_time + motion.step,
        )
    played = {entity.name: entity for entity in run.entities}
    entities = tuple(
        _measured(entity, played[entity.name])
        if entity.name in moved
        else untouched(entity.motion, entity.spans, CHANGES)
        if entity.name in left
        else entity
        for entity in enriched.entities
    )
    gaps_after = gaps_of(motion, [entity.trajectory for entity in entities])
    departures = tuple(chain.from_iterable(lane_departures(entity, enriched.network) for entity in entities))
    return replace(enriched, entities=entities, gaps_after=gaps_after, departures=departures)


def _measured(entity: EntityResult, played: EntityMotion) -> EntityResult:
    """One entity where it is when the output is played, held where that ends first."""
    motion = entity.motion
    rows = np.minimum(np.arange(len(motion.time)), len(played.time) - 1)
    x, y, z, heading, pitch, roll, speed = (
        np.asarray(getattr(played, name)[rows]) for name in ("x", "y", "z", "heading", "pitch", "roll", "speed")
    )
    deviation: FloatArray = (y - motion.y) * np.cos(motion.heading) - (x - motion.x) * np.sin(motion.heading)
    segments = tuple(
        replace(segment, offset=np.interp(segment.time, motion.time, deviation), beyond=np.empty(0))
        for segment in entity.segments
    )
    trajectory = WorldTrajectory(motion.time, x, y, z, heading, pitch, roll, speed)
    return replace(entity, segments=segments, deviation=deviation, trajectory=trajectory)


def stay_as_written(enriched: Enriched, through: Collection[str]) -> tuple[str, ...]:
    """Which lane changes and lane offsets stay as written although they are to be lifelike, a line each.

    `through`: entities whose movement goes on through them.
    """
    lines = []
    for entity in enriched.entities:
        spans = (span for span in entity.spans if span.kind is SegmentKind.LATERAL_ACTION)
        if entity.is_enriched and entity.name not in through and any(spans):
            lines.append(f"lane changes of '{entity.name}' stay as written: it keeps its actions, the player moves it")
        for crossing in entity.crossings if entity.is_enriched else ():
            if crossing.stays:
                what = "lane change" if crossing.is_lane_change else "lane offset"
                at = entity.motion.time[crossing.first]
                lines.append(f"{what} of '{entity.name}' at {at:.1f} s stays as written: {crossing.stays}")
    return tuple(lines)
