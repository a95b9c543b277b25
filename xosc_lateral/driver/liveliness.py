"""How lively a driver moves: a factor on the movement that differs between drivers and wanders while driving.

The logarithm of the factor is the sum of a part that a driver keeps (normal between drivers) and one that wanders about
it (first-order autoregression, normal). Factors are scaled so that their mean square is 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]

MEMORIES = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0)
"""Correlation times of the wandering part that are tried. [s]"""

MAX_LAG = 60.0
"""Lags up to this are looked at. [s]"""


@dataclass(frozen=True, slots=True)
class Liveliness:
    """Parameters of the factor.

    Parameters
    ----------
    between : float
        Variance of the logarithm between drivers. [-]
    within : float
        Variance of its wandering part. [-]
    memory : float
        Correlation time of the wandering part. [s]

    Raises
    ------
    DriverProfileError
        If a variance is negative or the memory not above 0.
    """

    between: float = 0.0
    within: float = 0.0
    memory: float = 10.0

    def __post_init__(self) -> None:
        """Check."""
        if not (self.between >= 0 and self.within >= 0 and self.memory > 0):
            raise DriverProfileError(f"liveliness: {self}")
        if not all(map(isfinite, (self.between, self.within, self.memory))):
            raise DriverProfileError(f"liveliness: {self}")

    @property
    def total(self) -> float:
        """Variance of the logarithm over all drivers and times. [-]"""
        return self.between + self.within

    def scaled(self, factor: float) -> Liveliness:
        """Both variances times a factor."""
        return Liveliness(self.between * factor, self.within * factor, self.memory)


def log_power(values: FloatArray, window: int) -> FloatArray:
    """Half the logarithm of the mean square in successive windows, shape (len(values) // window,)."""
    count = len(values) // window
    power = (values[: count * window].reshape(count, window) ** 2).mean(axis=1)
    return np.asarray(0.5 * np.log(np.maximum(power, 1e-30)))


def autocovariance(series: Sequence[FloatArray], n_lags: int) -> tuple[FloatArray, FloatArray]:
    """Covariance of windows so many apart, about the common mean, and how many pairs gave it. Shape (n_lags,) each."""
    mean = float(np.concatenate(series).mean())
    sums, counts = np.zeros(n_lags), np.zeros(n_lags)
    for values in series:
        about = values - mean
        for lag in range(min(n_lags, len(about))):
            sums[lag] += about[: len(about) - lag] @ about[lag:]
            counts[lag] += len(about) - lag
    return sums / np.maximum(counts, 1.0), counts


def fit_liveliness(excess: FloatArray, counts: FloatArray, seconds: float, *, population: bool) -> Liveliness:
    """Fit to the excess covariance of log power over what steady Gaussian movement would show.

    Parameters
    ----------
    excess, counts : array, shape (n_lags,)
        Excess at lags of 0, 1, 2 ... windows, and its weights.
    seconds : float
        Length of a window. [s]
    population : bool
        Whether there are several drivers; one alone has no variance between drivers.
    """
    best, least = Liveliness(), np.inf
    weights = np.sqrt(counts / max(counts.max(), 1.0))
    for memory in MEMORIES:
        shape = averaged_memory(len(excess), seconds, memory)
        for basis in ([shape, np.ones(len(excess))] if population else [shape], [shape]):
            columns = np.stack(basis, axis=1)
            found = np.linalg.lstsq(columns * weights[:, None], excess * weights, rcond=None)[0]
            if (found < 0).any():
                continue
            error = float((((columns @ found - excess) * weights) ** 2).sum())
            if error < least - 1e-12:
                best, least = Liveliness(float(found[1]) if len(found) > 1 else 0.0, float(found[0]), memory), error
            break
    return best


def averaged_memory(n_lags: int, seconds: float, memory: float) -> FloatArray:
    """Covariance of window means of a first-order autoregression of variance 1, at lags of whole windows."""
    ratio = seconds / memory
    shape = 2.0 * (np.cosh(ratio) - 1.0) / ratio**2 * np.exp(-ratio * np.arange(n_lags))
    shape[0] = 2.0 * (ratio - 1.0 + np.exp(-ratio)) / ratio**2
    return np.asarray(shape)
