"""Slow drift: what is held for the middle of the lane wanders over minutes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.autoregression import recur
from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect
from xosc_lateral.driver.effects.running import RunningTerms

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Drift(HiddenEffect):
    """Ornstein-Uhlenbeck wander of the mean offset.

    Parameters
    ----------
    size : float
        Standard deviation. [m]
    size_error : float
        Its standard error. [m]
    correlation_s : float
        Correlation time. [s]
    """

    kind: ClassVar[str] = "drift"
    positive: ClassVar[tuple[str, ...]] = ("size", "correlation_s")
    size: float
    size_error: float = 0.0
    correlation_s: float = 300.0

    def terms(self, time: FloatArray, context: Mapping[str, FloatArray], rng: np.random.Generator) -> EffectTerms:
        """A wander of its own for every run, stationary from the start."""
        step = float(time[1] - time[0]) if len(time) > 1 else 1.0
        keep = float(np.exp(-step / self.correlation_s))
        noise = rng.standard_normal(len(time))
        noise *= self.size
        noise *= np.sqrt(1.0 - keep**2)
        noise[:1] /= np.sqrt(1.0 - keep**2)
        return EffectTerms(location=recur(np.zeros(1), noise, np.array([keep]))[1:])

    def running(self, rng: np.random.Generator) -> RunningTerms:
        """See `HiddenEffect.running`."""
        return _RunningDrift(self, rng)


class _RunningDrift:
    def __init__(self, effect: Drift, rng: np.random.Generator) -> None:
        self._effect, self._rng = effect, rng
        self._wander = 0.0
        self._keep: float | None = None

    def take(self, time: FloatArray) -> EffectTerms:
        if self._keep is None:
            keep = float(np.exp(-(time[1] - time[0]) / self._effect.correlation_s))
            noise = self._noise(len(time), keep)
            noise[0] /= np.sqrt(1.0 - keep**2)
        else:
            keep = self._keep
            noise = self._noise(len(time), keep)
        self._keep = keep
        location = np.empty(len(time))
        for row, kick in enumerate(noise.tolist()):
            self._wander = location[row] = kick + keep * self._wander
        return EffectTerms(location=location)

    def _noise(self, n: int, keep: float) -> FloatArray:
        return np.asarray(self._rng.normal(size=n) * self._effect.size * np.sqrt(1.0 - keep**2))
