"""Piecewise cubic functions of s, one at a time in plain floats: lane edges, elevation, superelevation.

References
----------
.. [1] ASAM OpenDRIVE 1.8, sections 10.5.1 and 11.6.1: a + b ds + c ds^2 + d ds^3, valid until the next record begins.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence

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
