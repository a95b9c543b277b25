"""The elements of a reference line, one place at a time in plain floats: line, arc, spiral, parametric cubic.

Every element answers `at(ds)` -> (x, y, heading) and `curvature_at(ds)`, with ds [m] from its start; beyond its ends it
is continued. Arrays of places are evaluated in `reference_line` from the same pieces.

References
----------
.. [1] ASAM OpenDRIVE 1.8, chapter 9: line, spiral, arc, parametric cubic curve.
"""

from __future__ import annotations

from math import atan2, ceil, cos, hypot, sin, sqrt

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray


def simplify(x: NDArray[np.float64], y: NDArray[np.float64], tolerance: float) -> NDArray[np.int64]:
    """Points of a polyline to keep so that no other one is farther off than `tolerance` (Douglas and Peucker 1973).

    x, y of shape (n,), `tolerance` in [m]; the result: indices, shape (m,), first and last included.
    """
    kept = {0, len(x) - 1}
    todo = [(0, len(x) - 1)]
    while todo:
        first, last = todo.pop()
        if last - first < 2:
            continue
        along_x, along_y = x[last] - x[first], y[last] - y[first]
        inner = slice(first + 1, last)
        from_x, from_y = x[inner] - x[first], y[inner] - y[first]
        length = np.hypot(along_x, along_y)
        off = np.abs(along_x * from_y - along_y * from_x) / length if length > 0.0 else np.hypot(from_x, from_y)
        farthest = int(np.argmax(off))
        if off[farthest] > tolerance:
            middle = first + 1 + farthest
            kept.add(middle)
            todo += [(first, middle), (middle, last)]
    return np.array(sorted(kept), dtype=np.int64)


TURN_PER_PIECE = 0.5
"""A clothoid is expanded in power series over pieces that turn at most by this. [rad]"""

BEND_PER_PIECE = 0.02
"""... and the change of curvature turns each half of a piece by at most this. [rad]"""

SERIES_TERMS = 13
"""The first tangent terms left out, (0.25)^13 / 13! and 0.25 (0.02)^6 / 6!, are below 3e-14."""

MAX_TURN = 2000.0
"""An element that turns more than this is refused by the reader. [rad]"""


class ClothoidPiece(Struct, frozen=True):
    """A stretch of clothoid (line and arc included) about its middle."""

    start: float  # start, middle, end: ds in its element [m]
    middle: float
    end: float
    heading: float  # at the middle [rad]
    curvature: float  # at the middle [1/m]
    sharpness: float  # change of curvature [1/m^2]
    x_series: tuple[float, ...]  # power series in ds - middle, lowest power first
    y_series: tuple[float, ...]


def clothoid_pieces(
    x: float, y: float, heading: float, length: float, curvature: float, sharpness: float
) -> tuple[ClothoidPiece, ...]:
    """Cut a clothoid into pieces that turn little enough for a short power series.

    The tangent exp(i (k u + c u^2 / 2)) obeys f' = i (k + c u) f, hence the recurrence of its coefficients in
    `tangent_series`; integrating it term by term gives the position. Unlike Fresnel integrals this has no special case
    where the curvature does not change, and needs no division by its change.
    """
    turn = max(abs(curvature), abs(curvature + sharpness * length)) * length
    n = max(1, ceil(turn / TURN_PER_PIECE), ceil(length * sqrt(abs(sharpness) / (8.0 * BEND_PER_PIECE))))
    step = length / n
    pieces = []
    at = complex(x, y)
    for i in range(n):
        middle = (i + 0.5) * step
        k = curvature + sharpness * middle
        theta = heading + middle * (curvature + 0.5 * sharpness * middle)
        position = [0j, *(a / (j + 1) for j, a in enumerate(tangent_series(k, sharpness, SERIES_TERMS)))]
        rotation = complex(cos(theta), sin(theta))
        series = [rotation * a for a in position]
        series[0] = at - _horner(series, -0.5 * step)
        at = _horner(series, 0.5 * step)
        pieces.append(
            ClothoidPiece(
                *(i * step, middle, (i + 1) * step, theta, k, sharpness),
                tuple(a.real for a in series),
                tuple(a.imag for a in series),
            )
        )
    return tuple(pieces)


def tangent_series(k: float, c: float, terms: int) -> list[complex]:
    """Taylor coefficients of exp(i (k u + c u^2 / 2)) in u: (n + 1) a[n + 1] = i (k a[n] + c a[n - 1])."""
    series = [1.0 + 0j]
    before = 0j
    for n in range(terms - 1):
        series.append(1j * (k * series[n] + c * before) / (n + 1))
        before = series[n]
    return series


def _horner(series: list[complex], u: float) -> complex:
    value = 0j
    for coefficient in reversed(series):
        value = value * u + coefficient
    return value


class Placed(Struct, frozen=True):
    """What begins at (x, y); [m], heading in [rad]."""

    x: float
    y: float
    heading: float
    length: float


class Line(Placed, frozen=True):
    """A straight line."""

    cos_heading: float
    sin_heading: float

    @classmethod
    def of(cls, x: float, y: float, heading: float, length: float) -> Line:
        """A line from (x, y). Lengths in [m], heading in [rad], curvature in [1/m]."""
        return cls(x, y, heading, length, cos(heading), sin(heading))

    def at(self, ds: float) -> tuple[float, float, float]:
        """x, y, heading at ds. Everything in [m], [rad]."""
        return self.x + ds * self.cos_heading, self.y + ds * self.sin_heading, self.heading

    def curvature_at(self, ds: float) -> float:
        """Zero. [1/m]"""
        return 0.0


class Arc(Placed, frozen=True):
    """A circular arc, curvature in [1/m]."""

    curvature: float

    def at(self, ds: float) -> tuple[float, float, float]:
        """x, y, heading at ds, along the chord: exact for any curvature, also one near zero. [m], [rad]"""
        half = 0.5 * self.curvature * ds
        # sin(h) / h loses nothing above 1e-8 and is 1 to the last bit below
        chord = ds * sin(half) / half if abs(half) > 1e-8 else ds
        direction = self.heading + half
        return self.x + chord * cos(direction), self.y + chord * sin(direction), direction + half

    def curvature_at(self, ds: float) -> float:
        """Constant. [1/m]"""
        return self.curvature


class Spiral(Struct, frozen=True):
    """A clothoid: curvature [1/m] changes linearly along it; lengths in [m], heading in [rad]."""

    heading: float
    curvature: float
    sharpness: float
    pieces_per_metre: float
    parts: tuple[ClothoidPiece, ...]

    @classmethod
    def of(cls, x: float, y: float, heading: float, length: float, start: float, end: float) -> Spiral:
        """A clothoid from curvature `start` to `end`. Lengths in [m], heading in [rad], curvature in [1/m]."""
        sharpness = (end - start) / length
        parts = clothoid_pieces(x, y, heading, length, start, sharpness)
        return cls(heading, start, sharpness, len(parts) / length, parts)

    def at(self, ds: float) -> tuple[float, float, float]:
        """x, y, heading at ds. Everything in [m], [rad]."""
        i = int(ds * self.pieces_per_metre)
        part = self.parts[0 if i < 0 else i if i < len(self.parts) else -1]
        u = ds - part.middle
        x0, x1, x2, x3, x4, x5, x6, x7, x8, x9, x10, x11, x12, x13 = part.x_series
        y0, y1, y2, y3, y4, y5, y6, y7, y8, y9, y10, y11, y12, y13 = part.y_series
        x = x6 + u * (x7 + u * (x8 + u * (x9 + u * (x10 + u * (x11 + u * (x12 + u * x13))))))
        y = y6 + u * (y7 + u * (y8 + u * (y9 + u * (y10 + u * (y11 + u * (y12 + u * y13))))))
        return (
            x0 + u * (x1 + u * (x2 + u * (x3 + u * (x4 + u * (x5 + u * x))))),
            y0 + u * (y1 + u * (y2 + u * (y3 + u * (y4 + u * (y5 + u * y))))),
            self.heading + ds * (self.curvature + 0.5 * self.sharpness * ds),
        )

    def curvature_at(self, ds: float) -> float:
        """Linear in ds. [1/m]"""
        return self.curvature + self.sharpness * ds


class ParamCubic(Struct, frozen=True):
    """A parametric cubic (paramPoly3, and poly3 as its special case) run through by arc length."""

    x: tuple[float, ...]  # x, y: world coordinates as cubics of the parameter p
    y: tuple[float, ...]
    length: float
    step: float  # length of the pieces of p(ds) [m]
    parameter: tuple[tuple[float, ...], ...]  # p as a cubic of ds about each piece's start

    def _parameter_at(self, ds: float) -> float:
        i = int(ds / self.step)
        i = 0 if i < 0 else min(i, len(self.parameter) - 1)
        a, b, c, d = self.parameter[i]
        ds -= i * self.step
        return a + ds * (b + ds * (c + ds * d))

    def at(self, ds: float) -> tuple[float, float, float]:
        """x, y, heading at ds. Everything in [m], [rad]."""
        p = self._parameter_at(ds)
        x0, x1, x2, x3 = self.x
        y0, y1, y2, y3 = self.y
        return (
            x0 + p * (x1 + p * (x2 + p * x3)),
            y0 + p * (y1 + p * (y2 + p * y3)),
            atan2(y1 + p * (2.0 * y2 + 3.0 * p * y3), x1 + p * (2.0 * x2 + 3.0 * p * x3)),
        )

    def curvature_at(self, ds: float) -> float:
        """Curvature of the curve itself, whatever its parameter. [1/m]"""
        return self._curvature_of(self._parameter_at(ds))

    def curvature_in_esmini(self, ds: float) -> float:
        """Where the parameter has the share of its end that ds has of the length. [1/m]"""
        return self._curvature_of(ds / self.length * self._parameter_at(self.length))

    def _curvature_of(self, p: float) -> float:
        _, x1, x2, x3 = self.x
        _, y1, y2, y3 = self.y
        dx, dy = x1 + p * (2.0 * x2 + 3.0 * p * x3), y1 + p * (2.0 * y2 + 3.0 * p * y3)
        ddx, ddy = 2.0 * x2 + 6.0 * p * x3, 2.0 * y2 + 6.0 * p * y3
        speed = hypot(dx, dy)
        return (dx * ddy - dy * ddx) / (speed * speed * speed) if speed > 0.0 else 0.0


ReferenceElement = Line | Arc | Spiral | ParamCubic


def pieces_of(element: Line | Arc | Spiral) -> tuple[ClothoidPiece, ...]:
    """All but a parametric cubic as clothoid pieces."""
    if isinstance(element, Spiral):
        return element.parts
    x, y, heading, length = element.x, element.y, element.heading, element.length
    return clothoid_pieces(x, y, heading, length, element.curvature_at(0.0), 0.0)
