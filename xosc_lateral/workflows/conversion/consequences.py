"""What a user has to know of lifelike motion: lanes left, maneuvers left as written, profiles out of their range."""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from xosc_lateral.base.arrays import BoolArray, blocks, slices_where
from xosc_lateral.workflows.conversion.result import Enriched, EntityResult, LaneDeparture
from xosc_lateral.world.motion.nominal import Activity, EntityMotion
from xosc_lateral.world.motion.segments import Crossing
from xosc_lateral.world.road.network import RoadNetwork


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
            along_lane = motion.way(rows)
            beyond = np.abs(motion.offset[rows] + along_lane * entity.deviation[rows]) - half
            outside = (beyond > 0.0) & (np.abs(motion.offset[rows]) <= half)
            k = int(np.argmax(np.where(outside, beyond, -np.inf)))
            if outside[k] and (worst is None or beyond[k] > worst.beyond):
                worst = LaneDeparture(entity.name, float(motion.time[rows][k]), float(beyond[k]))
        if worst is not None:
            yield worst


def _lateral_within_a_lane(motion: EntityMotion) -> list[tuple[int, int]]:
    """First and last row of lateral actions that keep to one lane; lane changes cross markings anyway."""

    def lateral(rows: slice) -> BoolArray:
        activity = motion.activity[rows]
        at_work = ((activity & Activity.LATERAL) != 0) & ((activity & Activity.ACTIVE) != 0)
        return np.asarray(at_work & (motion.road[rows] >= 0))

    return [
        (part.start, part.stop - 1)
        for part in slices_where(len(motion.time), lateral)
        if all((motion.lane[rows] == motion.lane[part.start]).all() for rows in blocks(part.stop, part.start))
    ]


def stay_as_written(enriched: Enriched, on_trajectories: Collection[str]) -> tuple[str, ...]:
    """Lane changes on trajectories that stay as written although they are to be lifelike."""
    return tuple(
        stays_as_written(entity.motion, crossing, crossing.stays)
        for entity in enriched.entities
        for crossing in (entity.crossings if entity.is_enriched and entity.name in on_trajectories else ())
        if crossing.stays
    )


def stays_as_written(motion: EntityMotion, crossing: Crossing, why: str) -> str:
    """Of one, in a line."""
    what = "lane change" if crossing.is_lane_change else "lane offset"
    return f"{what} of '{motion.name}' at {motion.time[crossing.first]:.1f} s stays as written: {why}"


def validity_warnings(enriched: Enriched) -> tuple[str, ...]:
    """A line for each profile that moves vehicles at speeds or in lanes that it was not measured in."""
    network = enriched.network
    speeds: dict[str, list[float]] = {}
    widths: dict[str, list[float]] = {}
    profiles = {one.profile.name: one.profile for one in enriched.entities if one.profile is not None and one.segments}
    for entity in enriched.entities if profiles else ():
        motion, name = entity.motion, "" if entity.profile is None else entity.profile.name
        for span in (segment.span for segment in entity.segments):
            speed, width = [], []
            for rows in blocks(span.last + 1, span.first):
                speed += [float(motion.speed[rows].min()), float(motion.speed[rows].max())]
                # A lane that begins or ends is narrow for a moment.
                width.append(float(np.median(network.lane_width(motion.road[rows], motion.lane[rows], motion.s[rows]))))
            speeds.setdefault(name, []).extend((min(speed), max(speed)))
            widths.setdefault(name, []).extend((min(width), max(width)))
    lines = []
    for name, profile in profiles.items():
        outside = profile.validity.departures(np.array(speeds[name]), np.array(widths[name]))
        if outside:
            lines.append(f"profile {name} is used beyond what was measured: {'; '.join(outside)}")
    return tuple(lines)
