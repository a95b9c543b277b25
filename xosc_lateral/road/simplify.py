"""Polylines with as few points as a tolerance allows."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def simplify(x: NDArray[np.float64], y: NDArray[np.float64], tolerance: float) -> NDArray[np.int64]:
    """Points of a polyline to keep so that no other one is farther off than `tolerance` (Douglas and Peucker 1973).

    Parameters
    ----------
    x, y : array, shape (n,)
        [m]
    tolerance : float
        [m]

    Returns
    -------
    array of int, shape (m,)
        Indices, first and last included.
    """
    kept = {0, len(x) - 1}
    todo = [(0, len(x) - 1)]
    while todo:
        first, last = todo.pop()
        if last - first < 2:
            continue
        along_x, along_y = x[last] - x[first], y[last] - y[first]
        inner = slice(first + 1, last)
        from_x, from_y = x[inner] - x[first], y[inner] - y[first]
        length = np.hypot(along_x, along_y)
        off = np.abs(along_x * from_y - along_y * from_x) / length if length > 0.0 else np.hypot(from_x, from_y)
        farthest = int(np.argmax(off))
        if off[farthest] > tolerance:
            middle = first + 1 + farthest
            kept.add(middle)
            todo += [(first, middle), (middle, last)]
    return np.array(sorted(kept), dtype=np.int64)
