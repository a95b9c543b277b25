"""Which lane a row of a recording lies in, where lanes are given as shapes between two lines each."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.workflows.recordings.cuts import LANE_AGREEMENT
from xosc_lateral.workflows.recordings.importers.track_table import Tracks
from xosc_lateral.workflows.recordings.importers.tracks import PlacedTracks
from xosc_lateral.workflows.recordings.lane_graph import LaneGraph

CURVATURE_WINDOW = 20.0  # way over which a lane's turning is averaged into a curvature: bounds are polygons [m]
FACING_STEP = 5.0  # of places at which lanes beside each other are compared: 2 mm off at R = 100 m [m]


class LaneShape(ABC):
    """A lane between its boundaries, in coordinates along and across its centre line, shape (n, 2 or 3). [m]"""

    def __init__(self, centre: FloatArray, boundaries: Sequence[FloatArray], beyond: float = 0.0) -> None:
        self.centre = centre
        self.left, self.right = boundaries
        self.step = np.diff(centre[:, :2], axis=0)
        self.size = np.hypot(*self.step.T)
        self.start = np.concatenate([[0.0], np.cumsum(self.size)])
        self.length = float(self.start[-1])
        self.direction = np.unwrap(np.arctan2(self.step[:, 1], self.step[:, 0]))
        both = np.concatenate(boundaries)[:, :2]
        self.low, self.high = both.min(axis=0) - beyond, both.max(axis=0) + beyond

    def may_hold(self, x: FloatArray, y: FloatArray) -> NDArray[np.bool_]:
        """Points in the box about it, shape as the arguments."""
        return np.asarray((x >= self.low[0]) & (x <= self.high[0]) & (y >= self.low[1]) & (y <= self.high[1]))

    @abstractmethod
    def place(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        """Way along the centre line (NaN beyond its ends), offset from the middle of the boundaries, width, direction
        and curvature there; shape as the arguments. [m], [m], [m], [rad], [1/m]
        """


def place_in_shapes(tracks: Tracks, shapes: Sequence[LaneShape], left: IntArray) -> PlacedTracks:
    """Every row in the lane that it drives along, amid which it is; `left`: on the left of each lane, driven the same
    way, or -1. The agreement is that with lanes driven another way, too."""
    n, x, y = len(tracks.x), tracks.x, tracks.y
    piece = np.full(n, -1)
    along, offset, width, curvature, agreement = (np.full(n, np.nan) for _ in range(5))
    nearest = np.full(n, np.inf)
    for number, shape in enumerate(shapes):
        near = np.flatnonzero(shape.may_hold(x, y))
        if not len(near):
            continue
        way, aside, wide, ahead, bend = shape.place(x[near], y[near])
        inside = (np.abs(aside) <= 0.5 * wide) & np.isfinite(way)
        along_lane = np.cos(tracks.heading[near] - ahead)
        agreement[near[inside]] = np.fmax(agreement[near[inside]], along_lane[inside])
        better = inside & (along_lane > LANE_AGREEMENT) & (np.abs(aside) < nearest[near])
        rows = near[better]
        piece[rows], nearest[rows] = number, np.abs(aside[better])
        along[rows], offset[rows], width[rows], curvature[rows] = way[better], aside[better], wide[better], bend[better]
    index, count = (np.where(piece >= 0, lanes[piece], np.nan) for lanes in lanes_beside(left))
    road = {"curvature": curvature, "lane_index": index, "lane_count": count}
    return PlacedTracks(tracks, piece, np.nan_to_num(along), offset, width, agreement, road)


def lanes_beside(left: IntArray) -> tuple[IntArray, IntArray]:
    """Lanes to the right of each lanelet that are driven the same way, and all of them, itself included."""
    right = np.full(len(left), -1)
    right[left[left >= 0]] = np.flatnonzero(left >= 0)
    counts = []
    for beside in (right, left):
        steps, here = np.zeros(len(left), dtype=np.int64), beside
        while (here >= 0).any() and steps.max() < len(left):
            steps += here >= 0
            here = np.where(here >= 0, beside[here], -1)
        counts.append(steps)
    return counts[0], counts[0] + counts[1] + 1


def lane_graph(shapes: Sequence[LaneShape], left: IntArray, following: Sequence[Sequence[int]]) -> LaneGraph:
    """Lanes and how they hang together; what lies side by side on a curve has the same station."""
    facing = {}
    for number in np.flatnonzero(left >= 0).tolist():
        for lane, other in ((number, int(left[number])), (int(left[number]), number)):
            shape = shapes[lane]
            way = np.linspace(0.0, shape.length, int(np.ceil(shape.length / FACING_STEP)) + 1)
            x, y = (np.interp(way, shape.start, shape.centre[:, axis]) for axis in (0, 1))
            other_way = shapes[other].place(x, y)[0]
            known = np.isfinite(other_way)
            if known.sum() > 1:
                facing[lane, other] = way[known], np.maximum.accumulate(other_way[known])
    return LaneGraph(np.array([shape.length for shape in shapes]), left, following, facing)


def curvature_along(start: FloatArray, direction: FloatArray, way: FloatArray) -> FloatArray:
    """Smoothed curvature [1/m] at ways along a polyline, by the way to its points and its pieces' direction."""
    middles = 0.5 * (start[1:] + start[:-1])
    half = 0.5 * CURVATURE_WINDOW
    bend = np.interp(way + half, middles, direction) - np.interp(way - half, middles, direction)
    span = np.minimum(way + half, middles[-1]) - np.maximum(way - half, middles[0])
    return np.asarray(np.where(span > 1.0, bend / np.maximum(span, 1.0), 0.0))


# ---- lanes between lines whose points don't face each other
STEP = 1.0  # points of a centre line are at most this far apart, so that the nearest one is next to a point's foot [m]
END_TOLERANCE = 1e-3  # a foot that lies farther than this before the start or past the end is outside [m]


class Strip(LaneShape):
    """A lane between lines in the direction of travel, shape (n, 3); the centre may lie anywhere between. [m]"""

    def __init__(self, centre: FloatArray, left: FloatArray, right: FloatArray) -> None:
        from scipy.spatial import cKDTree

        super().__init__(_dense(centre), [left, right], END_TOLERANCE)
        self._tree = cKDTree(self.centre[:, :2])
        self._left, self._right = self._edge(left), self._edge(right)

    def _edge(self, line: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """A boundary as way along, offset from the centre line and height, in order of the way."""
        dense = _dense(line)
        way, aside, _, _ = self._foot(dense[:, 0], dense[:, 1])
        order = np.argsort(way, kind="stable")
        return way[order], aside[order], dense[order, 2]

    def place(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, ...]:
        """See `LaneShape`."""
        way, aside, k, beyond = self._foot(x, y)
        left, right = (np.interp(way, edge[0], edge[1]) for edge in (self._left, self._right))
        high, low = (np.interp(way, edge[0], edge[2]) for edge in (self._left, self._right))
        lean = np.hypot(left - right, high - low) / np.maximum(left - right, 1e-6)  # across the surface, as roads count
        outside = np.abs(beyond) > END_TOLERANCE
        curvature = curvature_along(self.start, self.direction, way)
        offset, width = lean * (aside - 0.5 * (left + right)), lean * (left - right)
        return np.where(outside, np.nan, way), offset, width, self.direction[k], curvature

    def _foot(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, NDArray[np.intp], FloatArray]:
        """Way along, distance to the left, number of the piece, and how far past its ends; shape as the arguments."""
        points = np.stack([x, y], axis=1)
        nearest = np.asarray(self._tree.query(points)[1], dtype=np.intp)
        before, after = (self._on(points, np.clip(nearest + side, 0, len(self.size) - 1)) for side in (-1, 0))
        is_before = before[4] <= after[4]
        way, aside, k, beyond = (np.where(is_before, *both) for both in zip(before[:4], after[:4], strict=True))
        return way, aside, k, beyond

    def _on(self, points: FloatArray, k: NDArray[np.intp]) -> tuple[Any, ...]:
        """The same on one piece each, and the distance from it squared."""
        along = self.step[k] / self.size[k][:, None]
        about = points - self.centre[k, :2]
        ahead = (about * along).sum(axis=1)
        aside = along[:, 0] * about[:, 1] - along[:, 1] * about[:, 0]
        held = np.clip(ahead, 0.0, self.size[k])
        past = np.where((k == 0) & (ahead < 0.0), ahead, 0.0)
        past = np.where((k == len(self.size) - 1) & (ahead > self.size[k]), ahead - self.size[k], past)
        return self.start[k] + held, aside, k, past, (ahead - held) ** 2 + aside**2


def middle(left: FloatArray, right: FloatArray) -> FloatArray:
    """A line between two others that are driven the same way, shape (n, 3). [m]"""
    shares = [way / way[-1] for way in map(_way, (left, right))]
    every = np.union1d(*shares)
    ends = [
        np.stack([np.interp(every, share, line[:, axis]) for axis in (0, 1, 2)], axis=1)
        for share, line in zip(shares, (left, right), strict=True)
    ]
    return np.asarray(0.5 * (ends[0] + ends[1]))


def _way(line: FloatArray) -> FloatArray:
    return np.asarray(np.r_[0.0, np.cumsum(np.hypot(*np.diff(line[:, :2], axis=0).T))])


def _dense(line: FloatArray) -> FloatArray:
    """Without points that are there twice, and none farther from the next than `STEP`."""
    line = line[np.r_[True, np.hypot(*np.diff(line[:, :2], axis=0).T) > 1e-9]]
    size, way = np.hypot(*np.diff(line[:, :2], axis=0).T), _way(line)
    count = np.maximum(np.ceil(size / STEP).astype(np.int64), 1)
    piece = np.repeat(np.arange(len(size)), count)
    within = np.concatenate([np.arange(n) / n for n in count]) if len(count) else np.zeros(0)
    at = np.append(way[piece] + within * size[piece], way[-1])
    return np.stack([np.interp(at, way, line[:, axis]) for axis in (0, 1, 2)], axis=1)
