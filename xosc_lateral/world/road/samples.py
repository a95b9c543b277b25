"""Samples laid over all lanes, in a grid: which pieces of road are near a point.

References
----------
.. [1] J. L. Bentley, J. H. Friedman, "Data structures for range searching", ACM Computing Surveys 11, 1979: cells.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, Int32Array
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.world.road.lanes import Lane, LaneSection
from xosc_lateral.world.road.tables import NetworkTables

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
            from scipy.spatial import cKDTree

            tree = cKDTree(np.stack([self.x, self.y], axis=1))
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
