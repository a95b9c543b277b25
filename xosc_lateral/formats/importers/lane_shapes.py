"""Which lane a row of a recording lies in, where lanes are given as shapes; lanes that are side by side."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.formats.importers.placed import PlacedTracks
from xosc_lateral.formats.importers.track_table import Tracks

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LEAST_AGREEMENT = 0.7
"""Cosine between a vehicle's heading and the lane's that is taken to be driven along. [-]"""

SMOOTHED = 20.0
"""Way over which a lane's turning is averaged into a curvature: bounds are polygons. [m]"""


class LaneShape(ABC):
    """A lane between two boundaries, in coordinates along and across its centre line.

    Parameters
    ----------
    centre : array, shape (n, 2) or (n, 3)
        In the direction of travel. [m]
    boundaries : sequence of array
        Lines about it. [m]
    beyond : float
        So far out of their box a point may lie in the lane. [m]
    """

    def __init__(self, centre: FloatArray, boundaries: Sequence[FloatArray], beyond: float = 0.0) -> None:
        self.centre = centre
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
    """Every row in the lane that it drives along; `left`: on the left of each lane, driven the same way, or -1."""
    piece, along, offset, width, curvature = find_lanes(shapes, tracks.x, tracks.y, tracks.heading)
    index, count = lanes_beside(left)
    inside = piece >= 0
    road = {
        "curvature": curvature,
        "lane_index": np.where(inside, index[piece], np.nan),
        "lane_count": np.where(inside, count[piece], np.nan),
    }
    return tracks.placed(piece, along, offset, width, road)


def find_lanes(
    shapes: Sequence[LaneShape], x: FloatArray, y: FloatArray, heading: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Lanelet that every row drives along (-1: none), way in it, offset, width and curvature: the one it is amid."""
    n = len(x)
    piece = np.full(n, -1)
    along, offset, width, curvature = (np.full(n, np.nan) for _ in range(4))
    nearest = np.full(n, np.inf)
    for number, shape in enumerate(shapes):
        near = np.flatnonzero(shape.may_hold(x, y))
        if not len(near):
            continue
        way, aside, wide, ahead, bend = shape.place(x[near], y[near])
        inside = (np.abs(aside) <= 0.5 * wide) & np.isfinite(way) & (np.cos(heading[near] - ahead) > LEAST_AGREEMENT)
        better = inside & (np.abs(aside) < nearest[near])
        rows = near[better]
        piece[rows], nearest[rows] = number, np.abs(aside[better])
        along[rows], offset[rows], width[rows], curvature[rows] = way[better], aside[better], wide[better], bend[better]
    return piece, np.nan_to_num(along), offset, width, curvature


def lanes_beside(left: IntArray) -> tuple[IntArray, IntArray]:
    """Lanes to the right of each lanelet that are driven the same way, and all of them, itself included."""
    right = np.full(len(left), -1)
    right[left[left >= 0]] = np.flatnonzero(left >= 0)
    counts = []
    for beside in (right, left):
        steps = np.zeros(len(left), dtype=np.int64)
        for start in range(len(left)):
            here = start
            while beside[here] >= 0 and steps[start] < len(left):
                here = int(beside[here])
                steps[start] += 1
        counts.append(steps)
    return counts[0], counts[0] + counts[1] + 1


def curvature_along(start: FloatArray, direction: FloatArray, way: FloatArray) -> FloatArray:
    """Curvature of a polyline, smoothed, shape as `way`. [1/m]

    Parameters
    ----------
    start : array, shape (n + 1,)
        Way along it to each of its points. [m]
    direction : array, shape (n,)
        Of its pieces, unwrapped. [rad]
    way : array
        Where. [m]
    """
    middles = 0.5 * (start[1:] + start[:-1])
    bend = np.interp(way + 0.5 * SMOOTHED, middles, direction) - np.interp(way - 0.5 * SMOOTHED, middles, direction)
    span = np.minimum(way + 0.5 * SMOOTHED, middles[-1]) - np.maximum(way - 0.5 * SMOOTHED, middles[0])
    return np.asarray(np.where(span > 1.0, bend / np.maximum(span, 1.0), 0.0))
