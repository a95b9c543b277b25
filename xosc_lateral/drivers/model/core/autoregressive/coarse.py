"""The border between coarse and fine movement, one low-pass to measure by and one to build by; linear prediction of the
coarse series from its past, kept stable, its spectrum known.

References
----------
.. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE ISCAS 1974.
.. [2] R. E. Crochiere, L. R. Rabiner, "Multirate Digital Signal Processing", 1983: interpolation phase by phase.
.. [3] G. E. P. Box, G. M. Jenkins, "Time Series Analysis: Forecasting and Control", 1970.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.drives.filters import filtered, low_pass
from xosc_lateral.drivers.model.linear_filters import JitKernel, worth_compiling
from xosc_lateral.drivers.model.records import Record, frozen_array, set_once

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
    return frozen_array(low_pass(half, 2.0 * BORDER * step, MEASURING_WINDOW))


@lru_cache(maxsize=1)
def building_low_pass() -> FloatArray:
    """Symmetric kernel that makes `COARSE_EVERY` samples of one coarse value, each sample's weights summing to about 1.

    Shape (2 * COARSE_EVERY * (TICKS + 1) - 1,). [-]
    """
    half = COARSE_EVERY * (TICKS + 1) - 1
    return frozen_array(low_pass(half, 1.0 / COARSE_EVERY, BUILDING_WINDOW) * COARSE_EVERY)


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
    return frozen_array(table / table.sum(axis=0))  # a level stays a level in every phase


def split_bands(values: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Part slower and part faster than `BORDER`, in unit and shape (n,) of `values`; `step` in [s].

    Past their ends the values go on mirrored in a point.
    """
    kernel = measuring_low_pass(step)
    slow = filtered(values, kernel)
    return slow, values - slow


def interpolate(steps: FloatArray) -> FloatArray:
    """Coarse steps at 1 Hz, shape (n + 2 TICKS + 1, k), as 5 Hz values, shape (n * COARSE_EVERY, k). [any unit]"""
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


MAX_ROOT = 0.995
"""Largest modulus of a root: at one step a second a memory of 200 s. [-]"""

GRID = 8192
"""Points of the spectrum that covariances are taken from: at MAX_ROOT nothing is left after so many steps."""

FREQUENCIES = np.arange(GRID // 2 + 1) / GRID
"""Of that spectrum, shape (GRID / 2 + 1,). [cycles per step]"""
FREQUENCIES.flags.writeable = False


class Autoregression(Record, frozen=True, eq=False):
    """z[t] = sum over k of coefficients[k] z[t - 1 - k] + scale * noise[t], noise white with variance 1.

    Raises `DriverProfileError` if it is not stable, or the scale is negative.
    """

    coefficients: FloatArray
    scale: float

    def __post_init__(self) -> None:
        coefficients = frozen_array(self.coefficients)
        if coefficients.ndim != 1 or not np.isfinite(coefficients).all() or not 0 <= self.scale < np.inf:
            raise DriverProfileError(f"autoregression: {coefficients.tolist()}, scale {self.scale}")
        root = largest_root(coefficients)
        if root >= 1.0:
            raise DriverProfileError(f"autoregression: a root of modulus {root:.4f} makes it unstable")
        set_once(self, coefficients=coefficients)

    @property
    def order(self) -> int:
        """Steps of memory."""
        return len(self.coefficients)

    def power(self, frequency: FloatArray) -> FloatArray:
        """Spectral density at frequencies [cycles per step], shape (n,), 0 to 0.5; white noise of variance 1 has 1."""
        lags = np.arange(1, self.order + 1)
        gain = 1.0 - np.exp(-2j * np.pi * np.outer(frequency, lags)) @ self.coefficients
        return np.asarray(self.scale**2 / np.abs(gain) ** 2)

    def covariance(self, n_lags: int) -> FloatArray:
        """Autocovariance at lags 0 to n_lags - 1 steps, shape (n_lags,), n_lags <= `GRID` / 2. [square of the unit]"""
        power = self.power(FREQUENCIES)
        return np.asarray(np.fft.irfft(power, GRID)[:n_lags])


def stabilise(coefficients: FloatArray) -> FloatArray:
    """Coefficients [-], shape (order,), whose roots lie within `MAX_ROOT`: others are pulled in radially."""
    roots = _roots(coefficients)
    modulus = np.abs(roots)
    if modulus.max(initial=0.0) <= MAX_ROOT:
        return coefficients
    pulled = np.where(modulus > MAX_ROOT, roots * (MAX_ROOT / np.maximum(modulus, 1e-300)), roots)
    return np.asarray(-np.real(np.poly(pulled))[1:])


def largest_root(coefficients: FloatArray) -> float:
    """Largest modulus of the roots, stable below 1; coefficients of shape (order,). [-]"""
    return float(np.abs(_roots(coefficients)).max(initial=0.0))


def _roots(coefficients: FloatArray) -> NDArray[np.complex128]:
    return np.roots(np.concatenate([[1.0], -coefficients])).astype(np.complex128)
