"""Clothoids and clothoid splines: curvature changes evenly with length on each piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import nan, pi

from xosc_lateral.playback.angles import wrap
from xosc_lateral.playback.paths.base import PathPoint
from xosc_lateral.road.geometry import Spiral


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


class ClothoidPath:
    """Clothoid pieces one after another.

    `pieces`: at least one; `end_time`: [s]; NaN without times.
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
