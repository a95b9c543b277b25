"""How volatile drivers are, from the power of their movement window by window.

One drive alone does not separate what its driver keeps from what varies slowly: all that lasts longer than the lags
counts as slow variation there, and as a difference between drivers where there are several.

References
----------
.. [1] S. J. Taylor, "Modelling Financial Time Series", Wiley 1986: stochastic volatility.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.volatility import Volatility, averaged_covariance

FloatArray = NDArray[np.float64]

CORRELATION_TIMES = (2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0)
"""Of the part that varies within seconds, as tried; one value a second can't hold shorter ones. [s]"""

MAX_LAG = 60.0
"""Lags up to this are looked at. [s]"""


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
        Whether there are several drivers: what lasts is then a difference between them, else slow variation.
    """
    best, least = Volatility(), np.inf
    weights = np.sqrt(counts / max(counts.max(), 1.0))
    for time in CORRELATION_TIMES:
        shape = averaged_covariance(len(excess), seconds, time)
        for basis in ([shape, np.ones(len(excess))], [shape]):
            columns = np.stack(basis, axis=1)
            found = np.linalg.lstsq(columns * weights[:, None], excess * weights, rcond=None)[0]
            if (found < 0).any():
                continue
            error = float((((columns @ found - excess) * weights) ** 2).sum())
            if error < least - 1e-12:
                lasting = float(found[1]) if len(found) > 1 else 0.0
                best, least = Volatility(lasting, float(found[0]), time), error
            break
    return best if population else Volatility(0.0, best.within, best.correlation_time, best.between)
