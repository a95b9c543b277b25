"""The two parts of the movement, made in blocks of one coarse step and taken in any number."""

from __future__ import annotations

from typing import Self

import msgspec
import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.drivers.model.core.autoregressive.coarse import COARSE_EVERY, TICKS, interpolate
from xosc_lateral.drivers.model.core.autoregressive.parameters import (
    SLOW_CORRELATION_TIME,
    AutoregressiveParameters,
    DriverState,
)
from xosc_lateral.drivers.model.linear_filters import convolve, recur
from xosc_lateral.drivers.model.seeds import AutoregressiveSeed, generator

COARSE, FINE = 0, 1
"""Index of a part wherever both stand side by side."""


class PairState(msgspec.Struct):
    """Two correlated first-order autoregressions: generator, and last values of shape (2, drivers). [-]"""

    rng: np.random.Generator
    values: FloatArray


class FactorState(msgspec.Struct):
    """What varies within seconds and within minutes, and factors drawn and not yet taken, shape (k, drivers). [-]"""

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


class QueueState(msgspec.Struct):
    """Values at 5 Hz that were made and not yet taken, shape (k, drivers). [lane widths]"""

    made: FloatArray
    skip: IntArray  # Rows of it that each driver leaves out before his next, shape (drivers,).
    bridge: FloatArray  # What is still added to meet a start, step by step, shape (k, drivers). [lane widths]


class CoarseState(QueueState):
    """Coarse part: its generator, last coarse steps (order, drivers), those held for the low-pass (k, drivers)."""

    rng: np.random.Generator
    past: FloatArray
    held: FloatArray

    @classmethod
    def begin(cls, rng: np.random.Generator, past: FloatArray, skip: IntArray) -> Self:
        """Nothing made yet. `past` of shape (n, drivers), `skip` of shape (drivers,). [-]"""
        nothing = np.empty((0, past.shape[1]))
        return cls(made=nothing, skip=skip, bridge=nothing, rng=rng, past=past, held=nothing)


class FineState(QueueState):
    """Fine part: its generator, the last factor (1, drivers) once there is one, and noise before shaping."""

    rng: np.random.Generator
    last_factor: FloatArray
    noise: FloatArray

    @classmethod
    def begin(cls, rng: np.random.Generator, skip: IntArray) -> Self:
        """Nothing made yet. `skip` of shape (drivers,). [-]"""
        nothing = np.empty((0, len(skip)))
        return cls(made=nothing, skip=skip, bridge=nothing, rng=rng, last_factor=nothing, noise=nothing)


class _Part:
    state: QueueState

    def take(self, n: int) -> FloatArray:
        """Next n values, shape (n, drivers). [lane widths]"""
        state = self.state
        self._fill(n)
        if state.skip.any():  # drivers who began at different phases of the coarse step
            columns = np.arange(state.made.shape[1])
            values = np.asarray(state.made[state.skip + np.arange(n)[:, None], columns])
        else:
            values = state.made[:n].copy()
        state.made = state.made[n:]
        bridged = min(n, len(state.bridge))
        if bridged:
            values[:bridged] += state.bridge[:bridged]
            state.bridge = state.bridge[bridged:]
        return values

    def first(self) -> FloatArray:
        """The next values, which stay where they are, shape (drivers,). [lane widths]"""
        self._fill(1)
        return np.asarray(self.state.made[self.state.skip, np.arange(self.state.made.shape[1])])

    def _fill(self, n: int) -> None:
        state = self.state
        missing = n + int(state.skip.max()) - len(state.made)
        if missing > 0:
            state.made = np.concatenate([state.made, self._make(-(-missing // COARSE_EVERY))])
        common = int(state.skip.min())
        if common:
            state.made, state.skip = state.made[common:], state.skip - common

    def _make(self, blocks: int) -> FloatArray:
        raise NotImplementedError


class CoarsePart(_Part):
    """Coarse movement about the driver's mean; its first block belongs to coarse step `TICKS`."""

    def __init__(
        self, model: AutoregressiveParameters, driver: DriverState, state: CoarseState, factors: Factors
    ) -> None:
        self.state: CoarseState = state
        self._model, self._driver, self._factors = model, driver, factors

    def _steps(self, n: int) -> FloatArray:
        state, drivers = self.state, len(self._driver.mean)
        factors = self._factors.take(COARSE, n)
        noise = state.rng.standard_normal((n, drivers)) * (self._model.coarse.scale * factors)
        series = recur(state.past, noise, self._model.coarse.coefficients)
        state.past = series[n:]
        return series[len(series) - n :]

    def _make(self, blocks: int) -> FloatArray:
        before = 0 if len(self.state.held) else 2 * TICKS + 1
        steps = np.concatenate([self.state.held, self._steps(before + blocks)])
        self.state.held = steps[blocks:]
        return interpolate(steps) * self._driver.coarse


class FinePart(_Part):
    """Fine movement; its first value is centred half a kernel after step 0."""

    def __init__(
        self, model: AutoregressiveParameters, driver: DriverState, state: FineState, factors: Factors
    ) -> None:
        self.state: FineState = state
        self._kernel, self._driver, self._factors = model.kernel, driver, factors

    def _volatile_noise(self, blocks: int) -> FloatArray:
        state, drivers = self.state, len(self._driver.mean)
        before = 0 if len(state.last_factor) else 1
        factors = np.concatenate([state.last_factor, self._factors.take(FINE, before + blocks)])
        state.last_factor = factors[-1:]
        share = (np.arange(COARSE_EVERY) / COARSE_EVERY)[:, None]
        between = factors[:-1, None] * (1.0 - share) + factors[1:, None] * share
        return (state.rng.random((blocks * COARSE_EVERY, drivers)) - 0.5) * between.reshape(-1, drivers)

    def _make(self, blocks: int) -> FloatArray:
        state = self.state
        n = blocks * COARSE_EVERY
        lacks = n + len(self._kernel) - 1 - len(state.noise)
        noise = np.concatenate([state.noise, self._volatile_noise(-(-lacks // COARSE_EVERY))])
        state.noise = noise[n:]
        return convolve(noise[: n + len(self._kernel) - 1], self._kernel) * self._driver.fine
