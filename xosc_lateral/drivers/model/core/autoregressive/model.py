"""Our model: drivers that differ, coarse movement with a memory, fine noise, both of a volatility that varies.

Two levels as in the paper's, x = kappa + phi, each repaired where it falls short:

- kappa is the driver's own mean plus an autoregression of order 16 at one step a second, brought to 5 Hz by a low-pass:
  memory beyond one step, and a smooth path instead of a staircase.
- phi is uniform white noise shaped by a kernel, as in the paper, with a spectrum that complements that of kappa.
- A factor on either, the volatility, differs between drivers and varies while driving; both are correlated.
- A driver is drawn for a whole drive. A drive that must start at an offset is one of those that pass through it: the
  driver is drawn given the offset, and the movement is conditioned on it, exactly for Gaussian movement.

Sampled in pieces of any length, of one driver or of several at once. Every source of chance has a generator of its own,
drawn in order, step by step and within a step driver by driver.

References
----------
.. [1] N. Neis, J. Beyerer, arXiv:2405.17080, 2024: coarse and fine part of the offset, here with other processes.
"""

from __future__ import annotations

from typing import ClassVar, Self

import msgspec
import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.drivers.model.core.autoregressive.parameters import (
    COARSE_EVERY,
    SLOW_CORRELATION_TIME,
    TICKS,
    AutoregressiveParameters,
    DriverState,
    draw_drivers,
    interpolate,
)
from xosc_lateral.drivers.model.core.base import ClockState, Start, take_at_rate
from xosc_lateral.drivers.model.linear_filters import convolve, recur
from xosc_lateral.drivers.model.seeds import AutoregressiveSeed, generator

# ---- the two parts of the movement, made in blocks of one coarse step and taken in any number ----
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


# ---- the model ----
KNEE_SHARE = 0.8
"""Coarse movement is bent from this share of the way between the mean and a limit on. [-]"""

HEADROOM = 0.02
"""Room left beyond a start that lies near or outside a limit. [lane widths]"""


class AutoregressiveState(msgspec.Struct):
    """Where drives are."""

    driver: DriverState
    factors: FactorState
    coarse: CoarseState
    fine: FineState
    # Where bending begins (and, in `limits`, ends), on the lower and on the upper side, shape (2, drivers). [-]
    knees: FloatArray
    limits: FloatArray
    clock: ClockState  # Of the coarse part.
    single: bool = True  # One driver, arrays without an axis of drivers.


class AutoregressiveModel(AutoregressiveParameters, frozen=True, eq=False, dict=True):
    """Parameters of the model; raises `DriverProfileError` if a number is out of its range."""

    State: ClassVar[type] = AutoregressiveState
    fine_scales_with_lane: ClassVar[bool] = False

    def stream(
        self, seed: np.random.SeedSequence, start: Start | None = None, *, drivers: int | None = None
    ) -> AutoregressiveStream:
        """Begin a drive, with a driver of its own; see `CoreModel.stream`."""
        m = drivers or 1
        setup = generator(seed, AutoregressiveSeed.DRIVER)
        driver = draw_drivers(self, start, setup, m)
        skip = setup.integers(COARSE_EVERY, size=m)  # no sample of the 5 Hz grid is special
        noise = setup.standard_normal((self.coarse.order, m))
        past = np.einsum("ij,jk->ik", self.start_factor, noise)  # BLAS adds up in another order on another processor
        knees, limits = _bends(self, driver.mean)
        half = len(self.kernel) // 2
        # The coarse part begins at sample COARSE_EVERY * TICKS after step 0, the fine one at sample `half`.
        first = max(half, COARSE_EVERY * TICKS) + skip
        state = AutoregressiveState(
            driver=driver,
            factors=begin_factors(self, seed, m),
            coarse=CoarseState.begin(generator(seed, AutoregressiveSeed.COARSE), past, first - COARSE_EVERY * TICKS),
            fine=FineState.begin(generator(seed, AutoregressiveSeed.FINE), first - half),
            knees=knees,
            limits=limits,
            clock=ClockState(),
            single=drivers is None,
        )
        stream = AutoregressiveStream(self, state)
        if start is not None:
            stream.meet(start, self)
        return stream

    def resume(self, state: AutoregressiveState) -> AutoregressiveStream:
        """Go on from a state."""
        return AutoregressiveStream(self, state)


class AutoregressiveStream:
    """See `CoreStream`."""

    def __init__(self, model: AutoregressiveModel, state: AutoregressiveState) -> None:
        self.state = state
        factors = Factors(model, state.factors)
        self._coarse = CoarsePart(model, state.driver, state.coarse, factors)
        self._fine = FinePart(model, state.driver, state.fine, factors)

    @property
    def mean(self) -> FloatArray | float:
        """What each driver's coarse part moves about. [-] Shape (drivers,)."""
        mean = self.state.driver.mean
        return float(mean[0]) if self.state.single else mean

    def take(self, n: int, rate: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Next n values of the coarse and of the fine part, shape (n,) or (n, drivers) [-]; see `CoreStream`."""
        coarse = take_at_rate(self.state.clock, self._bent, n, rate)
        fine = self._fine.take(n)
        return (coarse[:, 0], fine[:, 0]) if self.state.single else (coarse, fine)

    def meet(self, start: Start, model: AutoregressiveModel) -> None:
        """Condition the movement on its start: add what the covariance with the first value makes of what it lacks."""
        driver = self.state.driver
        coarse, fine = self._coarse.first(), self._fine.first()
        coarse_covariance = start.spread * driver.coarse**2 * model.coarse_covariance[:, None]
        fine_covariance = start.fine * driver.fine**2 * model.fine_covariance[:, None]
        variance = start.spread * coarse_covariance[0] + start.fine * fine_covariance[0]
        lacks = start.rel_offset - (driver.mean + start.spread * coarse + start.fine * fine)
        share = np.where(variance > 0.0, lacks / np.where(variance > 0.0, variance, 1.0), 0.0)
        self.state.coarse.bridge = coarse_covariance * share
        self.state.fine.bridge = fine_covariance * share
        first = np.where(variance > 0.0, driver.mean + coarse + self.state.coarse.bridge[0], driver.mean)
        self.state.knees, self.state.limits = _bends(model, first)

    def _bent(self, n: int) -> FloatArray:
        """Next n coarse values, bent before the limits, shape (n, drivers). [-]"""
        values = self._coarse.take(n)
        values += self.state.driver.mean
        for side in range(2):
            knee, limit = self.state.knees[side], self.state.limits[side]
            beyond = values > knee if side else values < knee
            if beyond.any():
                knee, limit = (np.broadcast_to(part, values.shape)[beyond] for part in (knee, limit))
                values[beyond] = knee + (limit - knee) * np.tanh((values[beyond] - knee) / (limit - knee))
        return values


def _bends(model: AutoregressiveParameters, first: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Knees and limits, each of shape (2, drivers); both lie beyond where a drive starts."""
    knees, limits = np.empty((2, len(first))), np.empty((2, len(first)))
    for row, (limit, side) in enumerate(zip(model.limits, (-1.0, 1.0), strict=True)):
        knee = model.mean + KNEE_SHARE * (limit - model.mean)
        outside = side * (first - knee) > 0.0
        knees[row] = np.where(outside, first, knee)
        limits[row] = np.where(outside, side * np.maximum(side * limit, side * first + HEADROOM), limit)
    return knees, limits
