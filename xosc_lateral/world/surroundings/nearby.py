"""Which vehicles come near each other at all: the index that spares looking at every pair of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray

BLOCK = 64
"""Rows that one box around a vehicle's path covers: 1.3 s at 50 Hz, 40 m on a motorway. [-]"""


def pairs_within(x: Iterable[FloatArray], y: Iterable[FloatArray], reach: float) -> list[tuple[int, int]]:
    """`stretches_within` over all rows at once."""
    return sorted({pair for _, pairs in stretches_within(x, y, reach) for pair in pairs})


def stretches_within(
    x: Iterable[FloatArray], y: Iterable[FloatArray], reach: float, blocks: int = 16
) -> Iterator[tuple[slice, list[tuple[int, int]]]]:
    """Pairs of points that may come within `reach` of each other, stretch by stretch; none that do is missing.

    The boxes around both paths, in blocks of rows, are swept along the longer side of the traffic: the work grows with
    the pairs that are near, not with all there are.

    Parameters
    ----------
    x, y : iterables of array, shape (n,)
        One pair of arrays per point, on one time grid; NaN where it is absent; each is looked at once. [m]
    reach : float
        [m]
    blocks : int
        Of `BLOCK` rows, in a stretch.

    Yields
    ------
    slice, list of (int, int)
        Rows of a stretch with pairs; indices of these, the smaller one first, in lexical order.
    """
    lows, highs = _bounds(x, y)
    for begin in range(0, lows.shape[1], blocks):
        low, high = lows[:, begin : begin + blocks], highs[:, begin : begin + blocks]
        block, there = np.nonzero(np.isfinite(low).all(axis=0))
        if len(there) > 1:
            first, second = _overlapping(low[:, block, there], high[:, block, there], there, reach, block)
            if len(first):
                pairs = set(zip(first.tolist(), second.tolist(), strict=True))
                yield slice(BLOCK * begin, BLOCK * (begin + blocks)), sorted(pairs)


def pairs_now(x: FloatArray, y: FloatArray, reach: float) -> tuple[IntArray, IntArray]:
    """Pairs of points, shape (n,) each [m], within `reach` [m] of each other along both axes; indices, shape (pairs,).

    The smaller index comes first.
    """
    there = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    points = np.stack([x[there], y[there]])
    return _overlapping(points, points, there, reach) if len(there) else (there, there)


def _bounds(x: Iterable[FloatArray], y: Iterable[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest x and y of each point in each block of rows, shape (2, blocks, points) each. [m]

    NaN where a point is absent throughout.
    """
    lows, highs = [np.empty((2, 0))], [np.empty((2, 0))]
    for point in zip(x, y, strict=True):
        starts = np.arange(0, len(point[0]), BLOCK)
        for extremes, ufunc in ((lows, np.fmin), (highs, np.fmax)):  # they pass over NaN
            extremes.append(np.stack([ufunc.reduceat(values, starts) for values in point]))
    low, high = (np.stack(extremes[1:] or extremes, axis=-1) for extremes in (lows, highs))
    return low, high


def _overlapping(
    low: FloatArray, high: FloatArray, names: IntArray, reach: float, block: IntArray | None = None
) -> tuple[IntArray, IntArray]:
    """Pairs of boxes that are within reach of each other, the smaller name first, shape (pairs,) each.

    Boxes of other blocks are none: they lie far away on the axis that is swept, shape (n,).
    """
    axis = int(np.argmax(high.max(axis=1) - low.min(axis=1)))
    begin, end = low[axis], high[axis] + reach
    if block is not None:
        apart = block * (float(end.max()) - float(begin.min()) + 1.0)
        begin, end = begin + apart, end + apart
    order = np.argsort(begin, kind="stable")
    ends = np.searchsorted(begin[order], end[order], side="right")
    counts = np.maximum(ends - np.arange(len(order)) - 1, 0)
    first = np.repeat(np.arange(len(order)), counts)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(counts) - counts, counts)
    left, right = order[first], order[second]
    other = 1 - axis
    near = (low[other, right] <= high[other, left] + reach) & (low[other, left] <= high[other, right] + reach)
    left, right = names[left[near]], names[right[near]]
    return np.minimum(left, right), np.maximum(left, right)
