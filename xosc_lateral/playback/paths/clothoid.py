"""Clothoids and clothoid splines: curvature changes evenly with length on each piece.

References
----------
.. [1] M. Abramowitz, I. A. Stegun, "Handbook of Mathematical Functions", 1964, table 25.4: Gauss-Legendre nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, nan, pi, sin

from xosc_lateral.playback.angles import wrap
from xosc_lateral.playback.paths.base import PathPoint

_GAUSS = (
    (-0.9061798459386640, 0.2369268850561891),
    (-0.5384693101056831, 0.4786286704993665),
    (0.0, 0.5688888888888889),
    (0.5384693101056831, 0.4786286704993665),
    (0.9061798459386640, 0.2369268850561891),
)
"""Nodes and weights of five-point Gauss-Legendre quadrature on [-1, 1]."""

_TURN_PER_PANEL = 0.2
"""Angle over which one quadrature panel goes at most; the error then is below 1e-13 of its length. [rad]"""


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

    def at(self, s: float) -> tuple[float, float, float]:
        """x, y, heading at a length: the integral of (cos, sin) of the heading."""
        rate = (self.end_curvature - self.curvature) / self.length if self.length > 0.0 else 0.0

        def heading_at(u: float) -> float:
            return self.heading + u * (self.curvature + 0.5 * rate * u)

        turn = max(abs(self.curvature), abs(self.end_curvature)) * s
        panels = int(turn / _TURN_PER_PANEL) + 1
        half = 0.5 * s / panels
        x, y = self.x, self.y
        for panel in range(panels):
            middle = (2 * panel + 1) * half
            for node, weight in _GAUSS:
                heading = heading_at(middle + half * node)
                x += half * weight * cos(heading)
                y += half * weight * sin(heading)
        return x, y, heading_at(s) % (2.0 * pi)


class ClothoidPath:
    """Clothoid pieces one after another.

    Parameters
    ----------
    pieces : sequence of TimedClothoid
        At least one.
    end_time : float
        [s]; NaN without times.
    """

    def __init__(self, pieces: Sequence[TimedClothoid], end_time: float = nan) -> None:
        self.pieces = tuple(pieces)
        self.length = sum(piece.length for piece in pieces)
        self.start_time = pieces[0].start_time
        self.end_time = end_time

    def at(self, s: float) -> PathPoint:
        """The point at a length; beyond the ends, the ends."""
        left = min(max(s, 0.0), self.length)
        for piece in self.pieces:
            if left <= piece.length or piece is self.pieces[-1]:
                x, y, heading = piece.at(min(left, piece.length))
                return PathPoint(x, y, nan, wrap(heading), nan, nan, wrap(heading))
            left -= piece.length
        raise AssertionError("a clothoid path has pieces")

    def s_at(self, time: float) -> float:
        """Length at a time, evenly on each piece; beyond its times, the end."""
        if not self.start_time <= time <= self.end_time:
            return 0.0 if time < self.start_time else self.length
        before = 0.0
        for piece, end in zip(self.pieces, self._piece_ends(), strict=True):
            if time < end or piece is self.pieces[-1]:
                duration = end - piece.start_time
                share = (time - piece.start_time) / duration if duration > 0.0 else 1.0
                return before + share * piece.length
            before += piece.length
        return self.length

    def time_at(self, s: float) -> float:
        """Time at a length, evenly on each piece. [s]"""
        before = 0.0
        for piece, end in zip(self.pieces, self._piece_ends(), strict=True):
            if s < before + piece.length or piece is self.pieces[-1]:
                share = min((s - before) / piece.length, 1.0) if piece.length > 0.0 else 1.0
                return piece.start_time + share * (end - piece.start_time)
            before += piece.length
        raise AssertionError("a clothoid path has pieces")

    def speed_at(self, s: float) -> float:
        """Speed of the piece. [m/s]"""
        before = 0.0
        for piece, end in zip(self.pieces, self._piece_ends(), strict=True):
            if s < before + piece.length or piece is self.pieces[-1]:
                duration = end - piece.start_time
                return piece.length / duration if duration > 0.0 else 0.0
            before += piece.length
        return 0.0

    def _piece_ends(self) -> tuple[float, ...]:
        return (*(piece.start_time for piece in self.pieces[1:]), self.end_time)
