"""A periodic weave."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect
from xosc_lateral.driver.effects.running import RunningTerms

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Weave(HiddenEffect):
    """A swing of constant amplitude whose phase starts anywhere and wanders.

    Parameters
    ----------
    amplitude : float
        [m]
    amplitude_error : float
        Standard error. [m]
    period_s : float
        [s]
    coherence_s : float
        Time after which the phase has drifted by one radian (standard deviation). [s]
    """

    kind: ClassVar[str] = "weave"
    positive: ClassVar[tuple[str, ...]] = ("amplitude", "period_s", "coherence_s")
    amplitude: float
    amplitude_error: float = 0.0
    period_s: float
    coherence_s: float = 1e6

    def terms(self, time: FloatArray, context: Mapping[str, FloatArray], rng: np.random.Generator) -> EffectTerms:
        """A swing with a random phase."""
        step = float(time[1] - time[0]) if len(time) > 1 else 1.0
        start = rng.random()  # before the wander: a longer drive has to begin like a shorter one
        wander = np.cumsum(rng.normal(size=len(time))) * np.sqrt(step / self.coherence_s)
        phase = 2.0 * np.pi * (start + (time - time[:1]) / self.period_s) + wander
        return EffectTerms(location=self.amplitude * np.sin(phase))

    def running(self, rng: np.random.Generator) -> RunningTerms:
        """See `HiddenEffect.running`."""
        return _RunningWeave(self, rng)


class _RunningWeave:
    def __init__(self, effect: Weave, rng: np.random.Generator) -> None:
        self._effect, self._rng = effect, rng
        self._start = rng.random()
        self._begin: float | None = None
        self._kicks = 0.0
        self._scale = 0.0

    def take(self, time: FloatArray) -> EffectTerms:
        if self._begin is None:
            self._begin = float(time[0])
            self._scale = float(np.sqrt((time[1] - time[0]) / self._effect.coherence_s))
        kicks = np.cumsum(np.concatenate([[self._kicks], self._rng.normal(size=len(time))]))[1:]
        self._kicks = float(kicks[-1])
        phase = 2.0 * np.pi * (self._start + (time - self._begin) / self._effect.period_s) + kicks * self._scale
        return EffectTerms(location=self._effect.amplitude * np.sin(phase))
