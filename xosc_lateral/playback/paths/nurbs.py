"""NURBS curves, sampled each metre of their control polygon (as in the reference player) into a polyline.

References
----------
.. [1] L. Piegl, W. Tiller, "The NURBS Book", 2nd ed., 1997, eqs. 2.5 (Cox and de Boor) and 4.1 (the curve).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, hypot, nan

from xosc_lateral.playback.angles import wrap
from xosc_lateral.playback.paths.base import PathPoint
from xosc_lateral.playback.paths.polyline import Corner, PolylinePath
from xosc_lateral.playback.transition import EPSILON

SAMPLE = 1.0
"""Length of the control polygon per sample. [m]"""

MOST_SAMPLES = 20_000
"""Longer curves are sampled more coarsely. [-]"""

_TANGENT_STEP = 0.001
"""Step in the curve's parameter that its direction is taken over. [-]"""


@dataclass(frozen=True, slots=True)
class Control:
    """A control point: [m], [-], [s]; NaN in `time`: none."""

    x: float
    y: float
    weight: float = 1.0
    time: float = nan


class NurbsPath:
    """A NURBS curve of order `order` (degree + 1).

    Parameters
    ----------
    controls : sequence of Control
        At least `order`.
    knots : sequence of float
        As many as control points and order together.
    order : int
    """

    def __init__(self, controls: Sequence[Control], knots: Sequence[float], order: int) -> None:
        self.controls = tuple(controls)
        self.knots = tuple(knots)
        self.order = order
        self._parameters: list[float] = []
        self._line = self._sample()
        self.length = self._line.length
        self.start_time = self.controls[0].time
        self.end_time = self.controls[-1].time

    def at(self, s: float) -> PathPoint:
        """The point of the curve itself at the parameter that belongs to a length."""
        i, u = self._line._piece(s)
        following = min(i + 1, len(self._parameters) - 1)
        parameter = self._parameters[i] + u * (self._parameters[following] - self._parameters[i])
        x, y, _ = self.point(parameter)
        sampled = self._line.at(s)
        return PathPoint(x, y, nan, sampled.heading, nan, nan, sampled.heading)

    def s_at(self, time: float) -> float:
        """Length at a time, evenly between samples."""
        corners, lengths = self._line.corners, self._line.lengths
        if not time > corners[0].time:
            return 0.0
        for i in range(len(corners) - 1):
            a, b = corners[i].time, corners[i + 1].time
            if a <= time < b:
                return lengths[i] + (time - a) / (b - a) * (lengths[i + 1] - lengths[i])
        return self.length

    def time_at(self, s: float) -> float:
        """Time at a length, evenly between samples. [s]"""
        return self._line.time_at(s)

    def speed_at(self, s: float) -> float:
        """Speed of the sampled piece. [m/s]"""
        i = min(self._line._piece(s)[0], len(self._line.corners) - 2)
        dt = self._line.corners[i + 1].time - self._line.corners[i].time
        return (self._line.lengths[i + 1] - self._line.lengths[i]) / dt if dt > EPSILON else 0.0

    def point(self, parameter: float) -> tuple[float, float, list[float]]:
        """x, y and the share of each control point at a parameter."""
        # Outside of these knots the shares don't sum to 1 (an unclamped curve begins after its first knot).
        first, last = self.knots[self.order - 1], self.knots[len(self.controls)]
        t = min(max(parameter, first), max(first, last - EPSILON))
        shares = basis(t, self.order, self.knots)
        total = sum(share * control.weight for share, control in zip(shares, self.controls, strict=True))
        x = sum(share * c.weight * c.x for share, c in zip(shares, self.controls, strict=True)) / total
        y = sum(share * c.weight * c.y for share, c in zip(shares, self.controls, strict=True)) / total
        return x, y, shares

    # ---- in detail ---------------------------------------------------------------------------------------------------
    def _sample(self) -> PolylinePath:
        polygon = sum(hypot(b.x - a.x, b.y - a.y) for a, b in itertools.pairwise(self.controls))
        steps = min(int(1 + polygon / SAMPLE), MOST_SAMPLES)
        step = self.knots[-1] / steps
        self._parameters = [i * step for i in range(steps + 1)]
        samples = [self.point(t) for t in self._parameters]
        delta = min(_TANGENT_STEP, step)
        beside = [self.point(t + delta if i < steps else t - delta) for i, t in enumerate(self._parameters)]
        times = self._times([shares for _, _, shares in beside])
        corners = [
            Corner(x, y, heading=self._heading(i, x, y, step, steps), time=time)
            for i, ((x, y, _), time) in enumerate(zip(samples, times, strict=True))
        ]
        return PolylinePath(corners, follow=True)

    def _heading(self, i: int, x: float, y: float, step: float, steps: int) -> float:
        delta = min(_TANGENT_STEP, step)
        forward = i < steps
        u, v, _ = self.point(self._parameters[i] + (delta if forward else -delta))
        dx, dy = (u - x, v - y) if forward else (x - u, y - v)
        if hypot(dx, dy) < EPSILON:
            u, v, _ = self.point(self._parameters[i] + (step if forward else -step))
            dx, dy = (u - x, v - y) if forward else (x - u, y - v)
        return wrap(atan2(dy, dx))

    def _times(self, shares: Sequence[Sequence[float]]) -> list[float]:
        """Times of the samples: those of the control points where each weighs most, evenly in between."""
        count = len(self.controls)
        weights = [[row[i] for row in shares] for i in range(count)]
        peak_parameters = [self._parameters[weight.index(max(weight))] for weight in weights]
        times, k = [], 0
        for parameter in self._parameters:
            while k < count - 2 and parameter >= peak_parameters[k + 1]:
                k += 1
            span = peak_parameters[k + 1] - peak_parameters[k]
            share = (parameter - peak_parameters[k]) / span if span > 0.0 else 1.0
            a, b = self.controls[k].time, self.controls[k + 1].time
            times.append(a + share * (b - a))
        return times


def clamped_knots(count: int, order: int) -> tuple[float, ...]:
    """Even knots from 0 to 1 that make the curve begin and end in its first and last control point."""
    inner = max(count + 1 - order, 1)
    return tuple(min(max((i + 1 - order) / inner, 0.0), 1.0) for i in range(count + order))


def basis(t: float, order: int, knots: Sequence[float]) -> list[float]:
    """All B-spline basis functions of an order at a parameter, by the recursion of Cox and de Boor."""
    row = [1.0 if a <= t < b else 0.0 for a, b in itertools.pairwise(knots)]
    for k in range(2, order + 1):
        row = [
            _ratio(t - knots[i], knots[i + k - 1] - knots[i]) * row[i]
            + _ratio(knots[i + k] - t, knots[i + k] - knots[i + 1]) * row[i + 1]
            for i in range(len(knots) - k)
        ]
    return row


def _ratio(part: float, whole: float) -> float:
    return part / whole if whole > 0.0 else 0.0
