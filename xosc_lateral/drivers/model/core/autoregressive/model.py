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

from typing import ClassVar

import msgspec
import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.core.autoregressive.coarse import COARSE_EVERY, TICKS
from xosc_lateral.drivers.model.core.autoregressive.parameters import (
    AutoregressiveParameters,
    DriverState,
    draw_drivers,
)
from xosc_lateral.drivers.model.core.autoregressive.parts import (
    CoarsePart,
    CoarseState,
    Factors,
    FactorState,
    FinePart,
    FineState,
    begin_factors,
)
from xosc_lateral.drivers.model.core.base import ClockState, Start, take_at_rate
from xosc_lateral.drivers.model.seeds import AutoregressiveSeed, generator

KNEE = 0.8
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
        past = self.start_factor @ setup.standard_normal((self.coarse.order, m))
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
        knee = model.mean + KNEE * (limit - model.mean)
        outside = side * (first - knee) > 0.0
        knees[row] = np.where(outside, first, knee)
        limits[row] = np.where(outside, side * np.maximum(side * limit, side * first + HEADROOM), limit)
    return knees, limits
