"""The border between coarse and fine movement: one low-pass to measure by, one to build by."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

BORDER = 0.4
"""Slower movement is coarse: what a driver steers, while sensor and vehicle add the rest. [Hz]"""

HALF_LENGTH = 4.0
"""Of the measuring low-pass. [s]"""

COARSE_EVERY = 5
"""Steps of the 5 Hz grid per step of the coarse movement: 1 Hz holds all below 0.5 Hz. [-]"""

TICKS = 4
"""The building low-pass reaches so many coarse steps to each side, and a little. [-]"""


@lru_cache(maxsize=8)
def measuring_low_pass(step: float) -> FloatArray:
    """Symmetric kernel of gain 1 that keeps what is slower than `BORDER`, on a grid of the given step [s]."""
    half = round(HALF_LENGTH / step)
    kernel = np.sinc(2.0 * BORDER * step * np.arange(-half, half + 1)) * np.kaiser(2 * half + 1, 6.0)
    return _frozen(kernel / kernel.sum())


@lru_cache(maxsize=1)
def building_low_pass() -> FloatArray:
    """Kernel that makes `COARSE_EVERY` samples of one coarse value; images of slow movement are 75 dB down.

    Symmetric, shape (2 * COARSE_EVERY * (TICKS + 1) - 1,), gain COARSE_EVERY: each sample's weights sum to about 1.
    """
    half = COARSE_EVERY * (TICKS + 1) - 1
    kernel = np.sinc(np.arange(-half, half + 1) / COARSE_EVERY) * np.kaiser(2 * half + 1, 7.0)
    return _frozen(kernel / kernel.sum() * COARSE_EVERY)


@lru_cache(maxsize=1)
def phases() -> FloatArray:
    """The building low-pass by phase, shape (2 * TICKS + 2, COARSE_EVERY).

    Sample p after coarse value j is the sum over k of ``phases[k, p] * coarse[j - TICKS + k]``.
    """
    kernel = building_low_pass()
    half = len(kernel) // 2
    table = np.zeros((2 * TICKS + 2, COARSE_EVERY))
    for k in range(2 * TICKS + 2):
        for p in range(COARSE_EVERY):
            at = half + p - COARSE_EVERY * (k - TICKS)
            if 0 <= at < len(kernel):
                table[k, p] = kernel[at]
    return _frozen(table / table.sum(axis=0))  # a level stays a level in every phase


def split_bands(values: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Part slower and part faster than `BORDER`, shape of `values`, which go on mirrored in a point past their ends."""
    kernel = measuring_low_pass(step)
    half = len(kernel) // 2
    reach = min(half, len(values) - 1)
    before, after = 2 * values[0] - values[reach:0:-1], 2 * values[-1] - values[-2 : -reach - 2 : -1]
    extended = np.pad(np.concatenate([before, values, after]), half - reach, mode="edge")
    slow = np.convolve(extended, kernel, "valid")
    return slow, values - slow


def _frozen(values: FloatArray) -> FloatArray:
    array = np.ascontiguousarray(values)
    array.flags.writeable = False
    return array
