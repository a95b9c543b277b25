"""What lifelike motion brings about: lane departures, and gaps between vehicles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.enrich.result import EntityResult, LaneDeparture
from xosc_lateral.mask import true_slices
from xosc_lateral.motion.gaps import BoxPath, Gap, smallest_gaps
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.motion.trajectory import WorldTrajectory
from xosc_lateral.road.network import RoadNetwork

GAP_STEP = 0.1
"""Rows that gaps are looked for on. [s]"""


def lane_departures(entity: EntityResult, network: RoadNetwork) -> list[LaneDeparture]:
    """Where the enriched reference point is outside the nominal lane although the nominal one is inside: worst row."""
    found = []
    motion = entity.motion
    spans = [(segment.span.first, segment.span.last) for segment in entity.segments]
    for first, last in spans + _lateral_within_a_lane(motion):
        rows = slice(first, last + 1)
        half = 0.5 * network.lane_width(motion.road[rows], motion.lane[rows], motion.s[rows])
        along_lane = np.where(np.cos(motion.heading_relative[rows]) >= 0.0, 1.0, -1.0)
        beyond = np.abs(motion.offset[rows] + along_lane * entity.deviation[rows]) - half
        left = (beyond > 0.0) & (np.abs(motion.offset[rows]) <= half)
        if left.any():
            worst = int(np.argmax(np.where(left, beyond, -np.inf)))
            found.append(LaneDeparture(entity.name, float(motion.time[rows][worst]), float(beyond[worst])))
    return found


def _lateral_within_a_lane(motion: EntityMotion) -> list[tuple[int, int]]:
    """First and last row of lateral actions that keep to one lane: distances kept beside others, offsets in the lane.

    Lane changes cross markings anyway.
    """
    lateral = (
        ((motion.activity & Activity.LATERAL) != 0) & ((motion.activity & Activity.ACTIVE) != 0) & (motion.road >= 0)
    )
    return [(part.start, part.stop - 1) for part in true_slices(lateral) if len(set(motion.lane[part].tolist())) == 1]


def gaps_of(motion: NominalMotion, trajectories: Sequence[WorldTrajectory]) -> tuple[Gap, ...]:
    """Smallest gap of each pair of vehicles that meet; `trajectories`: one per entity."""
    every = max(1, round(GAP_STEP / motion.step))
    paths = []
    for entity, path in zip(motion.entities, trajectories, strict=True):
        if not entity.entity.is_vehicle:
            continue
        box = entity.entity.bounding_box
        absent = ((entity.activity & Activity.ACTIVE) == 0)[::every]
        x = np.where(absent, np.nan, path.x[::every])
        paths.append(
            BoxPath(entity.name, x, path.y[::every], path.heading[::every], box.length, box.width, box.center_x)
        )
    if not paths:
        return ()
    return smallest_gaps(motion.entities[0].time[::every], paths)
