"""On/off regimes: at times the driver is another one, distracted say."""

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
class Regimes(HiddenEffect):
    """A two-state Markov process multiplies the spread while it is on.

    Parameters
    ----------
    factor : float
        Spread in the on regime over spread in the off regime. [-]
    factor_error : float
        Standard error. [-]
    fine_factor : float
        The same for the fine noise. [-]
    on_s, off_s : float
        Mean length of either regime. [s]
    """

    kind: ClassVar[str] = "regimes"
    positive: ClassVar[tuple[str, ...]] = ("factor", "fine_factor", "on_s", "off_s")
    factor: float
    factor_error: float = 0.0
    fine_factor: float = 1.0
    on_s: float
    off_s: float

    def terms(self, time: FloatArray, context: Mapping[str, FloatArray], rng: np.random.Generator) -> EffectTerms:
        """Regimes with exponential lengths; the first is drawn from the long-run share."""
        on = self.states(time, rng)
        return self.terms_where(on)

    def terms_where(self, on: NDArray[np.bool_]) -> EffectTerms:
        """Terms for given regimes, shape of `on`."""
        return EffectTerms(spread=np.where(on, self.factor, 1.0), fine=np.where(on, self.fine_factor, 1.0))

    def running(self, rng: np.random.Generator) -> RunningTerms:
        """See `HiddenEffect.running`."""
        return _RunningRegimes(self, rng)

    def states(self, time: FloatArray, rng: np.random.Generator) -> NDArray[np.bool_]:
        """Whether the regime is on, shape of `time`."""
        duration = float(time[-1] - time[0]) if len(time) else 0.0
        first = bool(rng.random() < self.on_s / (self.on_s + self.off_s))
        ends, end, on = [], 0.0, first
        while end <= duration:
            end += float(rng.exponential(self.on_s if on else self.off_s))
            ends.append(end)
            on = not on
        switched = np.searchsorted(np.asarray(ends), time - time[:1], side="right") % 2 == 1
        return np.asarray(switched ^ first)


class _RunningRegimes:
    def __init__(self, effect: Regimes, rng: np.random.Generator) -> None:
        self._effect, self._rng = effect, rng
        self._on = bool(rng.random() < effect.on_s / (effect.on_s + effect.off_s))
        self._end = self._length()
        self._begin: float | None = None

    def take(self, time: FloatArray) -> EffectTerms:
        if self._begin is None:
            self._begin = float(time[0])
        on = np.empty(len(time), dtype=np.bool_)
        for row, elapsed in enumerate((time - self._begin).tolist()):
            while elapsed >= self._end:
                self._on = not self._on
                self._end += self._length()
            on[row] = self._on
        return self._effect.terms_where(on)

    def _length(self) -> float:
        return float(self._rng.exponential(self._effect.on_s if self._on else self._effect.off_s))
