"""The line along which the player straightens the road for one entity: beside the road's reference lines, unbroken.

It starts where the entity starts and keeps its distance from the reference line of each road that the entity takes, so
lanes run straight along it and a lane change crosses them. Beyond both ends of the motion it follows the lane.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.motion.nominal import Activity, EntityMotion
from xosc_lateral.road import RoadNetwork
from xosc_lateral.road.simplify import simplify

FloatArray = NDArray[np.float64]

BEYOND = 250.0
"""How far the line goes on behind and ahead of the motion. [m]"""

STEP = 5.0
"""Between points of it. [m]"""

TOLERANCE = 0.01
"""It is simplified to this. [m]"""


def track_of(network: RoadNetwork, motion: EntityMotion) -> FloatArray:
    """Points of the line in the direction of travel, shape (n, 2), n >= 2. [m]"""
    line = _along_roads(network, motion)
    if line is None:
        line = _along_motion(motion)
    line = line[np.append(True, np.hypot(*np.diff(line, axis=0).T) > 0.5)]
    if len(line) < 2:
        row = int(np.argmax((motion.activity & Activity.ACTIVE) != 0))
        ahead = np.array([np.cos(motion.heading[row]), np.sin(motion.heading[row])])
        line = line[0] + np.array([[-1.0], [1.0]]) * ahead
    return np.asarray(line[simplify(line[:, 0], line[:, 1], TOLERANCE)])


def _along_motion(motion: EntityMotion) -> FloatArray:
    present = (motion.activity & Activity.ACTIVE) != 0
    rows = present if present.any() else np.ones_like(present)
    return np.column_stack([motion.x[rows], motion.y[rows]])


def _along_roads(network: RoadNetwork, motion: EntityMotion) -> FloatArray | None:
    """Beside the reference lines; None where the entity leaves the roads or is placed anew."""
    rows = np.flatnonzero((motion.activity & Activity.ACTIVE) != 0)
    moved = (motion.activity[rows[1:]] & Activity.TELEPORTED) != 0
    if len(rows) < 2 or moved.any() or (motion.road[rows] < 0).any() or (np.abs(motion.heading_relative) > 1.0).any():
        return None
    places = [
        *_beyond(network, motion, int(rows[0]), -1.0),
        *zip(motion.road[rows].tolist(), motion.s[rows].tolist(), strict=True),
        *_beyond(network, motion, int(rows[-1]), 1.0),
    ]
    here = np.array([motion.x[rows[0]], motion.y[rows[0]]])
    begin = int(motion.road[rows[0]])
    t = float(network.path_to_lane(here[:1], here[1:], begin, motion.s[rows[:1]], lane_types=None).t[0])
    return _beside(network, places, begin, t)


def _beside(network: RoadNetwork, places: Sequence[tuple[int, float]], begin: int, t: float) -> FloatArray:
    """Points at an even t beside one reference line after the other, shape (n, 2). [m]"""
    parts: list[FloatArray] = []
    for road, group in groupby(places, key=lambda place: place[0]):
        s = np.array([place[1] for place in group])
        if parts and road != begin:
            last = parts[-1][-1]
            t = float(network.path_to_lane(last[:1], last[1:], road, s[:1], lane_types=None).t[0])
        begin = road
        kept = np.append(True, np.diff(np.floor(s / STEP)) != 0)
        kept[-1] = True
        poses = network.road_to_world(road, s[kept], np.full(int(kept.sum()), t))
        parts.append(np.column_stack([poses.x, poses.y]))
    return np.concatenate(parts)


def _beyond(network: RoadNetwork, motion: EntityMotion, row: int, way: float) -> list[tuple[int, float]]:
    """Places along the lane behind (way -1) or ahead (+1) of a row, in the order of travel."""
    places = []
    for distance in np.arange(STEP, BEYOND, STEP):
        moved = network.advance(
            int(motion.road[row]), int(motion.lane[row]), float(motion.s[row]), float(way * distance)
        )
        if moved.remaining:
            break
        places.append((moved.road, moved.s))
    return places if way > 0 else places[::-1]
