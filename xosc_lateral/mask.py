"""Where a mask is True."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def true_slices(mask: NDArray[np.bool_]) -> list[slice]:
    """The longest slices in which a mask is True throughout, in order.

    Parameters
    ----------
    mask : array of bool, shape (n,)
    """
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [slice(first, stop) for first, stop in edges.reshape(-1, 2).tolist()]
