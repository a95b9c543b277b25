"""Lanes between two boundary lines whose points don't face each other, and where a vehicle lies in them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.formats.importers.lane_shapes import LaneShape, curvature_along

FloatArray = NDArray[np.float64]

STEP = 1.0
"""Points of a centre line are at most this far apart, so that the nearest one is next to a point's foot. [m]"""

BEYOND = 1e-3
"""A foot that lies farther than this before the start or past the end is outside. [m]"""


class Strip(LaneShape):
    """A lane in coordinates along and across its centre line.

    Parameters
    ----------
    centre, left, right : array, shape (n, 3)
        Lines in the direction of travel; the centre line may lie anywhere between the other two. [m]
    """

    def __init__(self, centre: FloatArray, left: FloatArray, right: FloatArray) -> None:
        from scipy.spatial import cKDTree

        super().__init__(_dense(centre), [left, right], BEYOND)
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
        outside = np.abs(beyond) > BEYOND
        curvature = curvature_along(self.start, self.direction, way)
        offset, width = lean * (aside - 0.5 * (left + right)), lean * (left - right)
        return np.where(outside, np.nan, way), offset, width, self.direction[k], curvature

    def _foot(self, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray, NDArray[np.intp], FloatArray]:
        """Way along, distance to the left, number of the piece, and how far past its ends; shape as the arguments."""
        points = np.stack([x, y], axis=1)
        nearest = np.asarray(self._tree.query(points)[1], dtype=np.intp)
        found = [self._on(points, np.clip(nearest + side, 0, len(self.size) - 1)) for side in (-1, 0)]
        first = found[0][4] <= found[1][4]
        way, aside, beyond = (np.where(first, found[0][n], found[1][n]) for n in (0, 1, 3))
        k = np.where(first, found[0][2], found[1][2])
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
    ways = [np.concatenate([[0.0], np.cumsum(_sizes(line))]) for line in (left, right)]
    share = np.union1d(*(way / way[-1] for way in ways))
    ends = [
        np.stack([np.interp(share, way / way[-1], line[:, axis]) for axis in (0, 1, 2)], axis=1)
        for way, line in zip(ways, (left, right), strict=True)
    ]
    return np.asarray(0.5 * (ends[0] + ends[1]))


def _sizes(line: FloatArray) -> FloatArray:
    """Of the pieces of a line, seen from above, shape (n - 1,). [m]"""
    return np.asarray(np.hypot(*np.diff(line[:, :2], axis=0).T))


def _dense(line: FloatArray) -> FloatArray:
    """Without points that are there twice, and none farther from the next than `STEP`."""
    size = _sizes(line)
    line = line[np.r_[True, size > 1e-9]]
    size = _sizes(line)
    way = np.concatenate([[0.0], np.cumsum(size)])
    count = np.maximum(np.ceil(size / STEP).astype(np.int64), 1)
    piece = np.repeat(np.arange(len(size)), count)
    within = np.concatenate([np.arange(n) / n for n in count]) if len(count) else np.zeros(0)
    at = np.append(way[piece] + within * size[piece], way[-1])
    return np.stack([np.interp(at, way, line[:, axis]) for axis in (0, 1, 2)], axis=1)
