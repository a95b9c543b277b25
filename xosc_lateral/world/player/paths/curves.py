"""NURBS curves and clothoids: the former a polyline through a point per metre of their control polygon.

References
----------
.. [1] L. Piegl, W. Tiller, "The NURBS Book", 2nd ed., 1997, eq. 4.1.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import hypot, nan, pi

import numpy as np
from msgspec import Struct

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.world.player.paths.base import Path, PathPoint
from xosc_lateral.world.player.paths.polyline import Corner, PolylinePath
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.geometry import Spiral
from xosc_lateral.world.road.positions import wrap

SAMPLE_LENGTH = 1.0
"""Length of the control polygon per sample. [m]"""

MOST_SAMPLES = 20_000
"""Longer curves are sampled more coarsely. [-]"""

_TANGENT_STEP = 0.001
"""Step in the curve's parameter that its direction is taken over. [-]"""


class Control(Struct, frozen=True):
    """A control point: [m], [-], [s]; NaN in `time`: none."""

    x: float
    y: float
    weight: float = 1.0
    time: float = nan


class NurbsPath(Path):
    """A NURBS curve of an order (degree + 1), with as many knots as control points and order together."""

    def __init__(self, controls: Sequence[Control], knots: Sequence[float], order: int) -> None:
        from scipy.interpolate import BSpline  # takes a while to import, and few scenarios have a curve

        self.controls = tuple(controls)
        self._knots, self._degree = np.asarray(knots, dtype=np.float64), order - 1
        weighed = np.array([(c.weight * c.x, c.weight * c.y, c.weight) for c in self.controls])
        self._curve = BSpline(self._knots, weighed, self._degree)
        self._parameters, self._line = self._sample()
        super().__init__(self._line.lengths, self._line.times)

    def at(self, s: float) -> PathPoint:
        """The point of the curve itself at the parameter that belongs to a length."""
        i, u = self.piece(s)
        following = min(i + 1, len(self._parameters) - 1)
        parameter = self._parameters[i] + u * (self._parameters[following] - self._parameters[i])
        ((x, y),) = self.points(np.array([parameter])).tolist()
        heading = self._line.at(s).heading
        return PathPoint(x, y, nan, heading, nan, nan, heading)

    def points(self, parameters: FloatArray) -> FloatArray:
        """x and y at parameters of shape (n,), shape (n, 2). [m]"""
        curve = self._curve(self._inside(parameters))
        return np.asarray(curve[:, :2] / curve[:, 2:])

    def _inside(self, parameters: FloatArray) -> FloatArray:
        """Within the knots between which shares sum to 1 (an unclamped curve begins after its first knot)."""
        first, last = self._knots[self._degree], self._knots[len(self.controls)]
        return np.clip(parameters, first, max(first, last - EPSILON))

    def _sample(self) -> tuple[FloatArray, PolylinePath]:
        polygon = sum(hypot(b.x - a.x, b.y - a.y) for a, b in itertools.pairwise(self.controls))
        steps = min(int(1 + polygon / SAMPLE_LENGTH), MOST_SAMPLES)
        step = float(self._knots[-1]) / steps
        parameters = np.arange(steps + 1, dtype=np.float64) * step
        places = self.points(parameters)
        headings, times = self._headings(parameters, places, step), self._times(parameters, step)
        rows = zip(places.tolist(), headings, times, strict=True)
        corners = [Corner(x, y, heading=wrap(heading), time=time) for (x, y), heading, time in rows]
        return parameters, PolylinePath(corners, follow=True)

    def _headings(self, parameters: FloatArray, places: FloatArray, step: float) -> list[float]:
        """Directions towards a point just ahead, at the end from one just behind; a sample on where these coincide."""
        ahead = np.where(np.arange(len(parameters)) < len(parameters) - 1, 1.0, -1.0)
        way = ahead[:, None] * (self.points(parameters + ahead * min(_TANGENT_STEP, step)) - places)
        longer = ahead[:, None] * (self.points(parameters + ahead * step) - places)
        way = (
            np.where(np.hypot(way[:, :1], way[:, 1:]) < EPSILON, longer, way) + 0.0
        )  # no minus zero: it has a direction
        return [float(angle) for angle in np.arctan2(way[:, 1], way[:, 0])]

    def _times(self, parameters: FloatArray, step: float) -> list[float]:
        """Times of the samples: those of the control points where each weighs most, evenly in between."""
        from scipy.interpolate import BSpline

        delta = min(_TANGENT_STEP, step)
        beside = np.r_[parameters[:-1] + delta, parameters[-1] - delta]
        shares = BSpline.design_matrix(self._inside(beside), self._knots, self._degree).tocsc()
        shares.data = shares.data.round(12)  # of two samples as good as each other the first
        peaks = parameters[np.asarray(shares.argmax(axis=0)).ravel()].tolist()
        times, k = [], 0
        for parameter in parameters.tolist():
            while k < len(peaks) - 2 and parameter >= peaks[k + 1]:
                k += 1
            span = peaks[k + 1] - peaks[k]
            share = (parameter - peaks[k]) / span if span > 0.0 else 1.0
            a, b = self.controls[k].time, self.controls[k + 1].time
            times.append(a + share * (b - a))
        return times


def clamped_knots(count: int, order: int) -> tuple[float, ...]:
    """Even knots from 0 to 1 that make the curve begin and end in its first and last control point."""
    inner = max(count + 1 - order, 1)
    return tuple(min(max((i + 1 - order) / inner, 0.0), 1.0) for i in range(count + order))


# ---- clothoids and clothoid splines: curvature changes evenly with length on each piece ----
@dataclass(frozen=True, slots=True)
class TimedClothoid:
    """One clothoid: where it starts [m], [rad], curvatures at both ends [1/m], length [m], start time [s]."""

    x: float
    y: float
    heading: float
    curvature: float
    end_curvature: float
    length: float
    start_time: float = nan
    _spiral: Spiral | None = field(init=False, repr=False, compare=False)
    """As on a road; None: no length."""

    def __post_init__(self) -> None:
        """Lay it out."""
        layout = (self.x, self.y, self.heading, self.length, self.curvature, self.end_curvature)
        object.__setattr__(self, "_spiral", Spiral.of(*layout) if self.length > 0.0 else None)

    def at(self, s: float) -> tuple[float, float, float]:
        """x, y, heading at a length. [m], [rad]"""
        x, y, heading = (self.x, self.y, self.heading) if self._spiral is None else self._spiral.at(s)
        return x, y, heading % (2.0 * pi)


class ClothoidPath(Path):
    """Clothoid pieces one after another. `pieces`: at least one; `end_time`: [s]; NaN without times."""

    def __init__(self, pieces: Sequence[TimedClothoid], end_time: float = nan) -> None:
        lengths = itertools.accumulate((piece.length for piece in pieces), initial=0.0)
        super().__init__(tuple(lengths), (*(piece.start_time for piece in pieces), end_time))
        self.pieces = tuple(pieces)
        self.spans = tuple(piece.length for piece in pieces)

    def at(self, s: float) -> PathPoint:
        """The point at a length; beyond the ends, the ends."""
        left = min(max(s, 0.0), self.length)
        for piece in self.pieces:
            if left <= piece.length or piece is self.pieces[-1]:
                x, y, heading = piece.at(min(left, piece.length))
                return PathPoint(x, y, nan, wrap(heading), nan, nan, wrap(heading))
            left -= piece.length
        raise AssertionError("a clothoid path has pieces")
