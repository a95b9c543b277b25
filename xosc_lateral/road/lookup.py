"""Find the piece of many owners (roads, lanes) that holds at s, for arrays of places."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.road.positions import FloatArray, IntArray

IndexLike = int | IntArray


class Lookup:
    """Pieces of several owners, each owner's sorted by start.

    All starts lie on one axis, owner behind owner, so that one `searchsorted` finds any mixture of owners; the result
    is then put right where rounding on that long axis moved it over a start.

    Parameters
    ----------
    starts : sequence of sequences of float
        Per owner the starts of its pieces, at least one. [m]
    """

    def __init__(self, starts: Sequence[Sequence[float]]) -> None:
        """Lay the owners out one behind the other."""
        counts = np.array([len(owner) for owner in starts], dtype=np.int64)
        self.starts: FloatArray = np.array([s for owner in starts for s in owner], dtype=np.float64)
        last = np.cumsum(counts)
        self.first = (last - counts).astype(np.int32)
        self._last = (last - 1).astype(np.int32)
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
            found = np.searchsorted(self.starts[first + 1 : last + 1], s, side="right")
            return np.asarray(found + first, dtype=np.int32)
        return self._of_many(owner, s)

    def _of_many(self, owner: IntArray, s: FloatArray) -> IntArray:
        """The same for an owner per point, shape of both."""
        # s beyond an owner's ends must not reach its neighbours on the axis
        key = np.minimum(np.maximum(s, self._begin[owner]), self._reach[owner]) + self._shift[owner]
        piece = np.searchsorted(self._keys, key, side="right").astype(np.int32) - 1
        first_, last_ = self.first[owner], self._last[owner]
        piece = np.minimum(np.maximum(piece, first_), last_)
        while (down := (s < self.starts[piece]) & (piece > first_)).any():
            piece -= down
        while (up := (s >= self.starts[np.minimum(piece + 1, last_)]) & (piece < last_)).any():
            piece += up
        return np.asarray(piece, dtype=np.int32)
