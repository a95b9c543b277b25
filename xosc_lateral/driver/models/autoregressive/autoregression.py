"""Linear prediction of a series from its past: kept stable, its spectrum known.

References
----------
.. [1] G. E. P. Box, G. M. Jenkins, "Time Series Analysis: Forecasting and Control", 1970.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.records import Record, frozen_array, set_once
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]

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
        """Check, copy and freeze."""
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


def stabilise(coefficients: FloatArray, largest: float = MAX_ROOT) -> FloatArray:
    """Coefficients [-], shape (order,), whose roots lie within a modulus (0 to 1): others are pulled in radially."""
    roots = _roots(coefficients)
    modulus = np.abs(roots)
    if modulus.max(initial=0.0) <= largest:
        return coefficients
    pulled = np.where(modulus > largest, roots * (largest / np.maximum(modulus, 1e-300)), roots)
    return np.asarray(-np.real(np.poly(pulled))[1:])


def largest_root(coefficients: FloatArray) -> float:
    """Largest modulus of the roots, stable below 1; coefficients of shape (order,). [-]"""
    return float(np.abs(_roots(coefficients)).max(initial=0.0))


def _roots(coefficients: FloatArray) -> NDArray[np.complex128]:
    return np.roots(np.concatenate([[1.0], -coefficients])).astype(np.complex128)
