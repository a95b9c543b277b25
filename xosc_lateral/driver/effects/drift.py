"""Slow drift: what is held for the middle of the lane drifts over minutes.

References
----------
D. T. Gillespie, "Exact numerical simulation of the Ornstein-Uhlenbeck process and its integral", Physical Review E 54,
1996, pp. 2084-2091.
"""

from __future__ import annotations

from typing import ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect
from xosc_lateral.driver.recursion import recur

FloatArray = NDArray[np.float64]


class DriftState(msgspec.Struct):
    """Generator, and the last value. [m]"""

    rng: np.random.Generator
    value: float = 0.0
    begun: bool = False


class Drift(HiddenEffect, frozen=True, kw_only=True):
    """Ornstein-Uhlenbeck process of the mean offset.

    Parameters
    ----------
    size : float
        Standard deviation. [m]
    size_error : float
        Its standard error. [m]
    correlation_s : float
        Correlation time. [s]
    """

    positive: ClassVar[tuple[str, ...]] = ("size", "correlation_s")
    size: float
    size_error: float = 0.0
    correlation_s: float = 300.0

    State: ClassVar[type[msgspec.Struct]] = DriftState

    def begin(self, rng: np.random.Generator, step: float) -> DriftState:
        """Stationary from the start; terms have shape (n,). `step` in [s]."""
        return DriftState(rng)

    def advance(self, state: DriftState, time: FloatArray, step: float) -> EffectTerms:
        """A path of its own for every drive, shape (n,) [m]: the Ornstein-Uhlenbeck process, sampled exactly."""
        keep = float(np.exp(-step / self.correlation_s))
        noise = state.rng.standard_normal(len(time))
        noise *= self.size
        noise *= np.sqrt(1.0 - keep**2)
        if not state.begun:
            noise[0] /= np.sqrt(1.0 - keep**2)
        location = recur(np.array([state.value]), noise, np.array([keep]))[1:]
        state.value, state.begun = float(location[-1]), True
        return EffectTerms(location=location)
