"""Volatility: a factor on a driver's movement that differs between drivers and varies while driving.

The logarithm of the factor is the sum of three normal parts: one that a driver keeps, one that varies within minutes,
and one that varies within seconds (both first-order autoregressions). Factors have a mean square of 1.

References
----------
S. J. Taylor, "Modelling Financial Time Series", Wiley 1986: stochastic volatility.
"""

from __future__ import annotations

from math import isfinite

import msgspec
import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.records import Record

SLOW_CORRELATION_TIME = 300.0
"""Of the part that varies within minutes. [s]"""


class Volatility(Record, frozen=True):
    """Variances of the factor's logarithm: between drivers, and of what varies within seconds and within minutes. [-]

    Raises `DriverProfileError` if a variance is negative or the correlation time not above 0.
    """

    between: float = 0.0
    within: float = 0.0
    correlation_time: float = msgspec.field(name="memory", default=10.0)
    """Of the part that varies within seconds; of the slow one it is `SLOW_CORRELATION_TIME`. [s]"""
    slow: float = 0.0

    def __post_init__(self) -> None:
        numbers = (self.between, self.within, self.correlation_time, self.slow)
        if (
            not all(map(isfinite, numbers))
            or min(self.between, self.within, self.slow) < 0
            or self.correlation_time <= 0
        ):
            raise DriverProfileError(f"volatility: {self}")

    @property
    def total(self) -> float:
        """Variance of the logarithm over all drivers and times. [-]"""
        return self.between + self.within + self.slow

    def over(self, seconds: float) -> float:
        """Variance of the logarithm's mean over so long a window [s], over all drivers and times. [-]"""
        within, slow = (
            float(averaged_covariance(1, seconds, time)[0]) for time in (self.correlation_time, SLOW_CORRELATION_TIME)
        )
        return self.between + within * self.within + slow * self.slow

    def scaled(self, factor: float) -> Volatility:
        """All variances times a factor [-] >= 0."""
        return Volatility(self.between * factor, self.within * factor, self.correlation_time, self.slow * factor)


def averaged_covariance(n_lags: int, seconds: float, time: float) -> FloatArray:
    """Covariance [-] of window means of a first-order autoregression of variance 1, at lags of whole windows.

    Times in [s]; shape (n_lags,).
    """
    ratio = seconds / time
    shape = 2.0 * (np.cosh(ratio) - 1.0) / ratio**2 * np.exp(-ratio * np.arange(n_lags))
    shape[0] = 2.0 * (ratio - 1.0 + np.exp(-ratio)) / ratio**2
    return np.asarray(shape)
