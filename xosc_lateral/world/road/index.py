"""World to lane: which roads are near a point, and which of their lanes it is in.

References
----------
.. [1] J. L. Bentley, J. H. Friedman, "Data structures for range searching", ACM Computing Surveys 11, 1979: cells.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from xosc_lateral.base.arrays import FloatArray, Int32Array
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.base.lazy import spatial
from xosc_lateral.world.road.lane_tables import CHUNK_SIZE
from xosc_lateral.world.road.lanes import DRIVING, Lane, LaneSection
from xosc_lateral.world.road.positions import LanePositions
from xosc_lateral.world.road.road import CONVERGED_STEP, MAX_STEP, MOST_ITERATIONS, Road
from xosc_lateral.world.road.tables import NetworkTables

# ---- samples laid over all lanes, in a grid: which pieces of road are near a point ----
SAMPLE_SPACING = 8.0
"""Distance of the samples laid over the lanes. [m]"""

SAMPLE_REACH = 0.5 * float(np.hypot(SAMPLE_SPACING, SAMPLE_SPACING)) + 1.0
"""No place on a lane is further from its nearest sample (1 m for what curves bulge between samples). [m]"""

CELL_SIZE = 2.0 * SAMPLE_SPACING
"""Size of the grid's cells; a point looks for samples in its own cell and the eight around it. [m]"""

BRUTE_FORCE = 4_000_000
"""Up to so many pairs of points and samples, plain distances beat building a tree."""


class Candidates(NamedTuple):
    """Roads that a point may lie on: index of the point, road, guess of s."""

    point: NDArray[np.int64]
    road: Int32Array
    s: FloatArray


class Samples:
    """Samples of all lanes of some types (None: all but lane 0), in a grid."""

    def __init__(self, tables: NetworkTables, lane_types: Collection[str] | None) -> None:
        """Lay samples over the lanes, and list for each cell those in it and around it."""
        parts = []  # road, s, x, y
        for i, road in enumerate(tables.roads):
            for section in road.sections:
                lanes = [lane for lane in section.lanes if lane_types is None or lane.type in lane_types]
                if lanes and section.end > section.start:
                    s, t = _grid(tables, i, section, lanes)
                    poses = tables.road_to_world(i, s, t)
                    parts.append((i, s.ravel(), poses.x.ravel(), poses.y.ravel()))
        if not parts:
            raise PlaybackError(f"no road has a lane of these types: {', '.join(sorted(lane_types or ('any',)))}")
        self.road = np.concatenate([np.full(len(s), road, dtype=np.int32) for road, s, _, _ in parts])
        self.s, self.x, self.y = (np.concatenate([part[k] for part in parts]) for k in (1, 2, 3))
        # The pieces of a road that pass a cell apart from each other (a loop, a hairpin) are separate candidates.
        self.piece = np.concatenate(
            [np.full(len(part[1]), k, dtype=np.int64) for k, part in enumerate(parts)]
        ) * 1_000_000 + (self.s // (4.0 * CELL_SIZE)).astype(np.int64)
        self._x0, self._y0 = float(self.x.min()) - CELL_SIZE, float(self.y.min()) - CELL_SIZE
        column, line = self._cell(self.x, self.y)
        self._lines = int(line.max()) + 2
        around = [(across, along) for across in (-1, 0, 1) for along in (-1, 0, 1)]
        key = np.concatenate([(column + across) * self._lines + line + along for across, along in around])
        sample = np.tile(np.arange(len(self.x)), len(around))
        order = np.lexsort((self.piece[sample], key))
        self._sample = sample[order]
        self._cells, first = np.unique(key[order], return_index=True)
        self._first = np.append(first, len(order))

    def _cell(self, x: FloatArray, y: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        return ((x - self._x0) // CELL_SIZE).astype(np.int64), ((y - self._y0) // CELL_SIZE).astype(np.int64)

    def near_pieces(self, x: FloatArray, y: FloatArray) -> Candidates:
        """Every piece of road that may be the nearest one, once per point, at least one; `x`, `y` of shape (n,). [m]"""
        limit = 1e9  # keeps the cell numbers of absurdly distant points within integers
        column, line = self._cell(np.clip(x, -limit, limit), np.clip(y, -limit, limit))
        inside = (line >= 0) & (line < self._lines)
        key = np.where(inside, column * self._lines + line, -1)
        cell = np.minimum(np.searchsorted(self._cells, key), len(self._cells) - 1)
        matches = self._cells[cell] == key
        hits = self._in_cells(np.flatnonzero(matches), cell[matches], x, y)
        if matches.all():
            return hits
        far = self._nearest(np.flatnonzero(~matches), x, y)
        point, road = np.concatenate([hits.point, far.point]), np.concatenate([hits.road, far.road])
        return Candidates(point, road, np.concatenate([hits.s, far.s]))

    def _in_cells(
        self, points: NDArray[np.int64], cells: NDArray[np.int64], x: FloatArray, y: FloatArray
    ) -> Candidates:
        first = self._first[cells]
        count = self._first[cells + 1] - first
        start = np.cumsum(count) - count
        sample = self._sample[np.arange(int(count.sum())) + np.repeat(first - start, count)]
        return self._closest_per_piece(np.repeat(points, count), sample, x, y)

    def _nearest(self, points: NDArray[np.int64], x: FloatArray, y: FloatArray) -> Candidates:
        """Far from any lane: the nearest 16 samples by brute force for a few points, by a tree for many."""
        k = min(16, len(self.x))
        if len(points) * len(self.x) <= BRUTE_FORCE:
            squared = (x[points, None] - self.x) ** 2 + (y[points, None] - self.y) ** 2
            sample = np.argpartition(squared, k - 1, axis=1)[:, :k]
        else:
            tree = spatial.cKDTree(np.stack([self.x, self.y], axis=1))
            sample = tree.query(np.stack([x[points], y[points]], axis=1), k=k)[1].reshape(len(points), k)
        order = np.argsort(self.piece[sample], axis=1)
        sample = np.take_along_axis(sample, order, axis=1)
        return self._closest_per_piece(np.repeat(points, k), sample.ravel(), x, y)

    def _closest_per_piece(
        self, point: NDArray[np.int64], sample: NDArray[np.int64], x: FloatArray, y: FloatArray
    ) -> Candidates:
        """Of (point, sample) pairs sorted by point and piece: the closest of each piece, unless out of reach."""
        if not len(point):
            return Candidates(point, self.road[:0], self.s[:0])
        distance = np.hypot(x[point] - self.x[sample], y[point] - self.y[sample])
        piece = self.piece[sample]
        new_point = np.append(True, point[1:] != point[:-1])
        new = new_point | np.append(True, piece[1:] != piece[:-1])
        begin = np.flatnonzero(new)
        group = np.cumsum(new) - 1
        smallest = np.minimum.reduceat(distance, begin)
        at_minimum = np.flatnonzero(distance == smallest[group])
        chosen = at_minimum[np.append(True, np.diff(group[at_minimum]) > 0)]
        nearest = np.minimum.reduceat(distance, np.flatnonzero(new_point))
        point_number = np.cumsum(new_point) - 1
        keep = chosen[distance[chosen] <= nearest[point_number[chosen]] + SAMPLE_REACH]
        return Candidates(point[keep], self.road[sample[keep]], self.s[sample[keep]])


def _grid(
    tables: NetworkTables, index: int, section: LaneSection, lanes: Sequence[Lane]
) -> tuple[FloatArray, FloatArray]:
    """s and t over the lanes of a section, shape (m, n) each. [m]"""
    n = int(np.ceil((section.end - section.start) / SAMPLE_SPACING)) + 1
    s = np.linspace(section.start, section.end, n)
    inside = np.minimum(s, np.nextafter(section.end, -np.inf))
    left = tables.lane_profile(index, lanes[0].id, inside)
    right = tables.lane_profile(index, lanes[-1].id, inside)
    top, bottom = left.centre + 0.5 * left.width, right.centre - 0.5 * right.width
    m = int(np.ceil(max(float((top - bottom).max()), 0.0) / SAMPLE_SPACING)) + 1
    t = bottom + (top - bottom) * (np.linspace(0.0, 1.0, m)[:, None] if m > 1 else 0.5)
    t = np.broadcast_to(t, (m, n))
    return np.broadcast_to(s, (m, n)), t


# ---- which of their lanes it is in ----
WRONG_WAY_DISTANCE = 2.0
"""A lane driven the opposite way counts as this much further off when the heading is known. [m]"""

SAME_LEVEL_HEIGHT = 1.0
"""Height differences below this mean nothing when z is known. [m]"""

LANE_TOLERANCE = 1e-6
"""A point no further off than this is on the lane that it was expected on. [m]"""


class _Feet(NamedTuple):
    """Feet of perpendiculars: s, t in the leaning surface, heading, and how far a point is ahead, beyond an end. [m]"""

    s: FloatArray
    t: FloatArray
    ahead: FloatArray
    heading: FloatArray


class SurfaceIndex(NetworkTables):
    """World to lane over a whole network."""

    def __init__(self, roads: Sequence[Road], path: str) -> None:
        """Samples are laid when they are first asked for, once per choice of lane types."""
        super().__init__(roads, path)
        self._samples: dict[frozenset[str] | None, Samples] = {}
        self._wanted: dict[frozenset[str] | None, NDArray[np.bool_]] = {}

    def world_to_lane(
        self,
        x: ArrayLike,
        y: ArrayLike,
        z: ArrayLike | None = None,
        heading: ArrayLike | None = None,
        *,
        lane_types: Collection[str] | None = DRIVING,
    ) -> LanePositions:
        """Nearest lane of the given types (None: any) under each point.

        `z` distinguishes roads on top of each other; `heading` prefers lanes driven that way. Everything is found,
        however far off: look at `distance`.
        """
        inputs = [x, y, *(a for a in (z, heading) if a is not None)]
        arrays = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in inputs))
        flat = [a.ravel() for a in arrays]
        refuse_nan(flat)
        height = flat[2] if z is not None else None
        direction = flat[-1] if heading is not None else None
        types = None if lane_types is None else frozenset(lane_types)
        best = _Best(len(flat[0]))
        for begin in range(0, len(flat[0]), 16384):
            part = slice(begin, begin + 16384)
            candidates = self._candidates(flat[0][part], flat[1][part], types)
            candidates = candidates._replace(point=candidates.point + begin)
            self._score(best, candidates, flat[0], flat[1], height, direction, types)
        return best.positions(arrays[0].shape)

    def _candidates(self, x: FloatArray, y: FloatArray, types: frozenset[str] | None) -> Candidates:
        if types not in self._samples:
            self._samples[types] = Samples(self, types)
        return self._samples[types].near_pieces(x, y)

    def path_to_lane(
        self, x: ArrayLike, y: ArrayLike, road: ArrayLike, s: ArrayLike, *, lane_types: Collection[str] | None = DRIVING
    ) -> LanePositions:
        """Like `world_to_lane`, on known roads and from a guess of `s` per point (a written path, say): cheap."""
        arrays = np.broadcast_arrays(*(np.asarray(a, dtype=np.float64) for a in (x, y, s)), np.asarray(road, np.int32))
        flat = [a.ravel() for a in arrays]
        refuse_nan(flat[:3])
        types = None if lane_types is None else frozenset(lane_types)
        best = _Best(len(flat[0]))
        roads = flat[3].astype(np.int32)
        known = np.flatnonzero(roads >= 0)
        self._score(best, Candidates(known, roads[known], flat[2][known]), flat[0], flat[1], None, None, types)
        # Driven off the road that it was on, onto the next one: look again, without prejudice.
        lost = np.flatnonzero(best.distance > LANE_TOLERANCE)
        if len(lost):
            candidates = self._candidates(flat[0][lost], flat[1][lost], types)
            self._score(best, candidates._replace(point=lost[candidates.point]), flat[0], flat[1], None, None, types)
        return best.positions(arrays[0].shape)

    # ---- choosing ----------------------------------------------------------------------------------------------------
    def _score(
        self,
        best: _Best,
        candidates: Candidates,
        x: FloatArray,
        y: FloatArray,
        z: FloatArray | None,
        heading: FloatArray | None,
        types: frozenset[str] | None,
    ) -> None:
        """Project each point onto its candidate road, find the lane there, keep what beats the best so far."""
        point, road, guess = candidates
        feet = self._project(road, x[point], y[point], guess)
        row, centre, width = self._lanes_under(road, feet, types)
        away = np.abs(feet.t - centre)
        outside = np.hypot(np.maximum(away - 0.5 * width, 0.0), feet.ahead)
        outside[row < 0] = np.inf
        direction = self._lane_directions[row]
        score = outside
        if z is not None:
            above = np.abs(z[point] - self._height(road, feet.s, feet.t))
            score = score + np.maximum(above - SAME_LEVEL_HEIGHT, 0.0)
        if heading is not None:
            lane_heading = feet.heading + np.where(direction < 0, np.pi, 0.0)
            score = score + 0.5 * WRONG_WAY_DISTANCE * (1.0 - np.cos(heading[point] - lane_heading))
        lane = np.where(row < 0, 0, self._lane_ids[row])
        offset = direction * (feet.t - centre)
        best.offer(point, score, away, LanePositions(road, lane, feet.s, offset, feet.t, outside))

    def _lanes_under(
        self, road: Int32Array, feet: _Feet, types: frozenset[str] | None
    ) -> tuple[Int32Array, FloatArray, FloatArray]:
        """Row, centre and width of the lane of these types that holds t, else of the nearest; row -1: there is none."""
        if types not in self._wanted:
            self._wanted[types] = np.array(
                [lane.id != 0 and (types is None or lane.type in types) for lane in self._lanes]
            )
        wanted = self._wanted[types]
        section = np.broadcast_to(np.asarray(self.section_numbers(road, feet.s)), feet.s.shape)
        first = self._section_first[section]
        count = self._section_first[section + 1] - first - 1
        row = np.full(len(feet.s), -1, dtype=np.int32)
        centre, width = np.zeros(len(feet.s)), np.zeros(len(feet.s))
        lowest, closest = np.full(len(feet.s), np.inf), np.full(len(feet.s), np.inf)
        for rank in range(int(count.max(initial=0))):
            here = np.flatnonzero(rank < count)
            here = here[wanted[first[here] + rank]]
            profile = self._profile_of(first[here] + rank, feet.s[here])
            away = np.abs(feet.t[here] - profile.centre)
            # lanes of no width only where there is nothing else, as in `road.lane_at`
            score = np.maximum(away - 0.5 * profile.width, 0.0) + np.where(profile.width <= 1e-6, 1e3, 0.0)
            better = (score < lowest[here]) | ((score == lowest[here]) & (away < closest[here]))
            to = here[better]
            row[to] = first[to] + rank
            centre[to], width[to] = profile.centre[better], profile.width[better]
            lowest[to], closest[to] = score[better], away[better]
        return row, centre, width

    def _project(self, road: Int32Array, x: FloatArray, y: FloatArray, guess: FloatArray) -> _Feet:
        """Feet on the given roads, from guesses of s; arrays of one length. Shape (n,). [m]"""
        parts = [
            self._project_chunk(road[part], x[part], y[part], guess[part])
            for part in (slice(begin, begin + CHUNK_SIZE) for begin in range(0, len(x), CHUNK_SIZE))
        ]
        if not parts:
            return _Feet(*(np.empty(0) for _ in _Feet._fields))
        return _Feet(*(np.concatenate(field) for field in zip(*parts, strict=True)))

    def _project_chunk(self, road: Int32Array, x: FloatArray, y: FloatArray, guess: FloatArray) -> _Feet:
        length = self._lengths[road]
        s = np.minimum(np.maximum(guess, 0.0), length)
        low, high = np.full(len(x), -1.0), length + 1.0  # beyond the ends: nothing is known yet
        active = np.arange(len(x))
        for _ in range(MOST_ITERATIONS):
            at = s[active]
            frame = self._lines.at(road[active], at, derivatives=True)
            dx, dy = x[active] - frame.x, y[active] - frame.y
            ahead = dx * frame.cos + dy * frame.sin
            across = dy * frame.cos - dx * frame.sin
            lead = self._lead(road[active], at, across)
            ahead = ahead if lead is None else ahead - lead
            # The foot lies where `ahead` is 0; its derivative is -(1 - k t) |dC/ds|, held off 0 near the evolute.
            lo, hi = np.where(ahead >= 0.0, at, low[active]), np.where(ahead <= 0.0, at, high[active])
            rate = np.maximum(1.0 - frame.curvature * across, 0.2) * np.maximum(frame.speed, 1e-3)
            step = np.clip(ahead / rate, -MAX_STEP, MAX_STEP)
            moved = at + step
            outside = ((moved <= lo) | (moved >= hi)) & (np.abs(step) > CONVERGED_STEP)
            moved = np.where(outside, 0.5 * (lo + hi), moved)
            moved = np.minimum(np.maximum(moved, 0.0), length[active])
            s[active], low[active], high[active] = moved, lo, hi
            active = active[np.abs(moved - at) > CONVERGED_STEP]
            if not len(active):
                break
        frame = self._lines.at(road, s)
        dx, dy = x - frame.x, y - frame.y
        t = (dy * frame.cos - dx * frame.sin) / self._shrink(road, s)
        ahead = dx * frame.cos + dy * frame.sin
        lead = self._lead(road, s, dy * frame.cos - dx * frame.sin)
        ahead = ahead if lead is None else ahead - lead
        return _Feet(s, t, np.where(np.abs(ahead) < 1e-9, 0.0, ahead), frame.heading)


class _Best:
    """The best candidate so far for each of n points."""

    def __init__(self, n: int) -> None:
        self._score, self._away = np.full(n, np.inf), np.full(n, np.inf)
        whole = np.full(n, -1, dtype=np.int32), np.zeros(n, dtype=np.int32)
        self._found = LanePositions(*whole, np.zeros(n), np.zeros(n), np.zeros(n), np.full(n, np.inf))
        self.distance = self._found.distance

    def offer(self, point: NDArray[np.int64], score: FloatArray, away: FloatArray, located: LanePositions) -> None:
        """Take what has a smaller score; of equals (lanes on top of each other) the one whose centre is nearer."""
        score = np.round(score, 9)  # rounding noise must not decide between roads that touch
        order = np.lexsort((located.road, np.round(away, 9), score, point))
        order = order[np.append(True, np.diff(point[order]) > 0)] if len(order) else order
        target = point[order]
        better = (score[order] < self._score[target]) | (
            (score[order] == self._score[target]) & (away[order] < self._away[target])
        )
        order, target = order[better], target[better]
        self._score[target], self._away[target] = score[order], away[order]
        kept: tuple[NDArray[Any], ...] = self._found
        offered: tuple[NDArray[Any], ...] = located
        for whole, part in zip(kept, offered, strict=True):
            whole[target] = part[order]

    def positions(self, shape: tuple[int, ...]) -> LanePositions:
        """The result, in the shape of the question."""
        road, lane, *others = self._found
        return LanePositions(road.reshape(shape), lane.reshape(shape), *(values.reshape(shape) for values in others))


def refuse_nan(arrays: list[FloatArray]) -> list[FloatArray]:
    """Coordinates of points, if all are some."""
    for array in arrays:
        if not np.isfinite(array).all():
            i = int(np.flatnonzero(~np.isfinite(array))[0])
            raise ValueError(f"point {i}: {array[i]} is not a coordinate")
    return arrays
