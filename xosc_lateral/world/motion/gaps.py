"""Free space between vehicles: between their bounding boxes, seen from above, and to the one ahead over the speed.

References
----------
.. [1] C. Ericson, "Real-Time Collision Detection", 2005, sections 5.1.2 (point and line segment) and 5.2.1
       (separating axes).
.. [2] ISO 15623:2013, 3.7 and 3.10: time to collision is clearance over closing speed; time gap is clearance over the
       speed of the vehicle behind.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BLOCK, BoolArray, FloatArray
from xosc_lateral.base.track import Track
from xosc_lateral.world.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.surroundings.around import stretches_within

GAP_STEP = 0.1
"""Between rows that gaps are measured on. [s]"""

MAXIMUM_GAP = 30.0
"""Boxes farther apart than this at all times are no pair worth naming. [m]"""

LEAST_SIZE = 1e-9
"""A box is at least this long and wide: sides without a length have no direction. [m]"""

PAIRS_PER_CALL = 256
"""Pairs whose boxes are compared at once: a numpy call costs as much as some hundred boxes. [-]"""


class Gap(Struct, frozen=True):
    """Smallest free space between two vehicles over a run; 0: they touch."""

    names: tuple[str, str]
    distance: float  # [m]
    time: float  # when it is reached first [s]

    @property
    def touches(self) -> bool:
        """Whether the boxes overlap or meet."""
        return self.distance <= 0.0


def contacts_of(gaps: Iterable[Gap]) -> dict[tuple[str, str], float]:
    """When each pair that touches does so first. [s]"""
    return {gap.names: gap.time for gap in gaps if gap.touches}


def gaps_of(motion: NominalMotion, paths: Sequence[Track]) -> tuple[Gap, ...]:
    """Smallest gap of each pair of a run that meets, who walks and what lies there, too; `paths`: one per entity."""
    every = slice(None, None, max(1, round(GAP_STEP / motion.step)))
    if len(paths) < 2:
        return ()
    boxes = []
    for entity, path in zip(motion.entities, paths, strict=True):
        absent = (entity.activity[every] & Activity.ACTIVE) == 0
        x = np.where(absent, np.nan, path.x[every])
        y, heading = path.y[every], path.heading[every]
        boxes.append(EntityMotion.of(entity.entity, entity.time[every], x=x, y=y, heading=heading))
    return smallest_gaps(boxes)


def smallest_gaps(paths: Sequence[EntityMotion]) -> tuple[Gap, ...]:
    """Smallest gap of each pair that comes within `MAXIMUM_GAP` of each other, on one time grid; x is NaN: absent."""
    smallest: dict[tuple[int, int], Gap] = {}
    for part in _together(_near_pairs(paths)):
        a, b = ([(paths[pair[side]], near) for pair, near in part] for side in (0, 1))
        distances = box_distance(corners(a), corners(b))
        ends = np.cumsum([len(near) for _, near in part])
        for (pair, near), distance in zip(part, np.split(distances, ends[:-1]), strict=True):
            best = int(np.argmin(distance))
            if distance[best] <= MAXIMUM_GAP and not (pair in smallest and smallest[pair].distance <= distance[best]):
                names = paths[pair[0]].name, paths[pair[1]].name
                smallest[pair] = Gap(names, float(distance[best]), float(paths[0].time[near[best]]))
    return tuple(smallest[pair] for pair in sorted(smallest))


_NearPair = tuple[tuple[int, int], NDArray[np.intp]]


def _near_pairs(paths: Sequence[EntityMotion]) -> Iterator[_NearPair]:
    """Pairs that come near each other, and rows of a stretch on which their gap may be the smallest."""
    boxes = [path.box for path in paths]
    extent = max((np.hypot(box.length, box.width) / 2 + abs(box.center_x) for box in boxes), default=0.0)
    x, y = [path.x for path in paths], [path.y for path in paths]
    for rows, pairs in stretches_within(x, y, MAXIMUM_GAP + 2 * extent):
        for first, second in pairs:
            a, b = boxes[first], boxes[second]
            half_diagonals = 0.5 * (np.hypot(a.length, a.width) + np.hypot(b.length, b.width))
            between = np.hypot(x[first][rows] - x[second][rows], y[first][rows] - y[second][rows])
            apart = between - half_diagonals - abs(a.center_x) - abs(b.center_x)
            near = np.flatnonzero(apart <= MAXIMUM_GAP)
            if len(near):
                # the exact distance is only needed where a lower bound of it undercuts the best upper bound
                upper = np.min(between[near]) + abs(a.center_x) + abs(b.center_x)
                yield (first, second), rows.start + near[apart[near] <= upper]


def _together(pairs: Iterator[_NearPair]) -> Iterator[list[_NearPair]]:
    """As many as are looked at at once."""
    part: list[_NearPair] = []
    rows = 0
    for pair in pairs:
        part.append(pair)
        rows += len(pair[1])
        if len(part) == PAIRS_PER_CALL or rows >= BLOCK:
            yield part
            part, rows = [], 0
    if part:
        yield part


def corners(boxes: Sequence[tuple[EntityMotion, NDArray[np.intp]]]) -> FloatArray:
    """Corners of boxes on some rows each, counter-clockwise, one box after the other, shape (n, 4, 2). [m]"""
    x, y, heading = (np.concatenate([one.columns[name][rows] for one, rows in boxes])[:, None] for name in _POSE)
    counts = [len(rows) for _, rows in boxes]
    length, width, centre, beside = (
        np.repeat([getattr(one.box, name) for one, _ in boxes], counts)[:, None] for name in _SIZE
    )
    ahead = centre + 0.5 * length * np.array([1.0, -1.0, -1.0, 1.0])
    left = beside + 0.5 * width * np.array([1.0, 1.0, -1.0, -1.0])
    cos, sin = np.cos(heading), np.sin(heading)
    return np.stack([x + ahead * cos - left * sin, y + ahead * sin + left * cos], axis=-1)


_POSE, _SIZE = ("x", "y", "heading"), ("length", "width", "center_x", "center_y")


def box_distance(a: FloatArray, b: FloatArray) -> FloatArray:
    """Distance between rectangles from their corners in order, row by row, (n, 4, 2) to (n,); 0: they overlap. [m]"""
    # convex shapes are nearest to each other at a corner of one of them, and apart if a side of one parts them
    from_a, apart_of_a = _beyond(a, b)
    from_b, apart_of_b = _beyond(b, a)
    return np.where(apart_of_a | apart_of_b, np.minimum(from_a, from_b), 0.0)


def _beyond(box: FloatArray, corners: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Distance of the nearest corner from a box that they are not in [m], and whether a side of it parts them."""
    x, y = (np.ascontiguousarray(corners[..., k].T) - 0.5 * (box[:, 0, k] + box[:, 2, k]) for k in (0, 1))
    outside, parted = [], np.zeros(len(box), dtype=bool)
    for neighbour in (1, 3):
        east, north = (0.5 * (box[:, 0, k] - box[:, neighbour, k]) for k in (0, 1))
        half = np.maximum(np.hypot(east, north), LEAST_SIZE)
        along = (x * east + y * north) / half
        parted |= (along.min(axis=0) > half) | (along.max(axis=0) < -half)
        outside.append(np.maximum(np.abs(along) - half, 0.0))
    return np.hypot(*outside).min(axis=0), parted


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


def road_path(motion: EntityMotion, network: RoadNetwork, path: Track, deviation: FloatArray | float) -> RoadPath:
    """Way of a vehicle that drives a path beside its nominal motion, `deviation` to the left. [m]"""
    box = motion.entity.bounding_box
    every = max(1, round(GAP_STEP / (motion.time[1] - motion.time[0]))) if len(motion.time) > 1 else 1
    road, lane, s = motion.road[::every], motion.lane[::every], motion.s[::every]
    present = (motion.activity[::every] & Activity.ACTIVE) != 0
    along = motion.way(slice(None, None, every))
    offset = motion.offset[::every] + along * np.broadcast_to(deviation, len(motion.time))[::every]
    t, forward = np.full(len(s), np.nan), np.ones(len(s), dtype=np.int_)
    on_road = road >= 0
    t[on_road] = network.offset_to_t(road[on_road], lane[on_road], s[on_road], offset[on_road])
    forward[on_road] = along[on_road] * network.travel_directions(road[on_road], lane[on_road])
    x, y = (np.where(present, values[::every], np.nan) for values in (path.x, path.y))
    return RoadPath(motion.name, x, y, road, s, t, forward, path.speed[::every], box.length, box.width, box.center_x)


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
