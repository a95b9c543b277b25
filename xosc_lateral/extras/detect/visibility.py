"""What a ray meets first among boxes seen from above, how much of a box is seen past the others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray


class Boxes(NamedTuple):
    """Rectangles in the plane: centres, headings and sizes; shape (n,) each. [m], [rad]"""

    x: FloatArray
    y: FloatArray
    heading: FloatArray
    length: FloatArray
    width: FloatArray

    def at(self, rows: IndexArray | BoolArray) -> Boxes:
        """Some of them."""
        return Boxes(*(values[rows] for values in self))

    def corners(self) -> FloatArray:
        """Shape (n, 4, 2)."""
        along = 0.5 * self.length[:, None] * np.array([1.0, 1.0, -1.0, -1.0])
        left = 0.5 * self.width[:, None] * np.array([1.0, -1.0, -1.0, 1.0])
        cos, sin = np.cos(self.heading)[:, None], np.sin(self.heading)[:, None]
        return np.stack(
            [self.x[:, None] + along * cos - left * sin, self.y[:, None] + along * sin + left * cos], axis=-1
        )


def ray_distances(origin: FloatArray, bearings: FloatArray, boxes: Boxes) -> FloatArray:
    """From a point (2,) along m bearings to each of n boxes, shape (n, m); infinite where a ray misses. [m], [rad]"""
    dx, dy = origin[0] - boxes.x, origin[1] - boxes.y
    cos, sin = np.cos(boxes.heading), np.sin(boxes.heading)
    turned = bearings[None, :] - boxes.heading[:, None]
    start = np.stack([dx * cos + dy * sin, dy * cos - dx * sin])[:, :, None]
    way = np.stack([np.cos(turned), np.sin(turned)])
    half = 0.5 * np.stack([boxes.length, boxes.width])[:, :, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        lower, upper = (-half - start) / way, (half - start) / way
        enters = np.nanmax(np.minimum(lower, upper), axis=0)
        leaves = np.nanmin(np.maximum(lower, upper), axis=0)
    return np.where((enters <= leaves) & (enters > 0.0), enters, np.inf)


def visible_share(origin: FloatArray, boxes: Boxes, target: int) -> float:
    """Share of the angle that a box takes, seen from a point (2,), that no other box is before.

    Between the bearings of neighbouring corners one box is the nearest throughout: a ray between them tells which, so
    that the share is exact for boxes that do not overlap.
    """
    away = boxes.corners() - origin
    towards = np.arctan2(boxes.y[target] - origin[1], boxes.x[target] - origin[0])
    bearing = np.arctan2(away[..., 1], away[..., 0]) - towards
    bearing = (bearing + np.pi) % (2.0 * np.pi) - np.pi
    first, last = float(bearing[target].min()), float(bearing[target].max())
    inner = bearing[(bearing > first) & (bearing < last)]
    edges = np.unique(np.concatenate([[first], inner, [last]]))
    rays = 0.5 * (edges[1:] + edges[:-1])
    nearest = ray_distances(origin, towards + rays, boxes).argmin(axis=0)
    return float(np.diff(edges)[nearest == target].sum() / (last - first))


def points_seen(origin: FloatArray, points: FloatArray, boxes: Boxes) -> BoolArray:
    """Which of m points (m, 2) no box is before, seen from a point (2,); shape (m,)."""
    away = points - origin
    hits = ray_distances(origin, np.arctan2(away[:, 1], away[:, 0]), boxes).min(axis=0, initial=np.inf)
    return np.asarray(hits >= np.hypot(away[:, 0], away[:, 1]))
