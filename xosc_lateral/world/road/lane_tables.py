"""Lanes of a network as flat arrays: which lane is where, how wide, how fast; for arrays of places.

References
----------
.. [1] ASAM OpenDRIVE 1.8, chapter 11: ids, widths and speeds of lanes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from xosc_lateral.base.arrays import FloatArray, Int32Array
from xosc_lateral.world.road.lanes import DRIVING, MINIMUM_LANE_WIDTH, Lane
from xosc_lateral.world.road.piecewise import IndexLike, Lookup
from xosc_lateral.world.road.road import Road, find_lane, limit_at

CHUNK_SIZE = 8192
"""Places evaluated together: the two dozen temporary arrays of a chunk then stay in the processor's cache."""


class LaneProfile(NamedTuple):
    """Lanes at some places: row of the lane table, t of the centre, d(centre)/ds, width, travel direction."""

    row: IndexLike
    centre: FloatArray
    slope: FloatArray
    width: FloatArray
    direction: Int32Array


class LaneTables:
    """Roads, lane sections and lanes of a network as flat arrays.

    Lane rows: all lanes of all sections, lane 0 included, in one list; `_row_of` turns (section, lane id) into a row.
    The rows of a section begin at its `_section_first`: its lanes from left to right, lane 0 the last.
    """

    def __init__(self, roads: Sequence[Road], path: str) -> None:
        self.roads = roads
        self.path = path
        self._lengths = np.array([road.length for road in roads])
        self._sections = Lookup([road.section_starts for road in roads])
        sections = [section for road in roads for section in road.sections]
        self._lanes: list[Lane] = [lane for section in sections for lane in (*section.lanes, section.centre)]
        ids = [lane.id for lane in self._lanes]
        self._lowest = min(ids, default=0)  # a file may hold no road at all
        counts = np.array([0, *(len(section.by_id) for section in sections)], dtype=np.intp)
        self._section_first = np.cumsum(counts)
        self._rows = np.full((len(sections), max(ids, default=0) - self._lowest + 1), -1, dtype=np.intp)
        slot = np.array(ids, dtype=np.intp) - self._lowest
        self._rows[np.repeat(np.arange(len(sections)), counts[1:]), slot] = np.arange(len(ids))
        self._lane_ids = np.array(ids, dtype=np.int32)
        self._lane_directions = np.array([lane.direction for lane in self._lanes], dtype=np.int32)
        self._lane_lookup = Lookup([lane.starts for lane in self._lanes])
        self._lane_table = np.array(
            [(*c, *w) for lane in self._lanes for c, w in zip(lane.centre, lane.width, strict=True)]
        ).T.copy()

    def section_numbers(self, road: IndexLike, s: FloatArray) -> IndexLike:
        """Numbers of lane sections, counted over all roads; s in [m]. Shape as `s`."""
        return self._sections.find(road, s)

    def _row_of(self, road: IndexLike, lane: IndexLike, s: FloatArray) -> IndexLike:
        """Row in the lane table; raises `PlaybackError` for the first lane that is not there. Shape as `s` [m]."""
        section = self.section_numbers(road, s)
        slot = lane - self._lowest
        outside = (slot < 0) | (slot >= self._rows.shape[1])
        if np.any(outside):
            self._complain(road, lane, s, outside)
        row = self._rows[section, slot]
        if np.any(row < 0):
            self._complain(road, lane, s, row < 0)
        return int(row) if np.ndim(row) == 0 else row

    def _complain(self, road: IndexLike, lane: IndexLike, s: FloatArray, wrong: ArrayLike) -> None:
        i = int(np.argmax(np.broadcast_to(wrong, s.shape)))
        here = self.roads[int(np.broadcast_to(road, s.shape)[i])]
        find_lane(here, int(np.broadcast_to(lane, s.shape)[i]), float(s[i]), self.path or None)

    def _profile_of(self, row: IndexLike, s: FloatArray) -> LaneProfile:
        """Centre, slope and width of rows of the lane table. Shape as `s`; [m], [-], [m]."""
        piece = self._lane_lookup.find(row, s)
        ds = s - self._lane_lookup.starts[piece]
        a, b, c, d, e, f, g, h = (values.take(piece) for values in self._lane_table)
        return LaneProfile(
            row,
            a + ds * (b + ds * (c + ds * d)),
            b + ds * (2.0 * c + (3.0 * ds) * d),
            e + ds * (f + ds * (g + ds * h)),
            self._lane_directions[row],
        )

    def lane_profile(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> LaneProfile:
        """Lanes at places, as arrays of the broadcast shape."""

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike) -> tuple[FloatArray, ...]:
            profile = self._profile_of(self._row_of(road, lane, s), s)
            return tuple(np.broadcast_to(part, s.shape) for part in profile)

        row, centre, slope, width, direction = self._batch(evaluate, 5, road, s, lane=lane)
        return LaneProfile(row.astype(np.int32), centre, slope, width, direction.astype(np.int32))

    def travel_directions(self, road: ArrayLike, lane: ArrayLike) -> Int32Array:
        """`travel_direction` for arrays. Shape as the arguments. [-]"""
        road_, lane_ = np.broadcast_arrays(np.asarray(road, dtype=np.int32), np.asarray(lane, dtype=np.int32))
        pair = [_one_or_many(index, road_.shape) for index in (road_, lane_)]
        if road_.size and isinstance(pair[0], int) and isinstance(pair[1], int):
            return np.full(road_.shape, self.roads[pair[0]].directions.get(pair[1], 1), dtype=np.int32)
        # One number for both: sorting pairs takes five times as long.
        both, inverse = np.unique(road_.ravel() * np.int64(2**32) + lane_.ravel(), return_inverse=True)
        ways = [self.roads[(k + 2**31) >> 32].directions.get((k + 2**31) % 2**32 - 2**31, 1) for k in both.tolist()]
        return np.array(ways, dtype=np.int32)[inverse.ravel()].reshape(road_.shape)

    def lane_index(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> tuple[Int32Array, Int32Array]:
        """Index among driving lanes of its direction (0 = rightmost in travel; -1: it is none), and their count. [-]"""

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike) -> tuple[FloatArray, ...]:
            rows = np.broadcast_to(self._row_of(road, lane, s), s.shape)
            section = np.broadcast_to(self.section_numbers(road, s), s.shape)
            index, count = np.full(len(s), -1.0), np.zeros(len(s))
            for which in np.flatnonzero(np.bincount(section)):
                here = np.flatnonzero(section == which)
                index[here], count[here] = self._section_index(int(which), rows[here], s[here])
            return index, count

        index, count = self._batch(evaluate, 2, road, s, lane=lane)
        return index.astype(np.int32), count.astype(np.int32)

    def _section_index(self, section: int, rows: Int32Array, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        first, end = self._section_first[section : section + 2].tolist()
        direction = self._lane_directions[rows]
        index, count, is_driving = np.zeros(len(s)), np.zeros(len(s)), np.zeros(len(s), dtype=bool)
        for row in range(first, end - 1):
            if self._lanes[row].type not in DRIVING:
                continue
            itself = rows == row
            is_driving |= itself
            there = ((self._profile_of(row, s).width > MINIMUM_LANE_WIDTH) | itself) & (
                self._lane_directions[row] == direction
            )
            count += there
            # rows run from left to right looking along s
            index += there & (np.where(direction > 0, row > rows, row < rows))
        return np.where(is_driving, index, -1.0), count

    def speed_limit(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Speed limit of the lane, else of the road; inf where none is given. Shape as the arguments. [m/s]"""

        def evaluate(road: IndexLike, s: FloatArray, lane: IndexLike) -> tuple[FloatArray, ...]:
            rows = np.broadcast_to(self._row_of(road, lane, s), s.shape)
            roads = np.broadcast_to(road, s.shape)
            limits = np.full(len(s), np.inf)
            for index, row in np.unique(np.stack([roads, rows]), axis=1).T.tolist():
                speeds = self._lanes[row].speeds or self.roads[index].speeds
                if speeds:
                    here = np.flatnonzero((roads == index) & (rows == row))
                    limits[here] = [limit_at(speeds, at) for at in s[here].tolist()]
            return (limits,)

        return self._batch(evaluate, 1, road, s, lane=lane)[0]

    # ---- broadcasting ------------------------------------------------------------------------------------------------
    def _batch(
        self,
        evaluate: Callable[..., tuple[FloatArray, ...]],
        outputs: int,
        road: ArrayLike,
        s: ArrayLike,
        *across: ArrayLike,
        lane: ArrayLike | None = None,
    ) -> tuple[FloatArray, ...]:
        """Broadcast, cut into chunks, evaluate, put together; a road or lane that is one for all stays a plain int."""
        extra = [] if lane is None else [np.asarray(lane)]
        numbers = [np.asarray(a, dtype=np.float64) for a in (s, *across)]
        shape = np.broadcast_shapes(np.shape(road), *(a.shape for a in (*extra, *numbers)))
        flat = [np.broadcast_to(a, shape).ravel() for a in numbers]
        road_ = _one_or_many(road, shape)
        self._refuse_nonsense(road_, flat)
        indices = [_one_or_many(a, shape) for a in extra]
        size = len(flat[0])
        whole = [np.empty(size) for _ in range(outputs)]
        for begin in range(0, size, CHUNK_SIZE):
            part = slice(begin, begin + CHUNK_SIZE)
            cut = [a if isinstance(a, int) else a[part] for a in indices]
            results = evaluate(
                road_ if isinstance(road_, int) else road_[part], flat[0][part], *cut, *(a[part] for a in flat[1:])
            )
            for target, result in zip(whole, results, strict=True):
                target[part] = result
        return tuple(a.reshape(shape) for a in whole)

    def _refuse_nonsense(self, road: IndexLike, numbers: Sequence[FloatArray]) -> None:
        """Road -1 (off the road) would quietly be the last one, and NaN would travel on."""
        wrong = np.flatnonzero((np.asarray(road) < 0) | (np.asarray(road) >= len(self.roads)))
        if len(wrong):
            raise ValueError(
                f"road index {np.ravel(road)[wrong[0]]}: there are {len(self.roads)} roads, counted from 0"
            )
        for values in numbers:
            if not np.isfinite(values).all():
                raise ValueError(f"s, t and offset must be finite, found {values[~np.isfinite(values)][0]}")


def _one_or_many(index: ArrayLike, shape: tuple[int, ...]) -> IndexLike:
    """A plain int where all are the same: look-ups are then far cheaper."""
    array = np.asarray(index)
    if array.ndim == 0 or (array.size and (array == array.flat[0]).all()):
        return int(array.flat[0])
    return np.asarray(np.broadcast_to(array, shape).ravel(), dtype=np.intp)
