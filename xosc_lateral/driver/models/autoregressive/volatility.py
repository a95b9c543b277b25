"""Volatility: a factor on a driver's movement that differs between drivers and varies while driving.

The logarithm of the factor is the sum of three normal parts: one that a driver keeps, one that wanders over minutes and
one that wanders over seconds (both first-order autoregressions). Factors are scaled so that their mean square is 1.

One drive alone can't tell what its driver keeps from what wanders slowly: all that lasts longer than the lags looked at
counts as slow wander there, and as a difference between drivers where there are several.

References
----------
S. J. Taylor, "Modelling Financial Time Series", Wiley 1986: stochastic volatility.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.records import Record
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]

MEMORIES = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0)
"""Correlation times of the wandering part that are tried; one value a second can't hold shorter ones. [s]"""

SLOW_MEMORY = 300.0
"""Correlation time of the slow wander. [s]"""

MAX_LAG = 60.0
"""Lags up to this are looked at. [s]"""


class Volatility(Record, frozen=True):
    """Parameters of the factor.

    Parameters
    ----------
    between : float
        Variance of the logarithm between drivers. [-]
    within : float
        Variance of its wandering part. [-]
    memory : float
        Correlation time of the wandering part. [s]
    slow : float
        Variance of the part that wanders with the correlation time `SLOW_MEMORY`. [-]

    Raises
    ------
    DriverProfileError
        If a variance is negative or the memory not above 0.
    """

    between: float = 0.0
    within: float = 0.0
    memory: float = 10.0
    slow: float = 0.0

    def __post_init__(self) -> None:
        """Check."""
        numbers = (self.between, self.within, self.memory, self.slow)
        if not all(map(isfinite, numbers)) or min(self.between, self.within, self.slow) < 0 or self.memory <= 0:
            raise DriverProfileError(f"volatility: {self}")

    @property
    def total(self) -> float:
        """Variance of the logarithm over all drivers and times. [-]"""
        return self.between + self.within + self.slow

    def over(self, seconds: float) -> float:
        """Variance of the logarithm's mean over so long a stretch [s], over all drivers and times. [-]"""
        within, slow = (float(averaged_memory(1, seconds, memory)[0]) for memory in (self.memory, SLOW_MEMORY))
        return self.between + within * self.within + slow * self.slow

    def scaled(self, factor: float) -> Volatility:
        """All variances times a factor [-] >= 0."""
        return Volatility(self.between * factor, self.within * factor, self.memory, self.slow * factor)


def log_power(values: FloatArray, window: int) -> FloatArray:
    """Half the logarithm [-] of the mean square in successive windows, shape (len(values) // window,)."""
    count = len(values) // window
    power = (values[: count * window].reshape(count, window) ** 2).mean(axis=1)
    return np.asarray(0.5 * np.log(np.maximum(power, 1e-30)))


def autocovariance(series: Sequence[FloatArray], n_lags: int) -> tuple[FloatArray, FloatArray]:
    """Covariance [square of the unit] of windows so many apart, about the common mean, and its count of pairs.

    Series of shape (n_i,) give arrays of shape (n_lags,) each.
    """
    mean = float(np.concatenate(series).mean())
    sums, counts = np.zeros(n_lags), np.zeros(n_lags)
    for values in series:
        about = values - mean
        for lag in range(min(n_lags, len(about))):
            sums[lag] += about[: len(about) - lag] @ about[lag:]
            counts[lag] += len(about) - lag
    return sums / np.maximum(counts, 1.0), counts


def fit_volatility(excess: FloatArray, counts: FloatArray, seconds: float, *, population: bool) -> Volatility:
    """Fit to the excess covariance of log power over what steady Gaussian movement would show.

    Parameters
    ----------
    excess, counts : array, shape (n_lags,)
        Excess at lags of 0, 1, 2 ... windows, and its weights.
    seconds : float
        Length of a window. [s]
    population : bool
        Whether there are several drivers: what lasts is then a difference between them, else slow wander.
    """
    best, least = Volatility(), np.inf
    weights = np.sqrt(counts / max(counts.max(), 1.0))
    for memory in MEMORIES:
        shape = averaged_memory(len(excess), seconds, memory)
        for basis in ([shape, np.ones(len(excess))], [shape]):
            columns = np.stack(basis, axis=1)
            found = np.linalg.lstsq(columns * weights[:, None], excess * weights, rcond=None)[0]
            if (found < 0).any():
                continue
            error = float((((columns @ found - excess) * weights) ** 2).sum())
            if error < least - 1e-12:
                lasting = float(found[1]) if len(found) > 1 else 0.0
                best, least = Volatility(lasting, float(found[0]), memory), error
            break
    return best if population else Volatility(0.0, best.within, best.memory, best.between)


def averaged_memory(n_lags: int, seconds: float, memory: float) -> FloatArray:
    """Covariance [-] of window means of a first-order autoregression of variance 1, at lags of whole windows.

    Windows and memory in [s]; shape (n_lags,).
    """
    ratio = seconds / memory
    shape = 2.0 * (np.cosh(ratio) - 1.0) / ratio**2 * np.exp(-ratio * np.arange(n_lags))
    shape[0] = 2.0 * (ratio - 1.0 + np.exp(-ratio)) / ratio**2
    return np.asarray(shape)
