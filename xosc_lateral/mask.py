"""Where a mask is True."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

BLOCK = 65_536
"""Rows that are worked on at a time where all of a long run would take much memory: half a megabyte each. [-]"""


def true_slices(mask: NDArray[np.bool_]) -> list[slice]:
    """The longest slices in which a mask is True throughout, in order.

    Parameters
    ----------
    mask : array of bool, shape (n,)
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [slice(first, stop) for first, stop in edges.reshape(-1, 2).tolist()]


def true_blocks(mask: NDArray[np.bool_]) -> Iterator[NDArray[np.intp]]:
    """Indices of the elements that are true, in order, from at most `BLOCK` elements at a time: bounds memory."""
    for begin in range(0, len(mask), BLOCK):
        rows = np.flatnonzero(mask[begin : begin + BLOCK]) + begin
        if len(rows):
            yield rows
