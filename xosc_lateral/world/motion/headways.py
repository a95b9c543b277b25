"""How close vehicles follow one another: time headway and time to collision of each pair on one road.

References
----------
.. [1] ISO 15623:2013, 3.7 and 3.10: time to collision is clearance over closing speed; time gap is clearance over the
       speed of the vehicle behind.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.world.surroundings.nearby import stretches_within

FOLLOWING_DISTANCE = 150.0
"""Vehicles farther apart do not follow one another: 5 s at 30 m/s. [m]"""

MINIMUM_CLOSING_SPEED = 0.1
"""Slower approaches count as none: they would take longer than any scenario. [m/s]"""


@dataclass(frozen=True, eq=False, slots=True)
class RoadPath:
    """A vehicle's way in road coordinates; arrays of shape (n,)."""

    name: str
    x: FloatArray
    y: FloatArray
    road: NDArray[np.int32]  # -1: on none
    s: FloatArray  # [m]
    t: FloatArray  # of the reference point [m]
    forward: NDArray[np.int_]  # 1: drives along s, -1: against it
    speed: FloatArray  # [m/s]
    length: float  # of the box [m]
    width: float  # [m]
    centre: float  # box centre ahead of the reference point [m]


@dataclass(frozen=True, slots=True)
class Following:
    """One vehicle behind another: the smallest time headway and time to collision of a run; infinite: never."""

    follower: str
    leader: str
    headway: float = math.inf  # free space over the follower's speed [s]
    time_to_collision: float = math.inf  # free space over the closing speed [s]


def closest_following(paths: Sequence[RoadPath]) -> dict[tuple[str, str], Following]:
    """Smallest headway and time to collision by (follower, leader), while their boxes overlap across the road."""
    closest: dict[tuple[str, str], Following] = {}
    for rows, pairs in stretches_within([path.x for path in paths], [path.y for path in paths], FOLLOWING_DISTANCE):
        for first, second in pairs:
            for follower, leader in ((first, second), (second, first)):
                _keep_closest(closest, paths[follower], paths[leader], rows)
    return closest


def _keep_closest(closest: dict[tuple[str, str], Following], follower: RoadPath, leader: RoadPath, rows: slice) -> None:
    with np.errstate(invalid="ignore", divide="ignore"):
        ahead = (leader.s[rows] - follower.s[rows]) * follower.forward[rows]
        clearance = ahead - (follower.centre + 0.5 * follower.length) - (0.5 * leader.length - leader.centre)
        behind = (
            (follower.road[rows] == leader.road[rows])
            & (follower.road[rows] >= 0)
            & (follower.forward[rows] == leader.forward[rows])
            & (np.abs(leader.t[rows] - follower.t[rows]) < 0.5 * (leader.width + follower.width))
            & (ahead > 0.0)
        )
        clearance = np.maximum(clearance[behind], 0.0)
        speed, closing = follower.speed[rows][behind], (follower.speed[rows] - leader.speed[rows])[behind]
        headway = clearance / speed
        to_collision = np.where(closing > MINIMUM_CLOSING_SPEED, clearance / closing, np.inf)
    if not behind.any():
        return
    names = (follower.name, leader.name)
    before = closest.get(names, Following(*names))
    closest[names] = Following(
        *names,
        min(before.headway, float(np.nanmin(headway, initial=np.inf))),
        min(before.time_to_collision, float(np.nanmin(to_collision, initial=np.inf))),
    )
