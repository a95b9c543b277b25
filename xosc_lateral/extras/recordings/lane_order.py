"""How pieces of lanes hang together, who is on them at one instant, and who drives ahead, behind and beside.

The one answer to who is next to whom in which lane, for imports, `reconstruct`, maneuver profiles and `detect`. What a
driver makes of those around, as their bodies come and go, is `world.surroundings.around`.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.road.lanes import DRIVING, beside
from xosc_lateral.world.road.network import RoadNetwork

INTO_NEXT = 1e-3  # step beyond a section's end that brings one into the next [m]


@dataclass(frozen=True, eq=False)
class LaneGraph:
    """Pieces of lanes and how they hang together."""

    length: FloatArray  # of each piece, along the road, shape (n,) [m]
    left: IntArray  # piece beside it on the left that is driven the same way; -1: none, shape (n,)
    following: Sequence[Sequence[int]]  # pieces that it leads to
    # facing: of two pieces beside each other, ways along the first and those along the second that face them [m];
    # without it they are of one length
    facing: Mapping[tuple[int, int], tuple[FloatArray, FloatArray]] = field(default_factory=dict)

    @cached_property
    def layout(self) -> tuple[IntArray, list[tuple[FloatArray, FloatArray]], IntArray]:
        """Part of the network, ways along each piece with their stations [m], and its rank, growing to the left.

        Breadth first from the first piece of each part. Where ways of different length meet, the first one counts;
        pieces that come to lie on one another there get parts of their own.
        """
        n = len(self.length)
        part, rank = np.full(n, -1), np.zeros(n, dtype=np.int64)
        lines = [(np.zeros(1), np.zeros(1))] * n
        # from each piece to those about it: piece, lanes to the left, +1 ahead or -1 behind
        steps: list[list[tuple[int, int, int]]] = [[] for _ in self.length]
        for piece, left in enumerate(self.left.tolist()):
            if left >= 0:
                steps[piece].append((left, 1, 0))
                steps[left].append((piece, -1, 0))
        for piece, after in enumerate(self.following):
            for other in after:
                steps[piece].append((other, 0, 1))
                steps[other].append((piece, 0, -1))

        def straight(piece: int, start: float) -> tuple[FloatArray, FloatArray]:
            return np.array([0.0, self.length[piece]]), np.array([start, start + self.length[piece]])

        taken: dict[tuple[int, int], list[tuple[float, float]]] = {}
        count = 0
        for first in range(n):
            if part[first] >= 0:
                continue
            waiting = deque([(first, straight(first, 0.0), 0)])
            while waiting:
                piece, line, level = waiting.popleft()
                (at, end), here = (float(line[1][k]) for k in (0, -1)), taken.setdefault((count, level), [])
                if part[piece] >= 0 or any(at < other - 1e-3 and end > begin + 1e-3 for begin, other in here):
                    continue
                part[piece], lines[piece], rank[piece] = count, line, level
                here.append((at, end))
                for other, side, where in steps[piece]:
                    start = {0: at, 1: end, -1: at - float(self.length[other])}[where]
                    faced = self.facing.get((other, piece)) if where == 0 else None
                    other_line = straight(other, start) if faced is None else (faced[0], follow(faced[1], line))
                    put = waiting.appendleft if where == 0 else waiting.append  # what lies beside, before what follows
                    put((other, other_line, level + side))
            count += 1
        return part, lines, rank

    def stations(self, piece: IntArray, along: FloatArray) -> tuple[IntArray, FloatArray, IntArray, FloatArray]:
        """Part, station [m], rank of places `along` pieces [m], and metres along a piece per metre of station."""
        part, lines, rank = self.layout
        station, scale = np.array(along, dtype=np.float64), np.ones(len(along))
        for number in np.unique(piece):
            mine = piece == number
            here = along[mine]
            station[mine] = follow(here, lines[number])
            ends = follow(here - SLOPE_LENGTH, lines[number]), follow(here + SLOPE_LENGTH, lines[number])
            scale[mine] = 2.0 * SLOPE_LENGTH / np.maximum(ends[1] - ends[0], SLOPE_LENGTH)
        return part[piece], station, rank[piece], scale


class At(NamedTuple):
    """Where a vehicle is at a moment."""

    road: int  # index into the network's
    lane: int
    way: int  # 1: as its lane is driven, -1: against it
    s: float  # of its reference point [m]
    ahead: float  # of that, its middle [m]
    length: float  # [m]

    @classmethod
    def of(cls, motion: EntityMotion, row: int, s: float | None = None) -> At:
        """In the lane of a row; `s`: a place along it other than the row's. [m]"""
        way, along = int(motion.way(slice(row, row + 1))[0]), float(motion.s[row]) if s is None else s
        return cls(int(motion.road[row]), int(motion.lane[row]), way, along, motion.box.center_x, motion.box.length)


class RoadLanes:
    """Driving lanes of a road network: a piece is one in one lane section."""

    def __init__(self, network: RoadNetwork) -> None:
        self.network = network
        places, ends, forward = list[tuple[int, int]](), list[tuple[float, float]](), list[bool]()
        for index, road in enumerate(network.roads):
            for section in road.sections:
                for lane in section.lanes:
                    if lane.type in DRIVING:
                        places.append((index, lane.id))
                        ends.append((section.start, section.end))
                        forward.append(network.travel_direction(index, lane.id) > 0)
        self._road, self._lane = np.array(places, dtype=np.int64).reshape(-1, 2).T
        (self._start, self._end), self._forward = np.array(ends).reshape(-1, 2).T, np.array(forward, dtype=np.bool_)
        self._most = int(np.abs(self._lane).max(initial=0)) + 1
        keys = self._keys(self._road, self._lane, 0.5 * (self._start + self._end))
        self._order = np.argsort(keys, kind="stable")
        self._sorted = keys[self._order]

    def _keys(self, road: NDArray[np.integer], lane: NDArray[np.integer], s: FloatArray) -> IntArray:
        lane = np.where(np.abs(lane) < self._most, lane, self._most)
        return np.asarray(self.network.section_numbers(road, s), dtype=np.int64) * (2 * self._most + 1) + lane

    def place(self, road: NDArray[np.integer], lane: NDArray[np.integer], s: FloatArray) -> tuple[IntArray, FloatArray]:
        """Piece of each place, -1: in none, and how far along it in its direction of travel [m]; shape (n,)."""
        if not len(self._sorted):
            return np.full(len(s), -1), np.zeros(len(s))
        keys = self._keys(road, lane, s)
        at = np.minimum(np.searchsorted(self._sorted, keys), len(self._sorted) - 1)
        piece = np.where(self._sorted[at] == keys, self._order[at], -1)
        return piece, np.where(self._forward[piece], s - self._start[piece], self._end[piece] - s)

    @cached_property
    def graph(self) -> LaneGraph:
        """How they hang together."""
        road, lane, way = self._road, self._lane, np.where(self._forward, 1, -1)
        middles = 0.5 * (self._start + self._end)
        others = np.array([beside(*pair) for pair in zip(lane.tolist(), way.tolist(), strict=True)], dtype=np.int64)
        left, _ = self.place(road, others, middles)
        same = [
            self.network.travel_direction(*pair) == mine
            for *pair, mine in zip(road.tolist(), others.tolist(), way.tolist(), strict=True)
        ]
        following = list[list[int]]()
        for number, forward in enumerate(self._forward.tolist()):
            end = self._end[number] - INTO_NEXT if forward else self._start[number] + INTO_NEXT
            step = self.network.advance(int(road[number]), int(lane[number]), float(end), 2 * INTO_NEXT)
            ahead, _ = self.place(*(np.array([each]) for each in (step.road, step.lane, step.s)))
            following.append([int(ahead[0])] if step.remaining <= 0.0 and ahead[0] not in (-1, number) else [])
        return LaneGraph(self._end - self._start, np.where(same, left, -1), following)

    def stations(
        self, road: NDArray[np.integer], lane: NDArray[np.integer], s: FloatArray, way: IntArray
    ) -> tuple[IntArray, IntArray, FloatArray]:
        """Places, shape (n,): line, of lanes that hang together and vehicles that drive there the same way, -1: in no
        driving lane; lane of it, growing to the left of their travel; station, growing as they drive [m].
        """
        piece, along = self.place(road, lane, s)
        part, station, rank, _ = self.graph.stations(np.maximum(piece, 0), along)
        return np.where(piece >= 0, 2 * part + (way < 0), -1), way * rank, way * station

    def nearest(self, vehicles: Sequence[At], number: int, lane: int | None = None) -> list[tuple[int, float] | None]:
        """Who is next ahead of one of the vehicles, and behind, of those that drive the same way, in its lane or
        another of its road: number and free space [m]; None: nobody."""
        every = [*vehicles, vehicles[number]._replace(lane=vehicles[number].lane if lane is None else lane)]
        road, lanes, way, s, ahead, length = map(np.array, zip(*every, strict=True))
        line, rank, station = self.stations(road, lanes, s, way)
        group, middle = in_groups(line, rank - rank.min()), station + ahead
        others = np.delete(np.arange(len(vehicles)), number)
        order = Order(group[others], middle[others])
        next_to = list[tuple[int, float] | None]()
        for is_ahead in (True, False):
            (row,) = order.next_to(group[-1:], middle[-1:], is_ahead=is_ahead).tolist()
            if row < 0:
                next_to.append(None)
                continue
            k = int(others[row])
            free = max(abs(float(middle[k] - middle[-1])) - 0.5 * float(length[k] + length[-1]), 0.0)
            next_to.append((k, free))
        return next_to


MOST_LANES = 64  # beside one another [-]


def in_groups(frame: IntArray, lane: IntArray) -> IntArray:
    """Number of the lane at the instant and on the part of the road of a frame; -1: in none. Shape (n,)."""
    return np.where(frame >= 0, frame * MOST_LANES + lane, -1)


NEIGHBOUR_DISTANCE = 200.0  # [m]; who is farther away is none, as in `surroundings.around`
MAXIMUM_LENGTH = 30.0  # [m]; no vehicle is longer (German road traffic regulations: 25.25 m)


class Order:
    """Vehicles in order along the lanes that they are in: rows by group and place, shape (n,). [m]"""

    def __init__(self, group: IntArray, place: FloatArray) -> None:
        self._group, self._rows = group, np.lexsort((place, group))
        # One sorted axis for all groups: each gets its own, far apart from the next.
        self._span = float(np.ptp(place)) + 4.0 * (NEIGHBOUR_DISTANCE + MAXIMUM_LENGTH) if len(place) else 1.0
        self._base = float(place.min()) if len(place) else 0.0
        self._axis = self._on_axis(group[self._rows], place[self._rows])

    def _on_axis(self, group: IntArray, place: FloatArray) -> FloatArray:
        return group * self._span + (place - self._base)

    def next_to(self, group: IntArray, place: FloatArray, *, is_ahead: bool) -> IntArray:
        """Row of the first one ahead of each place in a group, or of the last one that is not; -1: nobody."""
        if not len(self._rows):
            return np.full(len(group), -1)
        at = np.searchsorted(self._axis, self._on_axis(group, place), side="right") - (0 if is_ahead else 1)
        inside = (at >= 0) & (at < len(self._rows))
        other = self._rows[np.clip(at, 0, len(self._rows) - 1)]
        return np.where(inside & (self._group[other] == group) & (group >= 0), other, -1)


SLOPE_LENGTH = 10.0  # to each side: over which metres of a lane are compared with those of its neighbour [m]


def follow(values: FloatArray, line: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Values through a line of (from, to), which goes on beyond its ends with slope 1. Shape as `values`."""
    low, high = line[0][0], line[0][-1]
    beyond = np.minimum(values - low, 0.0) + np.maximum(values - high, 0.0)
    return np.asarray(np.interp(values, *line) + beyond)


ENCOUNTER_DISTANCE = 150.0  # who is farther away has nothing to do with it: 5 s at 30 m/s [m]


class Following(NamedTuple):
    """Two vehicles one behind the other in a lane; NaN: there is none within sight."""

    gap: float  # free space between them [m]
    closing: float  # how fast that gets less [m/s]
    speed: float  # of the one behind [m/s]

    @property
    def headway(self) -> float:
        """Of the one behind. [s]"""
        return self.gap / self.speed if self.speed > 0.0 else np.inf

    @property
    def time_to_collision(self) -> float:
        """With both speeds kept; infinite: they don't close. [s]"""
        return self.gap / self.closing if self.closing > 0.0 else np.inf


NO_FOLLOWING = Following(np.nan, np.nan, np.nan)


def vehicle_next(
    vehicle: EntityMotion, row: int, vehicles: Sequence[EntityMotion], lanes: RoadLanes, *, ahead: bool = True
) -> Following:
    """A vehicle and the one ahead of it in its lane, or the one behind."""
    time = float(vehicle.time[row])
    rows = [(one, int(np.searchsorted(one.time, time - 1e-9))) for one in vehicles]
    there = [(one, k) for one, k in rows if k < len(one.time) and one.time[0] <= time + 1e-9 and one.road[k] >= 0]
    number = next((k for k, (one, _) in enumerate(there) if one is vehicle), None)
    if number is None:
        return NO_FOLLOWING
    near = lanes.nearest([At.of(one, k) for one, k in there], number)[0 if ahead else 1]
    if near is None or near[1] >= ENCOUNTER_DISTANCE:
        return NO_FOLLOWING
    other, other_row = there[near[0]]
    behind, before = float(vehicle.speed[row]), float(other.speed[other_row])
    behind, before = (behind, before) if ahead else (before, behind)
    return Following(near[1], behind - before, behind)
