"""Volatility while driving: factors on the coarse and on the fine movement, one value per coarse step.

References
----------
.. [1] S. J. Taylor, "Modelling Financial Time Series", Wiley 1986: stochastic volatility.
"""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.filters import COARSE_EVERY
from xosc_lateral.driver.models.autoregressive.parameters import AutoregressiveParameters
from xosc_lateral.driver.models.autoregressive.volatility import SLOW_CORRELATION_TIME
from xosc_lateral.driver.recursion import recur
from xosc_lateral.driver.seeds import AutoregressiveSeed, generator

FloatArray = NDArray[np.float64]

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
