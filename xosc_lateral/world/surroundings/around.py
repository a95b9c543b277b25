"""Where other vehicles are, seen along the lane that one drives on, and what of them counts as being there.

Others belong to a lane as far as their bodies lie in it, seen from where the vehicle itself is, so that they come and
go as a lane change does, anybody's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.segment import FADES
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.entity import BoundingBox

SIGHT_DISTANCE = 200.0
"""How far a driver looks for others [m]; beyond it there is none (about what a series radar sees)."""

IN_SIGHT = 2.0 * SIGHT_DISTANCE + 100.0
"""Vehicles never nearer than this in a straight line are not searched along the lane. Free space is counted along the
reference line, which on the tightest ramp is half as long as its outer lane; the rest is for two road trains. [m]"""

ALONGSIDE_DISTANCE = 10.0
"""A vehicle in the next lane counts half as alongside at this free space lengthwise, wholly at half of it. [m]"""

INFLUENCE_DISTANCE = 40.0
"""Free space over which the influence of others fades to 37 %, as in `fitting.context_effects`: with so much more free
space for each factor e that less of a body lies in the lane, its influence is the product of both. [m]"""


class LaneStretch(NamedTuple):
    """A lane section within reach along the own lane: u(s) = at + sign * (s - s_entry) counts along travel. [m]"""

    road: int
    s_low: float
    s_high: float
    lane: int
    at: float
    s_entry: float
    sign: int


def lane_path(network: RoadNetwork, road: int, lane: int, s: float, forward: int) -> list[LaneStretch]:
    """Sections along a lane within `SIGHT_DISTANCE` both ways; their coordinate u is 0 at `s`, growing along travel."""
    low, high = network.section_at(road, s)
    path = [LaneStretch(road, low, high, lane, 0.0, s, forward)]
    for way in (1, -1):
        here, direction, done = (road, lane, s), way * forward, 0.0
        while done < SIGHT_DISTANCE + (high - low):
            section = network.section_at(here[0], here[2])
            left = (section[1] - here[2]) if direction > 0 else (here[2] - section[0])
            step = network.advance(*here, left + _INTO_NEXT, direction=direction)
            if step.remaining > 0.0:
                break
            done += left
            here, direction = (step.road, step.lane, step.s), step.direction
            start, end = network.section_at(step.road, step.s)
            s_entry = step.s - direction * _INTO_NEXT
            path.append(LaneStretch(step.road, start, end, step.lane, way * done, s_entry, way * direction))
    return path


_INTO_NEXT = 1e-6
"""Step beyond a section's end that brings one into the next. [m]"""


class OtherVehicles(NamedTuple):
    """Where another vehicle is, seen along the own lane: u ahead [m], from the own path to the left [m], which way."""

    ahead: FloatArray
    left: FloatArray
    oncoming: BoolArray


ZONES = {"lead": 0.0, "left": 1.0, "right": -1.0}
"""Middle of the lane on each side, from the own path to the left. [own lane widths]"""


def see_along(
    path: Sequence[LaneStretch],
    own_u: FloatArray,
    own_offset: FloatArray,
    road: NDArray[np.integer],
    s: FloatArray,
    t: FloatArray,
    direction: NDArray[np.integer],
    centre_t: Callable[[int, int, FloatArray], FloatArray],
    whom: IntArray | slice = slice(None),
) -> OtherVehicles:
    """Where others are along one's lane path, row by row: other moments, or other vehicles. Shape (n,) each.

    From where one is on the path (`lane_path`) and from its lane's centre, positive left [m]; where the other is, road,
    s and t [m], and which way it drives along s, +1 or -1, 0 on no lane; and t of a lane's centre, by road, lane and s.
    `whom`: index of the row's other, shape (n,), where others are looked at from several places. Others elsewhere are
    not seen (NaN).
    """
    n = len(own_u)
    seen = OtherVehicles(np.full(n, np.nan), np.full(n, np.nan), np.zeros(n, dtype=bool))
    for part in path:
        on = (direction != 0) & (road == part.road) & (s >= part.s_low - 1e-9) & (s <= part.s_high + 1e-9)
        if not on.any():
            continue
        u, left = np.full((2, len(s)), np.nan)
        u[on] = part.at + part.sign * (s[on] - part.s_entry)
        left[on] = part.sign * (t[on] - centre_t(part.road, part.lane, s[on]))
        ahead = u[whom] - own_u
        # the own lane path may pass a place twice (a ring road): the nearer view counts
        k = np.flatnonzero(on[whom] & ~(np.abs(seen.ahead) <= np.abs(ahead)))
        seen.ahead[k], seen.left[k] = ahead[k], left[whom][k] - own_offset[k]
        seen.oncoming[k] = direction[whom][k] != part.sign
    return seen


class Extent(NamedTuple):
    """How long vehicles are, and how far their middles are ahead of their reference points, shape (n,) each. [m]"""

    length: FloatArray
    center_x: FloatArray


def free_space(seen: OtherVehicles, box: BoundingBox | Extent, other: BoundingBox | Extent) -> FloatArray:
    """Bumper to bumper, 0 while overlapping lengthwise. [m]"""
    turned = np.where(seen.oncoming, -1.0, 1.0)
    between_centres = seen.ahead + turned * other.center_x - box.center_x
    return np.maximum(np.abs(between_centres) - 0.5 * (box.length + other.length), 0.0)


@dataclass(eq=False, slots=True)
class NearestVehicles:
    """Who is around: on each side of `ZONES`; free space to who comes towards one [m], how far he is there [-]."""

    sides: Mapping[str, _Side]
    oncoming: FloatArray
    oncoming_there: FloatArray

    @classmethod
    def with_no_one(cls, n: int) -> NearestVehicles:
        """Nobody around anybody."""
        return cls({side: _Side.with_no_one(n) for side in ZONES}, np.full(n, np.nan), np.zeros(n))

    def add(
        self,
        rows: IntArray,
        seen: OtherVehicles,
        gap: FloatArray,
        width: FloatArray,
        other_width: float | FloatArray,
        is_truck: BoolArray,
    ) -> None:
        """Others, seen from the rows, which may come again; free space to them, own lane and their bodies wide. [m]"""
        with np.errstate(invalid="ignore"):
            there = (gap <= SIGHT_DISTANCE) & ~np.isnan(seen.left)
            # he comes into sight in the last quarter of it, and is gone within `INFLUENCE_DISTANCE` once he has passed
            share = 1.0 - smooth_step(
                np.where(seen.ahead > 0, 4.0 * gap / SIGHT_DISTANCE - 3.0, gap / INFLUENCE_DISTANCE)
            )
            k = np.flatnonzero(there & seen.oncoming & (share > 0))
            there &= ~seen.oncoming
        np.fmin.at(self.oncoming, rows[k], gap[k] - INFLUENCE_DISTANCE * np.log(share[k]))
        np.maximum.at(self.oncoming_there, rows[k], share[k])
        for side, middle in ZONES.items():
            # of a body, that lies in the lane, of what fits in
            body, centre = other_width / width, seen.left / width - middle
            inside = np.minimum(centre + 0.5 * body, 0.5) - np.maximum(centre - 0.5 * body, -0.5)
            share = np.clip(inside / np.minimum(body, 1.0), 0.0, 1.0)
            share = np.where(there & ((side != "lead") | (seen.ahead > 0)), share, 0.0)
            k = np.flatnonzero(share)
            if len(k):
                self.sides[side].add(rows[k], gap[k], share[k], is_truck[k])

    def columns(self, lanes: Mapping[str, FloatArray], *, always_fade: bool = False) -> dict[str, FloatArray]:
        """Context columns, shape (n,) each; `lanes`: how far there is one on each side. [-]"""
        columns = {"oncoming_distance": self.oncoming}
        if always_fade or (self.oncoming_there.max(initial=0.0) > 0.0 and self.oncoming_there.min(initial=1.0) < 1.0):
            columns[f"oncoming_distance{FADES}"] = self.oncoming_there
        for side, others in self.sides.items():
            columns |= {f"{side}_is_truck": others.is_truck}
            lane = np.maximum(lanes[side], np.minimum(others.influence, 1.0))
            columns[f"{side}_distance"] = np.where((lane > 0) & np.isnan(others.distance), np.inf, others.distance)
            if always_fade or (lane.max(initial=0.0) > 0.0 and lane.min(initial=1.0) < 1.0):
                columns[f"{side}_distance{FADES}"] = lane
            if side != "lead":  # the same as measured drives often have it: a flag for what drives beside
                columns |= {f"truck_{side}": others.truck_alongside, f"car_{side}": others.car_alongside}
        return columns


@dataclass(eq=False, slots=True)
class _Side:
    """What is on one side, shape (n,) each: distance [m]; influence of all and of trucks, kinds alongside. [-]"""

    distance: FloatArray
    influence: FloatArray
    of_trucks: FloatArray
    truck_alongside: FloatArray
    car_alongside: FloatArray

    @classmethod
    def with_no_one(cls, n: int) -> _Side:
        return cls(np.full(n, np.nan), *np.zeros((4, n)))

    def add(self, rows: IntArray, gap: FloatArray, share: FloatArray, is_truck: BoolArray) -> None:
        """More vehicles, each seen from a row, with free space `gap` [m], of which so much lies in the lane [-]."""
        np.fmin.at(self.distance, rows, gap - INFLUENCE_DISTANCE * np.log(share))
        influence = share * np.exp(-gap / INFLUENCE_DISTANCE)
        np.add.at(self.influence, rows, influence)
        alongside = share * (1.0 - smooth_step(gap / ALONGSIDE_DISTANCE - 0.5))
        # a truck comes into sight in the last quarter of the reach
        np.add.at(self.of_trucks, rows, is_truck * influence * (1.0 - smooth_step(4.0 * gap / SIGHT_DISTANCE - 3.0)))
        np.maximum.at(self.truck_alongside, rows, is_truck * alongside)
        np.maximum.at(self.car_alongside, rows, ~is_truck * alongside)

    @property
    def is_truck(self) -> FloatArray:
        """How far who is there is a truck, others weighed by their influence."""
        return self.of_trucks / np.where(self.influence > 0, self.influence, 1.0)


def smooth_step(u: FloatArray) -> FloatArray:
    """0 at 0 and below, 1 at 1 and above, smooth between."""
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(u**2 * (3.0 - 2.0 * u))


# ---- which vehicles come near each other at all: the index that spares looking at every pair of them ----
BLOCK_ROWS = 64
"""Rows that one box around a vehicle's path covers: 1.3 s at 50 Hz, 40 m on a motorway. [-]"""


def stretches_within(
    x: Iterable[FloatArray], y: Iterable[FloatArray], reach: float, blocks: int = 16
) -> Iterator[tuple[slice, list[tuple[int, int]]]]:
    """Pairs of points that may come within `reach` of each other, stretch by stretch; none that do is missing.

    The boxes around both paths, in blocks of rows, are swept along the longer side of the traffic: the work grows with
    the pairs that are near, not with all there are.

    `x`, `y`: arrays of shape (n,) for each point on one time grid, NaN where it is absent, looked at once; `reach` in
    [m]; a stretch has `blocks` of `BLOCK_ROWS`. Yields its rows, and pairs of indices in lexical order, each ascending.
    """
    lows, highs = _bounds(x, y)
    for begin in range(0, lows.shape[1], blocks):
        low, high = lows[:, begin : begin + blocks], highs[:, begin : begin + blocks]
        block, there = np.nonzero(np.isfinite(low).all(axis=0))
        if len(there) > 1:
            first, second = _overlapping(low[:, block, there], high[:, block, there], there, reach, block)
            if len(first):
                pairs = set(zip(first.tolist(), second.tolist(), strict=True))
                yield slice(BLOCK_ROWS * begin, BLOCK_ROWS * (begin + blocks)), sorted(pairs)


def pairs_now(x: FloatArray, y: FloatArray, reach: float) -> tuple[IntArray, IntArray]:
    """Pairs of points within `reach` along both axes, the smaller index first, shape (pairs,) each. [m]"""
    there = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    points = np.stack([x[there], y[there]])
    return _overlapping(points, points, there, reach) if len(there) else (there, there)


def _bounds(x: Iterable[FloatArray], y: Iterable[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest x, y of each point in each block, shape (2, blocks, points), NaN where it is absent. [m]"""
    lows, highs = [np.empty((2, 0))], [np.empty((2, 0))]
    for point in zip(x, y, strict=True):
        starts = np.arange(0, len(point[0]), BLOCK_ROWS)
        for extremes, ufunc in ((lows, np.fmin), (highs, np.fmax)):  # they pass over NaN
            extremes.append(np.stack([ufunc.reduceat(values, starts) for values in point]))
    low, high = (np.stack(extremes[1:] or extremes, axis=-1) for extremes in (lows, highs))
    return low, high


def _overlapping(
    low: FloatArray, high: FloatArray, names: IntArray, reach: float, block: IntArray | None = None
) -> tuple[IntArray, IntArray]:
    """Pairs of boxes that are within reach of each other, the smaller name first, shape (pairs,) each.

    Boxes of other blocks are none: they lie far away on the axis that is swept, shape (n,).
    """
    axis = int(np.argmax(high.max(axis=1) - low.min(axis=1)))
    begin, end = low[axis], high[axis] + reach
    if block is not None:
        apart = block * (float(end.max()) - float(begin.min()) + 1.0)
        begin, end = begin + apart, end + apart
    order = np.argsort(begin, kind="stable")
    ends = np.searchsorted(begin[order], end[order], side="right")
    counts = np.maximum(ends - np.arange(len(order)) - 1, 0)
    first = np.repeat(np.arange(len(order)), counts)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
    left, right = order[first], order[second]
    other = 1 - axis
    near = (low[other, right] <= high[other, left] + reach) & (low[other, left] <= high[other, right] + reach)
    left, right = names[left[near]], names[right[near]]
    return np.minimum(left, right), np.maximum(left, right)
