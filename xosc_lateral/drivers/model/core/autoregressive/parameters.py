"""Parameters of the autoregressive model, what follows from them, and drivers drawn from the population they describe.

References
----------
.. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE ISCAS 1974.
.. [2] R. E. Crochiere, L. R. Rabiner, "Multirate Digital Signal Processing", 1983: interpolation phase by phase.
.. [3] G. E. P. Box, G. M. Jenkins, "Time Series Analysis: Forecasting and Control", 1970.
.. [4] D. B. Rubin, "Using the SIR algorithm to simulate posterior distributions", Bayesian Statistics 3, 1988.
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from math import fsum, isfinite, sqrt
from operator import mul
from typing import Annotated

import msgspec
import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.limits import MODEL_ORDER
from xosc_lateral.drivers.drives.drive import STEP
from xosc_lateral.drivers.drives.filters import filtered, low_pass
from xosc_lateral.drivers.model.core.base import NOISE_VARIANCE, CoreModel, ShapedNoise, Start
from xosc_lateral.drivers.model.linear_filters import JitKernel, worth_compiling
from xosc_lateral.drivers.model.records import Record, frozen_array, set_once

# ---- the border between coarse and fine movement [1]_ [2]_, and linear prediction of the coarse series [3]_ ----
BORDER = 0.4
"""Slower movement is coarse: what a driver steers, while sensor and vehicle add the rest. [Hz]"""

HALF_LENGTH = 4.0
"""Of the measuring low-pass. [s]"""

MEASURING_WINDOW, BUILDING_WINDOW = 6.0, 7.0
"""Kaiser shapes of the low-passes: 63 dB to measure by, so that noise five decades below the slow movement stays apart,
75 dB to build by, for images of slow movement. [-]"""

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
    late = COARSE_EVERY * (np.arange(2 * TICKS + 2)[:, None] - TICKS)
    at = len(kernel) // 2 + np.arange(COARSE_EVERY) - late
    table = np.where((at >= 0) & (at < len(kernel)), kernel[np.clip(at, 0, len(kernel) - 1)], 0.0)
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
        if coefficients.size > MODEL_ORDER.value:
            raise DriverProfileError(MODEL_ORDER.refusal(coefficients.size))
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
        turns = _turns_on_grid(self.order) if frequency is FREQUENCIES else _turns(frequency, self.order)
        gain = 1.0 - np.einsum("ij,j->i", turns, self.coefficients)  # BLAS adds up otherwise on other processors
        return np.asarray(self.scale**2 / np.abs(gain) ** 2)

    def covariance(self, n_lags: int) -> FloatArray:
        """Autocovariance at lags 0 to n_lags - 1 steps, shape (n_lags,), n_lags <= `GRID` / 2. [square of the unit]"""
        power = self.power(FREQUENCIES)
        return np.asarray(np.fft.irfft(power, GRID)[:n_lags])


def _turns(frequency: FloatArray, order: int) -> NDArray[np.complex128]:
    """By how much waves turn in one step and more, shape (n, order). [-]"""
    return np.asarray(np.exp(-2j * np.pi * np.outer(frequency, np.arange(1, order + 1))))


@lru_cache(maxsize=8)
def _turns_on_grid(order: int) -> NDArray[np.complex128]:
    """The same at `FREQUENCIES`, a megabyte for the usual order: fits ask for it hundreds of times."""
    return _turns(FREQUENCIES, order)


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


# ---- all parameters, and drivers drawn from the population that they describe [4]_ ----
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
        covariance[0] *= 1.0 + 1e-9
        return _triangle(covariance.tolist())


def _triangle(covariance: list[float]) -> FloatArray:
    """Cholesky's factor of a covariance that depends on the lag, shape (n,) -> (n, n); libraries add up in other orders
    on other processors, and what is exported is the same bytes on all.
    """
    rows: list[list[float]] = []
    for k in range(len(covariance)):
        rows.append([])
        for j, above in enumerate(rows):
            rest = covariance[k - j] - fsum(map(mul, rows[k], above[:j]))
            rows[k].append(sqrt(rest) if j == k else rest / above[j])
    return np.array([row + [0.0] * (len(covariance) - len(row)) for row in rows])


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
    if start is None:  # nothing to choose by
        coarse_normal, fine_normal = coarse_normal[:, :1], fine_normal[:, :1]
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
