"""Which vehicles come near each other at all: the index that spares looking at every pair of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

BLOCK = 64
"""Rows that one box around a vehicle's path covers: 1.3 s at 50 Hz, 40 m on a motorway. [-]"""

BOXES = 4096
"""Boxes that are swept together: few vehicles over all of a run, or many over a block of rows. [-]"""


def pairs_within(x: Sequence[FloatArray], y: Sequence[FloatArray], reach: float) -> list[tuple[int, int]]:
    """Pairs of points that may come within `reach` of each other at some row; none that do is missing.

    The boxes around both paths, in blocks of rows, are swept along the longer side of the traffic: the work grows with
    the pairs that are near, not with all there are.

    Parameters
    ----------
    x, y : sequences of array, shape (n,)
        One pair of arrays per point, on one time grid; NaN where it is absent. [m]
    reach : float
        [m]

    Returns
    -------
    list of (int, int)
        Indices, the smaller one first, in lexical order.
    """
    if len(x) < 2 or not len(x[0]):
        return []
    (low_x, high_x), (low_y, high_y) = (_bounds(np.stack(axis)) for axis in (x, y))
    low, high = np.stack([low_x, low_y]), np.stack([high_x, high_y])
    found: set[tuple[int, int]] = set()
    together = max(1, BOXES // len(x))
    for begin in range(0, low.shape[2], together):
        part = slice(begin, begin + together)
        block, there = np.nonzero(np.isfinite(low[..., part]).all(axis=0).T)
        if len(there) > 1:
            boxes = (low[..., part][:, there, block], high[..., part][:, there, block])
            first, second = _overlapping(*boxes, there, reach, block)
            found.update(zip(first.tolist(), second.tolist(), strict=True))
    return sorted(found)


def pairs_now(x: FloatArray, y: FloatArray, reach: float) -> tuple[IntArray, IntArray]:
    """Pairs of points, shape (n,) each [m], within `reach` [m] of each other along both axes; indices, shape (pairs,).

    The smaller index comes first.
    """
    there = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    points = np.stack([x[there], y[there]])
    return _overlapping(points, points, there, reach) if len(there) else (there, there)


def _bounds(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest of each block of rows, shape (points, blocks); NaN where a point is absent throughout."""
    starts = np.arange(0, values.shape[1], BLOCK)
    low, high = (ufunc.reduceat(values, starts, axis=1) for ufunc in (np.fmin, np.fmax))  # they pass over NaN
    return np.asarray(low), np.asarray(high)


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
    one, two = order[first], order[second]
    other = 1 - axis
    near = (low[other, two] <= high[other, one] + reach) & (low[other, one] <= high[other, two] + reach)
    one, two = names[one[near]], names[two[near]]
    return np.minimum(one, two), np.maximum(one, two)
