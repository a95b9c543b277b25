"""World to lane: which roads are near a point, and which of their lanes it is in."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from xosc_lateral.base.arrays import FloatArray, Int32Array
from xosc_lateral.world.road.lane_tables import CHUNK_SIZE
from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.positions import LanePositions
from xosc_lateral.world.road.road import CONVERGED_STEP, MAX_STEP, MOST_ITERATIONS, Road
from xosc_lateral.world.road.samples import Candidates, Samples
from xosc_lateral.world.road.tables import NetworkTables

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
