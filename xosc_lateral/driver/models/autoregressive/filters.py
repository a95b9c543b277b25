"""The border between coarse and fine movement: one low-pass to measure by, one to build by.

References
----------
.. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE ISCAS 1974.
.. [2] R. E. Crochiere, L. R. Rabiner, "Multirate Digital Signal Processing", 1983: interpolation phase by phase.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.jit_kernel import JitKernel, worth_compiling
from xosc_lateral.drives.filters import filtered, low_pass

FloatArray = NDArray[np.float64]

BORDER = 0.4
"""Slower movement is coarse: what a driver steers, while sensor and vehicle add the rest. [Hz]"""

HALF_LENGTH = 4.0
"""Of the measuring low-pass. [s]"""

MEASURING_WINDOW = 6.0
"""Kaiser shape of the measuring low-pass: 63 dB, so that noise five decades below the slow movement stays apart. [-]"""

BUILDING_WINDOW = 7.0
"""Kaiser shape of the building low-pass: images of slow movement are 75 dB down. [-]"""

COARSE_EVERY = 5
"""Steps of the 5 Hz grid per step of the coarse movement: 1 Hz holds all below 0.5 Hz. [-]"""

TICKS = 4
"""The building low-pass reaches so many coarse steps to each side, and a little. [-]"""


@lru_cache(maxsize=8)
def measuring_low_pass(step: float) -> FloatArray:
    """Symmetric kernel of gain 1, shape (2 * half + 1,) [-], that keeps what is slower than `BORDER`; `step` in [s]."""
    half = round(HALF_LENGTH / step)
    return _frozen(low_pass(half, 2.0 * BORDER * step, MEASURING_WINDOW))


@lru_cache(maxsize=1)
def building_low_pass() -> FloatArray:
    """Kernel that makes `COARSE_EVERY` samples of one coarse value; images of slow movement are 75 dB down.

    Symmetric, shape (2 * COARSE_EVERY * (TICKS + 1) - 1,) [-], gain COARSE_EVERY: each sample's weights sum to about 1.
    """
    half = COARSE_EVERY * (TICKS + 1) - 1
    return _frozen(low_pass(half, 1.0 / COARSE_EVERY, BUILDING_WINDOW) * COARSE_EVERY)


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
    """Part slower and part faster than `BORDER`, in unit and shape (n,) of `values`; `step` in [s].

    Past their ends the values go on mirrored in a point.
    """
    kernel = measuring_low_pass(step)
    slow = filtered(values, kernel)
    return slow, values - slow


def interpolate(steps: FloatArray) -> FloatArray:
    """Coarse steps at 1 Hz as 5 Hz values.

    Parameters
    ----------
    steps : array, shape (n + 2 TICKS + 1, k)
        [any unit]

    Returns
    -------
    array, shape (n * COARSE_EVERY, k)
        In the same unit.
    """
    table, paths = phases(), steps.shape[1]
    n = len(steps) - len(table) + 1
    if paths == 1 and worth_compiling(n):
        result = np.empty(n * COARSE_EVERY)
        _interpolate_compiled()(steps.ravel(), table, result)
        return result[:, None]
    blocks = steps[:n, None] * table[0][:, None]
    for k in range(1, len(table)):
        blocks += steps[k : k + n, None] * table[k][:, None]
    return np.asarray(blocks.reshape(-1, paths))


def _interpolate_body(steps, table, result):  # type: ignore[no-untyped-def]
    width, every = table.shape
    block = 512
    out = np.empty(block)
    for first in range(0, len(steps) - width + 1, block):
        n = min(block, len(steps) - width + 1 - first)
        for p in range(every):
            at = steps[first : first + n]
            for i in range(n):
                out[i] = at[i] * table[0, p]
            for k in range(1, width):
                weight = table[k, p]
                at = steps[first + k : first + k + n]
                for i in range(n):
                    out[i] += at[i] * weight
            for i in range(n):
                result[(first + i) * every + p] = out[i]


_interpolate_compiled = JitKernel(_interpolate_body).compiled


def _frozen(values: FloatArray) -> FloatArray:
    array = np.ascontiguousarray(values)
    array.flags.writeable = False
    return array
