"""A whole drive's samples as dense as a stream gives them, all at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drivers.model.linear_filters import extrapolate, piece

FloatArray = NDArray[np.float64]


def upsample(offsets: FloatArray, factor: int) -> FloatArray:
    """Offsets `factor` times as dense, from the first sample to the last.

    Parameters
    ----------
    offsets : array, shape (n,)
        At the model's step. [m]
    factor : int
        Steps per model step, >= 1.

    Returns
    -------
    array, shape ((n - 1) * factor + 1,)
        Row ``k * factor`` is sample k, bit by bit. Past both ends the samples are taken to go on in a straight line.
    """
    offsets = np.asarray(offsets, dtype=np.float64)
    if factor < 1:
        raise ValueError(f"{factor} steps per model step, at least 1")
    if factor == 1 or len(offsets) < 2:
        return offsets.copy()
    first, last = extrapolate(offsets[1], offsets[0]), extrapolate(offsets[-2], offsets[-1])
    padded = np.concatenate([[first], offsets, [last]])
    share = np.arange(factor) / factor
    c0, c1, c2, c3, c4, c5 = piece(padded[:-3, None], padded[1:-2, None], padded[2:-1, None], padded[3:, None])
    dense = c0 + share * (c1 + share * (c2 + share * (c3 + share * (c4 + share * c5))))
    return np.append(dense.ravel(), offsets[-1])
