"""Parameters of the autoregressive model, what follows from them, and drivers drawn from the population they describe.

References
----------
.. [1] D. B. Rubin, "Using the SIR algorithm to simulate posterior distributions", Bayesian Statistics 3, 1988.
"""

from __future__ import annotations

from functools import cached_property
from math import isfinite
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.drives.resampling import STEP
from xosc_lateral.drivers.model.core.autoregressive.coarse import COARSE_EVERY, Autoregression, building_low_pass
from xosc_lateral.drivers.model.core.base import NOISE_VARIANCE, CoreModel, ShapedNoise, Start
from xosc_lateral.drivers.model.records import Record

START_LAGS = 300
"""Steps after which a drive has forgotten the offset that it was made to start at: 60 s. [-]"""


class AutoregressiveParameters(CoreModel, frozen=True, eq=False, dict=True):
    """Fields of `AutoregressiveModel`, and what follows from them."""

    mean: Annotated[float, Meta(description="Mean offset of all drivers. [lane widths]")]
    between_drivers: Annotated[float, Meta(description="Deviation of the drivers' means. [lane widths]")]
    # The range of the data, or where movement is seldom held, the markings at most.
    limits: Annotated[tuple[float, float], Meta(description="Coarse movement bends back before. [lane widths]")]
    coarse: Autoregression  # Of the coarse movement about the driver's mean, one step a second. [lane widths]
    fine: ShapedNoise  # [lane widths]
    coarse_volatility: Volatility
    fine_volatility: Volatility
    correlation: Annotated[float, Meta(description="Between the logarithms of the two factors. [-]")]
    step: Annotated[float, Meta(description="[s]")] = STEP

    def __post_init__(self) -> None:
        low, high = self.limits
        if not -1.0 <= low < self.mean < high <= 1.0:
            raise DriverProfileError(f"mean {self.mean} outside the limits {low} and {high}, or these beyond -1 and 1")
        if not (0.0 <= self.between_drivers < 1.0 and -1.0 <= self.correlation <= 1.0):
            raise DriverProfileError(f"between drivers {self.between_drivers}, correlation {self.correlation}")

    @cached_property
    def kernel(self) -> FloatArray:
        """Kernel of the fine noise, shape (n_taps,). [lane widths]"""
        return self.fine.kernel

    @cached_property
    def coarse_covariance(self) -> FloatArray:
        """Of the coarse movement about the driver's mean at lags of 0.2 s, mean over the phases of a coarse step.

        Shape (START_LAGS,). [lane widths squared]
        """
        n_ticks = START_LAGS // COARSE_EVERY + 20
        ticks = self.coarse.covariance(n_ticks)
        spread = np.zeros(2 * n_ticks * COARSE_EVERY - 1)
        middle = n_ticks * COARSE_EVERY - 1
        spread[middle::COARSE_EVERY][:n_ticks] = ticks
        spread[middle::-COARSE_EVERY][:n_ticks] = ticks
        kernel = building_low_pass()
        both = np.convolve(kernel, kernel) / COARSE_EVERY
        return np.asarray(np.convolve(spread, both, "same")[middle : middle + START_LAGS])

    @cached_property
    def fine_covariance(self) -> FloatArray:
        """Of the fine movement at lags of 0.2 s, shape (START_LAGS,). [lane widths squared]"""
        kernel = self.kernel
        full = np.convolve(kernel, kernel)[len(kernel) - 1 :] * NOISE_VARIANCE
        result = np.zeros(START_LAGS)
        result[: len(full)] = full[:START_LAGS]
        return result

    @cached_property
    def start_factor(self) -> FloatArray:
        """Lower triangle that turns white noise into a stationary past, shape (order, order). [lane widths]"""
        order = self.coarse.order
        covariance = self.coarse.covariance(order)
        if not covariance[0] > 0.0:  # coarse movement that is none has a past of none
            return np.zeros((order, order))
        matrix = covariance[np.abs(np.subtract.outer(np.arange(order), np.arange(order)))]
        return np.asarray(np.linalg.cholesky(matrix + 1e-9 * covariance[0] * np.eye(order)))


CANDIDATES = 64
"""Drivers that one is chosen from, by how likely each is at the offset to start at. [-]"""


class DriverState(msgspec.Struct):
    """What drivers keep for a whole drive, shape (drivers,): the mean [lane widths], factors on both parts [-]."""

    mean: FloatArray
    coarse: FloatArray
    fine: FloatArray


def draw_drivers(model: AutoregressiveParameters, start: Start | None, rng: np.random.Generator, n: int) -> DriverState:
    """Draw n drivers from the population; given a start, each from those found there."""
    coarse_normal, fine_normal = rng.standard_normal((2, n, CANDIDATES))
    coarse = _factor(model.coarse_volatility.between, coarse_normal)
    mixed = model.correlation * coarse_normal + np.sqrt(1.0 - model.correlation**2) * fine_normal
    fine = _factor(model.fine_volatility.between, mixed)
    mean_normal, choice = rng.standard_normal(n), rng.random(n)
    if start is None:
        return DriverState(model.mean + model.between_drivers * mean_normal, coarse[:, 0].copy(), fine[:, 0].copy())
    between = model.between_drivers**2
    coarse_variance = (start.spread * coarse) ** 2 * model.coarse_covariance[0]
    moving = coarse_variance + (start.fine * fine) ** 2 * model.fine_covariance[0]
    away = np.broadcast_to(np.asarray(start.rel_offset) - model.mean, n)
    variance = between + moving
    with np.errstate(divide="ignore", invalid="ignore"):  # of a normal variable, relative to the likeliest candidate's
        log_weight = -0.5 * np.log(variance) - 0.5 * away[:, None] ** 2 / variance
        relative = np.nan_to_num(log_weight - log_weight.max(axis=1, keepdims=True), nan=0.0)
    weight = np.cumsum(np.exp(relative), axis=1)
    k = np.sum(weight < weight[:, -1:] * choice[:, None], axis=1)
    rows = np.arange(n)
    share = between / (between + moving[rows, k]) if between > 0.0 else np.zeros(n)
    mean = model.mean + share * away + np.sqrt(between * (1.0 - share)) * mean_normal
    return DriverState(mean, coarse[rows, k], fine[rows, k])


def _factor(variance: float, normal: FloatArray) -> FloatArray:
    """Log-normal factors of mean square 1."""
    return np.asarray(np.exp(np.sqrt(variance) * normal - variance))


# ---- volatility: a factor on movement that differs between drivers and varies ----
# The logarithm of the factor is the sum of three normal parts: one that a driver keeps, one that varies within minutes,
# and one that varies within seconds (both first-order autoregressions). Factors have a mean square of 1.
# S. J. Taylor, "Modelling Financial Time Series", Wiley 1986: stochastic volatility.

SLOW_CORRELATION_TIME = 300.0
"""Of the part that varies within minutes. [s]"""


class Volatility(Record, frozen=True):
    """Variances of the factor's logarithm: between drivers, and of what varies within seconds and within minutes. [-]

    Raises `DriverProfileError` if a variance is negative or the correlation time not above 0.
    """

    between: float = 0.0
    within: float = 0.0
    # Of the part that varies within seconds; of the slow one it is `SLOW_CORRELATION_TIME`. [s]
    correlation_time: float = msgspec.field(name="memory", default=10.0)
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
