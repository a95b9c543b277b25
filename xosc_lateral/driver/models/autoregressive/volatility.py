"""Volatility: a factor on a driver's movement that differs between drivers and varies while driving.

The logarithm of the factor is the sum of three normal parts: one that a driver keeps, one that varies within minutes,
and one that varies within seconds (both first-order autoregressions). Factors have a mean square of 1.

References
----------
S. J. Taylor, "Modelling Financial Time Series", Wiley 1986: stochastic volatility.
"""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.filters import COARSE_EVERY
from xosc_lateral.driver.records import Record
from xosc_lateral.driver.recursion import recur
from xosc_lateral.driver.seeds import AutoregressiveSeed, generator
from xosc_lateral.errors import DriverProfileError

if TYPE_CHECKING:
    from xosc_lateral.driver.models.autoregressive.parameters import AutoregressiveParameters

FloatArray = NDArray[np.float64]

SLOW_CORRELATION_TIME = 300.0
"""Of the part that varies within minutes. [s]"""


class Volatility(Record, frozen=True):
    """Parameters of the factor.

    Raises `DriverProfileError` if a variance is negative or the correlation time not above 0.

    Parameters
    ----------
    between : float
        Variance of the logarithm between drivers. [-]
    within : float
        Variance of the part that varies within seconds. [-]
    correlation_time : float
        Of the part that varies within seconds; `memory` in files. [s]
    slow : float
        Variance of the part that varies with the correlation time `SLOW_CORRELATION_TIME`. [-]
    """

    between: float = 0.0
    within: float = 0.0
    correlation_time: float = msgspec.field(name="memory", default=10.0)
    slow: float = 0.0

    def __post_init__(self) -> None:
        """Check."""
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


COARSE, FINE = 0, 1
"""Index of a part wherever both stand side by side."""


class PairState(msgspec.Struct):
    """Two correlated first-order autoregressions: generator, and last values of shape (2, drivers). [-]"""

    rng: np.random.Generator
    values: FloatArray


class FactorState(msgspec.Struct):
    """Both logarithms' varying parts, and the factors drawn ahead of one part while the other was asked for.

    Parameters
    ----------
    quick, slow : PairState
        What varies within seconds, and within minutes.
    coarse, fine : array, shape (k, drivers)
        Factors that are drawn and not yet taken. [-]
    """

    quick: PairState
    slow: PairState
    coarse: FloatArray
    fine: FloatArray


class Factors:
    """Factors with a mean square of 1; each part takes its own in pieces of its own."""

    def __init__(self, model: AutoregressiveParameters, state: FactorState) -> None:
        self.state = state
        step = model.step * COARSE_EVERY
        parts = (model.coarse_volatility, model.fine_volatility)
        within, slow = (np.array([getattr(part, name) for part in parts]) for name in ("within", "slow"))
        self._offsets = (within + slow)[:, None, None]
        time = np.array([part.correlation_time for part in parts])
        self._quick = _Pair(state.quick, within, np.exp(-step / time), model.correlation)
        self._slow = _Pair(state.slow, slow, np.exp(-step / np.full(2, SLOW_CORRELATION_TIME)), model.correlation)
        self._varies_slowly = bool((slow > 0.0).any())

    def take(self, part: int, n: int) -> FloatArray:
        """Next n factors of a part, shape (n, drivers), > 0. [-]"""
        state = self.state
        missing = n - len(state.fine if part else state.coarse)
        if missing > 0:
            coarse, fine = self._next(missing)
            state.coarse = np.concatenate([state.coarse, coarse])
            state.fine = np.concatenate([state.fine, fine])
        if part == COARSE:
            taken, state.coarse = state.coarse[:n], state.coarse[n:]
        else:
            taken, state.fine = state.fine[:n], state.fine[n:]
        return taken

    def _next(self, n: int) -> tuple[FloatArray, FloatArray]:
        logs = self._quick.take(n)
        if self._varies_slowly:
            logs = logs + self._slow.take(n)
        factors = np.exp(logs - self._offsets)
        return factors[COARSE], factors[FINE]


class _Pair:
    def __init__(self, state: PairState, variance: FloatArray, keep: FloatArray, correlation: float) -> None:
        self._state, self._keep, self._correlation = state, keep, correlation
        self._gain = np.sqrt(variance * (1.0 - keep**2))[:, None, None]

    def take(self, n: int) -> FloatArray:
        """Next n values of both, shape (2, n, drivers). [-]"""
        state = self._state
        noise = _correlated(state.rng, n, state.values.shape[1], self._correlation) * self._gain
        series = np.stack([recur(state.values[k : k + 1], noise[k], self._keep[k : k + 1]) for k in range(2)])
        if n:
            state.values = series[:, -1].copy()
        return np.asarray(series[:, 1:])


def begin_factors(model: AutoregressiveParameters, seed: np.random.SeedSequence, drivers: int) -> FactorState:
    """Stationary from the start."""

    def begin(key: int, name: str) -> PairState:
        rng = generator(seed, AutoregressiveSeed.VOLATILITY, key)
        spread = np.sqrt([getattr(part, name) for part in (model.coarse_volatility, model.fine_volatility)])
        first = _correlated(rng, 1, drivers, model.correlation)[:, 0]
        return PairState(rng, first * spread[:, None])

    nothing = np.empty((0, drivers))
    return FactorState(begin(0, "within"), begin(1, "slow"), nothing, nothing)


def _correlated(rng: np.random.Generator, n: int, drivers: int, correlation: float) -> FloatArray:
    """Pairs of correlated standard normal values, drawn step by step, shape (2, n, drivers)."""
    normal = rng.standard_normal((n, 2, drivers)).swapaxes(0, 1).copy()
    normal[FINE] = correlation * normal[COARSE] + np.sqrt(1.0 - correlation**2) * normal[FINE]
    return normal
