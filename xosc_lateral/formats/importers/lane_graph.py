"""Lanes laid out side by side and end to end, so that who is ahead and beside follows from numbers alone."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class LaneGraph:
    """Pieces of lanes and how they hang together.

    Parameters
    ----------
    length : array, shape (n,)
        Of each piece, along the road. [m]
    left : array of int, shape (n,)
        Piece beside it on the left that is driven the same way; -1: none.
    following : sequence of sequences of int
        Pieces that it leads to.
    """

    length: FloatArray
    left: IntArray
    following: Sequence[Sequence[int]]

    def layout(self) -> tuple[IntArray, FloatArray, IntArray]:
        """Part of the network, way along it to the piece's start [m], and rank (growing to the left) of each piece.

        Breadth first from the first piece of each part. Where ways meet that are of different length, as in a ring or
        beyond a junction, the first one found counts; pieces that come to lie on one another there (two ways into one
        place of a layout) get parts of their own.
        """
        n = len(self.length)
        part, station, rank = np.full(n, -1), np.zeros(n), np.zeros(n, dtype=np.int64)
        steps = self._steps()
        taken: dict[tuple[int, int], list[tuple[float, float]]] = {}
        count = 0
        for first in range(n):
            if part[first] >= 0:
                continue
            waiting = deque([(first, 0.0, 0)])
            while waiting:
                piece, at, level = waiting.popleft()
                if part[piece] >= 0 or _overlaps(taken.get((count, level), []), at, at + self.length[piece]):
                    continue
                part[piece], station[piece], rank[piece] = count, at, level
                taken.setdefault((count, level), []).append((at, at + float(self.length[piece])))
                for other, side, where in steps[piece]:
                    ahead = {0: 0.0, 1: float(self.length[piece]), -1: -float(self.length[other])}[where]
                    waiting.append((other, at + ahead, level + side))
            count += 1
        return part, station, rank

    def _steps(self) -> list[list[tuple[int, int, int]]]:
        """From each piece to the pieces about it: (piece, lanes to the left, +1 ahead or -1 behind)."""
        steps: list[list[tuple[int, int, int]]] = [[] for _ in self.length]
        for piece, left in enumerate(self.left):
            if left >= 0:
                steps[piece].append((int(left), 1, 0))
                steps[int(left)].append((piece, -1, 0))
        for piece, after in enumerate(self.following):
            for other in after:
                steps[piece].append((other, 0, 1))
                steps[other].append((piece, 0, -1))
        return steps


def _overlaps(spans: Sequence[tuple[float, float]], low: float, high: float) -> bool:
    return any(low < end - 1e-3 and high > begin + 1e-3 for begin, end in spans)
