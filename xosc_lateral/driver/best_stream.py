"""Sampling of our model, in pieces of any length. Every source of chance has a generator of its own, drawn in order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.autoregression import recur
from xosc_lateral.driver.bands import COARSE_EVERY, TICKS, phases
from xosc_lateral.driver.compiled import Loop, worth_compiling
from xosc_lateral.driver.core import Start
from xosc_lateral.driver.liveliness import SLOW_MEMORY
from xosc_lateral.driver.noise import convolve
from xosc_lateral.driver.pace import Paced
from xosc_lateral.driver.seeds import child

if TYPE_CHECKING:
    from xosc_lateral.driver.best import BestModel

FloatArray = NDArray[np.float64]

CANDIDATES = 64
"""Drivers that one is chosen from, by how likely each is at the offset to start at. [-]"""

KNEE = 0.8
"""Coarse movement is bent from this share of the way between the mean and a limit on. [-]"""

HEADROOM = 0.02
"""Room left beyond a start that lies near or outside a limit. [lane widths]"""

_SETUP, _LIVELINESS, _COARSE, _FINE = range(4)


@dataclass(frozen=True, slots=True)
class Driver:
    """One of the population: own mean [lane widths] and own factors on coarse and fine movement."""

    mean: float
    coarse: float
    fine: float


class BestStream:
    """One drive; see `CoreStream`."""

    def __init__(self, model: BestModel, seed: np.random.SeedSequence, start: Start | None) -> None:
        setup = np.random.default_rng(child(seed, _SETUP))
        self.driver = draw_driver(model, start, setup)
        self._coarse_pull, self._fine_pull = np.empty(0), np.empty(0)
        skip = int(setup.integers(COARSE_EVERY))  # no sample of the 5 Hz grid is special
        past = model.start_factor @ setup.standard_normal(model.coarse.order)
        half = len(model.kernel) // 2
        factors = _Factors(model, seed)
        self._coarse = _CoarseQueue(model, seed, self.driver, factors, past)
        self._fine = _FineQueue(model, seed, self.driver, factors)
        # The coarse queue begins at sample COARSE_EVERY * TICKS after step 0, the fine one at sample `half`.
        begin = max(half, COARSE_EVERY * TICKS) + skip
        self._coarse.take(begin - COARSE_EVERY * TICKS)
        self._fine.take(begin - half)
        self._begin(model, start)
        self._pace = Paced(self._bent)

    @property
    def mean(self) -> float:
        """What this driver's coarse part moves about. [-]"""
        return self.driver.mean

    def take(self, n: int, rate: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
        """Next n values of the coarse and of the fine part; see `CoreStream`."""
        coarse = self._pace.take(n, rate)
        fine = self._fine.take(n)
        pulled = min(n, len(self._fine_pull))
        if pulled:
            fine[:pulled] += self._fine_pull[:pulled]
            self._fine_pull = self._fine_pull[pulled:]
        return coarse, fine

    def _begin(self, model: BestModel, start: Start | None) -> None:
        """Condition the movement on its start: add what the covariance with the first value makes of what it lacks."""
        first = self.driver.mean
        if start is not None:
            coarse, fine = self._coarse.first(), self._fine.first()
            coarse_covariance = start.spread * self.driver.coarse**2 * model.coarse_covariance
            fine_covariance = start.fine * self.driver.fine**2 * model.fine_covariance
            variance = start.spread * coarse_covariance[0] + start.fine * fine_covariance[0]
            lacks = start.rel_offset - (self.driver.mean + start.spread * coarse + start.fine * fine)
            if variance > 0.0:
                self._coarse_pull = coarse_covariance * (lacks / variance)
                self._fine_pull = fine_covariance * (lacks / variance)
                first = self.driver.mean + coarse + self._coarse_pull[0]
        self._bends = _bends(model, first)

    def _bent(self, n: int) -> FloatArray:
        """Next n coarse values about the driver's mean, bent before the limits."""
        values = self._coarse.take(n)
        pulled = min(n, len(self._coarse_pull))
        if pulled:
            values[:pulled] += self._coarse_pull[:pulled]
            self._coarse_pull = self._coarse_pull[pulled:]
        values += self.driver.mean
        for knee, limit in self._bends:
            beyond = (values - knee) * np.sign(limit - knee) > 0.0
            if beyond.any():
                values[beyond] = knee + (limit - knee) * np.tanh((values[beyond] - knee) / (limit - knee))
        return values


def draw_driver(model: BestModel, start: Start | None, rng: np.random.Generator) -> Driver:
    """Draw a driver from the population; given a start, from those found there."""
    coarse_normal, fine_normal = rng.standard_normal((2, CANDIDATES))
    coarse = _factor(model.coarse_liveliness.between, coarse_normal)
    mixed = model.correlation * coarse_normal + np.sqrt(1.0 - model.correlation**2) * fine_normal
    fine = _factor(model.fine_liveliness.between, mixed)
    mean_normal, choice = float(rng.standard_normal()), float(rng.random())
    if start is None:
        return Driver(model.mean + model.between_drivers * mean_normal, float(coarse[0]), float(fine[0]))
    between = model.between_drivers**2
    moving = (start.spread * coarse) ** 2 * model.coarse_covariance[0] + (
        start.fine * fine
    ) ** 2 * model.fine_covariance[0]
    away = start.rel_offset - model.mean
    with np.errstate(divide="ignore", invalid="ignore"):
        log_weight = -0.5 * np.log(between + moving) - 0.5 * away**2 / (between + moving)
    weight = np.exp(np.nan_to_num(log_weight - log_weight.max(), nan=0.0))
    k = int(np.searchsorted(np.cumsum(weight) / weight.sum(), choice))
    share = between / (between + moving[k]) if between > 0.0 else 0.0
    mean = model.mean + share * away + np.sqrt(between * (1.0 - share)) * mean_normal
    return Driver(float(mean), float(coarse[k]), float(fine[k]))


class _Queue:
    """Values at 5 Hz that are made in blocks of `COARSE_EVERY`, one per coarse step, and taken in any number."""

    def __init__(self) -> None:
        self._made = np.empty(0)

    def take(self, n: int) -> FloatArray:
        """Next n values."""
        self._fill(n)
        taken, self._made = self._made[:n].copy(), self._made[n:]
        return taken

    def first(self) -> float:
        """The next value, which stays in the queue."""
        self._fill(1)
        return float(self._made[0])

    def _fill(self, n: int) -> None:
        missing = n - len(self._made)
        if missing > 0:
            self._made = np.concatenate([self._made, self._make(-(-missing // COARSE_EVERY))])

    def _make(self, blocks: int) -> FloatArray:
        raise NotImplementedError


class _CoarseQueue(_Queue):
    """Coarse movement about the driver's mean; its first block belongs to step `TICKS`."""

    def __init__(
        self, model: BestModel, seed: np.random.SeedSequence, driver: Driver, factors: _Factors, past: FloatArray
    ) -> None:
        super().__init__()
        self._model, self._driver, self._factors = model, driver, factors
        self._rng = np.random.default_rng(child(seed, _COARSE))
        self._past = past
        self._held = self._steps(2 * TICKS + 1)

    def _steps(self, n: int) -> FloatArray:
        noise = self._rng.standard_normal(n) * (self._model.coarse.scale * self._factors.take(_Factors.COARSE, n))
        series = recur(self._past, noise, self._model.coarse.coefficients)
        self._past = series[n:]
        return series[len(series) - n :]

    def _make(self, blocks: int) -> FloatArray:
        steps = np.concatenate([self._held, self._steps(blocks)])
        self._held = steps[blocks:]
        return interpolate(steps) * self._driver.coarse


class _FineQueue(_Queue):
    """Fine movement; its first value is centred half a kernel after step 0."""

    def __init__(self, model: BestModel, seed: np.random.SeedSequence, driver: Driver, factors: _Factors) -> None:
        super().__init__()
        self._kernel, self._driver, self._factors = model.kernel, driver, factors
        self._rng = np.random.default_rng(child(seed, _FINE))
        self._last_factor = factors.take(_Factors.FINE, 1)
        self._noise = np.empty(0)

    def _lively_noise(self, blocks: int) -> FloatArray:
        factors = np.concatenate([self._last_factor, self._factors.take(_Factors.FINE, blocks)])
        self._last_factor = factors[-1:]
        share = np.arange(COARSE_EVERY) / COARSE_EVERY
        between = factors[:-1, None] * (1.0 - share) + factors[1:, None] * share
        return (self._rng.random(blocks * COARSE_EVERY) - 0.5) * between.reshape(-1)

    def _make(self, blocks: int) -> FloatArray:
        n = blocks * COARSE_EVERY
        lacks = n + len(self._kernel) - 1 - len(self._noise)
        noise = np.concatenate([self._noise, self._lively_noise(-(-lacks // COARSE_EVERY))])
        self._noise = noise[n:]
        return convolve(noise[: n + len(self._kernel) - 1], self._kernel) * self._driver.fine


class _Factors:
    """The wandering parts of both livelinesses, one value a coarse step; each part takes its own at its own pace."""

    COARSE, FINE = 0, 1

    def __init__(self, model: BestModel, seed: np.random.SeedSequence) -> None:
        step = model.step * COARSE_EVERY
        coarse, fine = model.coarse_liveliness, model.fine_liveliness
        self._offsets = np.array([coarse.within + coarse.slow, fine.within + fine.slow])
        self._wander = _Wander(
            np.array([coarse.within, fine.within]),
            np.exp(-step / np.array([coarse.memory, fine.memory])),
            model.correlation,
            child(seed, _LIVELINESS, 0),
        )
        self._slow = _Wander(
            np.array([coarse.slow, fine.slow]),
            np.exp(-step / np.full(2, SLOW_MEMORY)),
            model.correlation,
            child(seed, _LIVELINESS, 1),
        )
        self._made = [np.empty(0), np.empty(0)]

    def take(self, part: int, n: int) -> FloatArray:
        """Next n factors on the coarse or on the fine movement; their mean square is 1."""
        missing = n - len(self._made[part])
        if missing > 0:
            self._made = [np.concatenate(both) for both in zip(self._made, self._next(missing), strict=True)]
        taken, self._made[part] = self._made[part][:n], self._made[part][n:]
        return taken

    def _next(self, n: int) -> tuple[FloatArray, FloatArray]:
        logs = self._wander.take(n)
        if self._slow.is_needed:
            logs = logs + self._slow.take(n)
        factors = np.exp(logs - self._offsets[:, None])
        return factors[0], factors[1]


class _Wander:
    """Two correlated first-order autoregressions, stationary from the start."""

    def __init__(
        self, variance: FloatArray, keep: FloatArray, correlation: float, seed: np.random.SeedSequence
    ) -> None:
        self.is_needed = bool((variance > 0.0).any())
        self._rng = np.random.default_rng(seed)
        self._mix = np.array([correlation, np.sqrt(1.0 - correlation**2)])
        self._keep, self._gain = keep, np.sqrt(variance * (1.0 - keep**2))
        self._values = self._mixed(1)[:, 0] * np.sqrt(variance)

    def take(self, n: int) -> FloatArray:
        """Next n values of both, shape (2, n)."""
        noise = self._mixed(n) * self._gain[:, None]
        series = np.stack([recur(self._values[k : k + 1], noise[k], self._keep[k : k + 1]) for k in range(2)])
        self._values = series[:, -1].copy()
        return np.asarray(series[:, 1:])

    def _mixed(self, n: int) -> FloatArray:
        normal = self._rng.standard_normal((n, 2)).T.copy()
        normal[1] = self._mix[0] * normal[0] + self._mix[1] * normal[1]
        return normal


def _factor(variance: float, normal: FloatArray) -> FloatArray:
    """Log-normal factors of mean square 1."""
    return np.asarray(np.exp(np.sqrt(variance) * normal - variance))


def _bends(model: BestModel, first: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """Where bending begins and where it ends, to the left and to the right; both beyond where the drive starts."""
    bends = []
    for limit in model.limits:
        knee = model.mean + KNEE * (limit - model.mean)
        side = 1.0 if limit > model.mean else -1.0
        if side * (first - knee) > 0.0:
            knee = first
            limit = side * max(side * limit, side * first + HEADROOM)
        bends.append((knee, limit))
    return bends[0], bends[1]


def interpolate(steps: FloatArray) -> FloatArray:
    """Coarse steps at 1 Hz, shape (n + 2 TICKS + 1,), as 5 Hz values of n blocks, shape (n * COARSE_EVERY,)."""
    table = phases()
    n = len(steps) - len(table) + 1
    if worth_compiling(n):
        result = np.empty(n * COARSE_EVERY)
        _interpolate_compiled()(steps, table, result)
        return result
    blocks = steps[:n, None] * table[0]
    for k in range(1, len(table)):
        blocks += steps[k : k + n, None] * table[k]
    return np.asarray(blocks.reshape(-1))


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


_interpolate_compiled = Loop(_interpolate_body).compiled
