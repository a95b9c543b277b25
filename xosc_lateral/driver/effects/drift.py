"""Slow drift: what is held for the middle of the lane wanders over minutes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect

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
        from scipy.signal import lfilter

        step = float(time[1] - time[0]) if len(time) > 1 else 1.0
        keep = float(np.exp(-step / self.correlation_s))
        noise = rng.normal(size=len(time)) * self.size * np.sqrt(1.0 - keep**2)
        noise[:1] /= np.sqrt(1.0 - keep**2)
        return EffectTerms(location=np.asarray(lfilter([1.0], [1.0, -keep], noise)))
