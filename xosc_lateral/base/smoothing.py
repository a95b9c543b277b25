"""Series through symmetric kernels, continued beyond their ends."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray


def filtered(values: FloatArray, kernel: FloatArray) -> FloatArray:
    """A series through a symmetric kernel, continued beyond its ends as by `mirrored`. Shape and unit of the values."""
    return np.convolve(mirrored(values, len(kernel) // 2), kernel, mode="valid")


def mirrored(values: FloatArray, rows: int) -> FloatArray:
    """A series continued by so many rows at both ends, shape (n + 2 * rows,), for a symmetric kernel. [any unit]

    Beyond each end it goes on as its mirror image through the end's point, as far as there is one, and stays there: a
    filter without delay leaves the ends, and straight lines, where they are.
    """
    near = min(rows, len(values) - 1)
    before, after = 2 * values[0] - values[near:0:-1], 2 * values[-1] - values[-2 : -near - 2 : -1]
    extended = np.concatenate([before, values, after])
    return np.pad(extended, rows - near, mode="edge") if near < rows else extended


def smoothed(values: FloatArray, width: float) -> FloatArray:
    """Gaussian smoothing, continued point-symmetrically past both ends, which stay where they are."""
    half = min(int(np.ceil(4.0 * width)), len(values) - 1)
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / width) ** 2)
    return filtered(values, kernel / kernel.sum())
