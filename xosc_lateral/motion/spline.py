"""A natural cubic spline through a few points, with its slopes."""

from __future__ import annotations

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class NaturalSpline(Struct, frozen=True, eq=False):
    """Natural cubic spline: values and second derivatives (`bends`) at its knots.

    Our own dozen lines since scipy.interpolate alone takes a third of `convert`'s time.
    """

    knots: FloatArray
    values: FloatArray
    bends: FloatArray

    @classmethod
    def natural(cls, knots: FloatArray, values: FloatArray) -> NaturalSpline:
        """Through the points (knots, values), shape (n,) each, n >= 2, knots strictly increasing."""
        knots, values = np.array(knots, dtype=np.float64), np.array(values, dtype=np.float64)
        if knots.shape != values.shape or len(knots) < 2 or not (np.diff(knots) > 0.0).all():
            raise ValueError("a spline needs two or more points at strictly increasing distances")
        return cls(knots, values, _second_derivatives(knots, values))

    def __call__(self, at: FloatArray) -> FloatArray:
        """Values at these places, any shape. [unit of the values]"""
        k = np.clip(np.searchsorted(self.knots, at, side="right") - 1, 0, len(self.knots) - 2)
        width = self.knots[k + 1] - self.knots[k]
        b = (at - self.knots[k]) / width
        a = 1.0 - b
        cubic = ((a**3 - a) * self.bends[k] + (b**3 - b) * self.bends[k + 1]) * width**2 / 6.0
        return np.asarray(a * self.values[k] + b * self.values[k + 1] + cubic)

    def start(self) -> tuple[float, float, float]:
        """Value, slope and second derivative at the first knot."""
        width = self.knots[1] - self.knots[0]
        slope = (self.values[1] - self.values[0]) / width - width * (2.0 * self.bends[0] + self.bends[1]) / 6.0
        return float(self.values[0]), float(slope), float(self.bends[0])

    def end(self) -> tuple[float, float, float]:
        """Value, slope and second derivative at the last knot."""
        width = self.knots[-1] - self.knots[-2]
        slope = (self.values[-1] - self.values[-2]) / width + width * (self.bends[-2] + 2.0 * self.bends[-1]) / 6.0
        return float(self.values[-1]), float(slope), float(self.bends[-1])


def _second_derivatives(knots: FloatArray, values: FloatArray) -> FloatArray:
    """Solve the spline's tridiagonal system by elimination (Thomas); natural ends."""
    width = np.diff(knots)
    jump = 6.0 * np.diff(np.diff(values) / width)
    n = len(knots)
    bends = np.zeros(n)
    if n == 2:
        return bends
    below, diagonal, right = width.tolist(), (2.0 * (width[:-1] + width[1:])).tolist(), jump.tolist()
    for i in range(1, n - 2):
        factor = below[i] / diagonal[i - 1]
        diagonal[i] -= factor * below[i]
        right[i] -= factor * right[i - 1]
    last = 0.0
    for i in range(n - 3, -1, -1):
        last = (right[i] - (below[i + 1] * last if i < n - 3 else 0.0)) / diagonal[i]
        bends[i + 1] = last
    return bends
