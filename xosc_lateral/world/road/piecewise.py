"""Piecewise cubic functions of s, one at a time in plain floats: lane edges, elevation, superelevation.

References
----------
.. [1] ASAM OpenDRIVE 1.8, sections 10.5.1 and 11.6.1: a + b ds + c ds^2 + d ds^3, valid until the next record begins.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from math import asin, atan, cos, sin, sqrt, tan
from typing import TypeVar

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray

Cubic = tuple[float, float, float, float]
"""a, b, c, d of a + b ds + c ds^2 + d ds^3."""

ZERO: Cubic = (0.0, 0.0, 0.0, 0.0)


def shift(cubic: Cubic, ds: float) -> Cubic:
    """The same cubic about a point `ds` further on (Taylor). `ds` in [m]."""
    if ds == 0.0:
        return cubic
    a, b, c, d = cubic
    return (a + ds * (b + ds * (c + ds * d)), b + ds * (2.0 * c + ds * 3.0 * d), c + 3.0 * d * ds, d)


class PiecewiseCubic(Struct, frozen=True):
    """A function of s that is one cubic from each start to the next, about that start."""

    starts: tuple[float, ...]  # increasing s; the first piece also holds before, the last one to infinity [m]
    cubics: tuple[Cubic, ...]

    @classmethod
    def from_records(
        cls, records: Iterable[tuple[float, Cubic]], *, begin: float, before: Cubic = ZERO
    ) -> PiecewiseCubic:
        """From (s, cubic) records in any order; of two at the same s [m] the later; before the first: `before`."""
        ordered = dict(sorted(records, key=lambda record: record[0]))
        if not ordered or min(ordered) > begin:
            ordered = {begin: before, **ordered}
        return cls(tuple(ordered), tuple(ordered.values()))

    @property
    def is_zero(self) -> bool:
        """Whether the function vanishes everywhere."""
        return not any(any(cubic) for cubic in self.cubics)

    def at(self, s: float) -> float:
        """Value at s. s in [m]."""
        i = bisect_right(self.starts, s) - 1
        if i < 0:
            i = 0
        a, b, c, d = self.cubics[i]
        s -= self.starts[i]
        return a + s * (b + s * (c + s * d))

    def with_slope_at(self, s: float) -> tuple[float, float]:
        """Value and derivative at s. s in [m]."""
        i = bisect_right(self.starts, s) - 1
        if i < 0:
            i = 0
        a, b, c, d = self.cubics[i]
        s -= self.starts[i]
        return a + s * (b + s * (c + s * d)), b + s * (2.0 * c + 3.0 * s * d)

    def cubic_at(self, s: float) -> Cubic:
        """The cubic that holds at s, about s. s in [m]."""
        i = max(bisect_right(self.starts, s) - 1, 0)
        return shift(self.cubics[i], s - self.starts[i])

    def restricted(self, begin: float, end: float) -> PiecewiseCubic:
        """The same function with pieces for [begin, end) only. Bounds in [m]."""
        starts = (begin, *(s for s in self.starts if begin < s < end))
        return PiecewiseCubic(starts, tuple(self.cubic_at(s) for s in starts))

    def plus(self, other: PiecewiseCubic, factor: float = 1.0) -> PiecewiseCubic:
        """``self + factor * other``, with the breakpoints of both. `factor` [-]."""
        starts = tuple(sorted({*self.starts, *other.starts}))
        cubics = []
        for s in starts:
            (a, b, c, d), (e, f, g, h) = self.cubic_at(s), other.cubic_at(s)
            cubics.append((a + factor * e, b + factor * f, c + factor * g, d + factor * h))
        return PiecewiseCubic(starts, tuple(cubics))


IndexLike = int | NDArray[np.integer]
"""What arrays are gathered by is best of the platform's own kind (`intp`): others are copied into it each time."""


class Lookup:
    """Pieces of several owners, each owner's sorted by start.

    All starts lie on one axis, owner behind owner, so that one `searchsorted` finds any mixture of owners; the result
    is then put right where rounding on that long axis moved it over a start.
    `starts`: per owner the starts of its pieces, at least one. [m]
    """

    def __init__(self, starts: Sequence[Sequence[float]]) -> None:
        counts = np.array([len(owner) for owner in starts], dtype=np.int64)
        self.starts: FloatArray = np.array([s for owner in starts for s in owner], dtype=np.float64)
        last = np.cumsum(counts)
        self.first = last - counts
        self._last = last - 1
        self._single = bool((counts == 1).all())
        begin, end = self.starts[self.first], self.starts[self._last]
        base = np.concatenate([[0.0], np.cumsum(end - begin + 2.0)[:-1]])
        self._shift = base - begin
        self._reach = end + 1.0
        self._begin = begin
        self._keys = self.starts + np.repeat(self._shift, counts)

    def find(self, owner: IndexLike, s: FloatArray) -> IndexLike:
        """Index of the piece that holds at s; before an owner's first start its first piece. Shape as `s` [m]."""
        if self._single:
            return int(self.first[owner]) if isinstance(owner, int) else self.first[owner]
        if isinstance(owner, int):
            first, last = int(self.first[owner]), int(self._last[owner])
            if first == last:
                return first
            piece = np.searchsorted(self.starts[first + 1 : last + 1], s, side="right")
            return np.asarray(piece + first)
        return self._of_many(owner, s)

    def _of_many(self, owner: NDArray[np.integer], s: FloatArray) -> NDArray[np.intp]:
        """The same for an owner per point, shape of both."""
        # s beyond an owner's ends must not reach its neighbours on the axis
        key = np.minimum(np.maximum(s, self._begin[owner]), self._reach[owner]) + self._shift[owner]
        piece = np.searchsorted(self._keys, key, side="right") - 1
        first_, last_ = self.first[owner], self._last[owner]
        piece = np.minimum(np.maximum(piece, first_), last_)
        while (down := (s < self.starts[piece]) & (piece > first_)).any():
            piece -= down
        while (up := (s >= self.starts[np.minimum(piece + 1, last_)]) & (piece < last_)).any():
            piece += up
        return np.asarray(piece)


# ---- the road surface: height over (s, t), and how it leans ----
GRADE_STEP = 1e-3
"""Step of differences of the grade. [m]"""


class Shape(Struct, frozen=True):
    """Lateral profile over t at a few stations (``lateralProfile/shape``), linear in s between them."""

    stations: tuple[float, ...]  # increasing s [m]
    profiles: tuple[PiecewiseCubic, ...]  # height over t at each station [m]

    def at(self, s: float, t: float) -> tuple[float, float, float]:
        """Height, its slope along s, its slope along t. [m], [-], [-]"""
        i = bisect_right(self.stations, s) - 1
        if i < 0 or i == len(self.stations) - 1:
            height, across = self.profiles[max(i, 0)].with_slope_at(t)
            return height, 0.0, across
        length = self.stations[i + 1] - self.stations[i]
        weight = (s - self.stations[i]) / length
        (before, before_slope), (after, after_slope) = (self.profiles[j].with_slope_at(t) for j in (i, i + 1))
        return (
            before + weight * (after - before),
            (after - before) / length,
            before_slope + weight * (after_slope - before_slope),
        )


class Surface(Struct, frozen=True):
    """Elevation and lean of one road."""

    elevation: PiecewiseCubic  # z of the reference line over s [m]
    superelevation: PiecewiseCubic  # roll about it, positive: the road falls to the right along s [rad]
    # OpenDRIVE 1.4: angle of the surface left and right of the reference line, positive falling outwards [rad]
    crossfall: tuple[PiecewiseCubic, PiecewiseCubic] | None = None
    shape: Shape | None = None  # height over t on top of all that

    @property
    def is_flat(self) -> bool:
        """Whether z is 0 all over the road."""
        return self.elevation.is_zero and self.is_level

    @property
    def is_level(self) -> bool:
        """Whether the road leans nowhere."""
        return self.superelevation.is_zero and self.crossfall is None and self.shape is None

    def at(self, s: float, t: float) -> tuple[float, float, float, float, float, float]:
        """Height, pitch, roll, how t shrinks seen from above, how far +s at this t turns aside, and how far t leads.

        `t` is measured in the leaning surface (OpenDRIVE 8.3), so that x, y lie t * cos(superelevation) off. On a
        grade, the surface leans about the climbing line: t then leads along s, too (`lead_at`). Where the lean changes
        along s, the line of constant t climbs and drifts: its tangent is (1, drift, climb).
        """
        height, grade = self.elevation.with_slope_at(s)
        angle, twist = self.superelevation.with_slope_at(s)
        climb, drift, shrink, lead, onward = grade, 0.0, 1.0, 0.0, 1.0
        if angle != 0.0 or twist != 0.0:
            shrink, rise = cos(angle), sin(angle)
            level = 1.0 / sqrt(1.0 + grade * grade)
            steep, bend = grade * level, self._bend_at(s) * level * level
            height += t * rise * level
            lead = -t * rise * steep
            climb += t * (shrink * twist * level - rise * steep * bend)
            onward -= t * (shrink * twist * steep + rise * level * bend)
            drift = -t * rise * twist / onward
        if self.crossfall is not None or self.shape is not None:
            lift, lift_along, lean = self.profile_at(s, t)
            height, climb, angle = height + lift, climb + lift_along, angle + atan(lean)
        climb /= onward
        pitch = -atan(climb / sqrt(1.0 + drift * drift)) if drift else -atan(climb)
        roll = angle
        if climb != grade and angle:
            # the lateral axis stays (0, cos, sin) of the lean while the forward axis pitches by more than the grade
            roll = asin(min(max(sin(angle) * cos(atan(grade)) / cos(pitch), -1.0), 1.0))
        return height, pitch, roll, shrink, drift, lead

    def _bend_at(self, s: float) -> float:
        """Change of the grade along s: the slope is a parabola, whose central difference is exact. [1/m]"""
        if self.elevation.is_zero:
            return 0.0
        ahead, behind = (self.elevation.with_slope_at(s + ds)[1] for ds in (GRADE_STEP, -GRADE_STEP))
        return (ahead - behind) / (2.0 * GRADE_STEP)

    def lead_at(self, s: float, across: float) -> float:
        """How far along s a place lies from the foot of its s, `across` the line seen from above. [m]"""
        angle, grade = self.superelevation.at(s), self.elevation.with_slope_at(s)[1]
        return -across * tan(angle) * grade / sqrt(1.0 + grade * grade) if angle and grade else 0.0

    def profile_at(self, s: float, t: float) -> tuple[float, float, float]:
        """What crossfall and shape add: height, its slope along s, its slope along t. [m], [-], [-]"""
        height = along = lean = 0.0
        if self.crossfall is not None:
            fall, fall_slope = self.crossfall[0 if t >= 0.0 else 1].with_slope_at(s)
            height -= abs(t) * fall
            along -= abs(t) * fall_slope
            lean -= fall if t >= 0.0 else -fall
        if self.shape is not None:
            lift, lift_along, lift_across = self.shape.at(s, t)
            height, along, lean = height + lift, along + lift_along, lean + lift_across
        return height, along, lean


Place = TypeVar("Place", float, NDArray[np.float64])


class HeaderOffset(Struct, frozen=True):
    """From the coordinates that road and scenario are written in to the inertial frame.

    First moved, then turned about the inertial origin (OpenDRIVE 1.7, 8.2). Everything is worked out in the coordinates
    of the file, in which numbers are small; what leaves the program as a world position goes through here.
    """

    x: float = 0.0  # x, y, z: [m]
    y: float = 0.0
    z: float = 0.0
    heading: float = 0.0  # [rad]

    def __bool__(self) -> bool:
        """Whether it moves anything."""
        return (self.x, self.y, self.z, self.heading) != (0.0, 0.0, 0.0, 0.0)

    def apply(
        self, x: FloatArray, y: FloatArray, z: FloatArray, heading: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Inertial x, y, z [m] and heading from 0 to 2 pi [rad] of places in the file's coordinates, shape (n,)."""
        c, s = cos(self.heading), sin(self.heading)
        x, y = x + self.x, y + self.y
        return c * x - s * y, s * x + c * y, z + self.z, (heading + self.heading) % (2.0 * np.pi)

    def undo(self, x: Place, y: Place) -> tuple[Place, Place]:
        """Coordinates of the file of an inertial place, or of several. [m]"""
        x, y = self.turned_back(x, y)
        return x - self.x, y - self.y

    def turned_back(self, dx: Place, dy: Place) -> tuple[Place, Place]:
        """An inertial direction along the axes of the file. [m]"""
        c, s = cos(self.heading), sin(self.heading)
        return c * dx + s * dy, c * dy - s * dx
