"""Clothoids and clothoid splines: curvature changes evenly with length on each piece."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import accumulate
from math import nan, pi

from xosc_lateral.world.player.angles import wrap
from xosc_lateral.world.player.paths.base import Path, PathPoint
from xosc_lateral.world.road.geometry import Spiral


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
    """Clothoid pieces one after another.

    `pieces`: at least one; `end_time`: [s]; NaN without times.
    """

    def __init__(self, pieces: Sequence[TimedClothoid], end_time: float = nan) -> None:
        lengths = accumulate((piece.length for piece in pieces), initial=0.0)
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
