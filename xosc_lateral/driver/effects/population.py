"""Drivers that differ: each has a place and a spread of his own."""

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
class Population(HiddenEffect):
    """A driver is drawn for every run: a shift, normal, and a factor on the spread, log-normal.

    Parameters
    ----------
    shift : float
        Standard deviation of the drivers' mean offsets. [m]
    shift_error : float
        Standard error. [m]
    log_spread : float
        Standard deviation of the logarithm of the drivers' spreads. [-]
    log_fine : float
        The same of the fine noise. [-]
    """

    kind: ClassVar[str] = "population"
    shift: float
    shift_error: float = 0.0
    log_spread: float = 0.0
    log_fine: float = 0.0

    def terms(self, time: FloatArray, context: Mapping[str, FloatArray], rng: np.random.Generator) -> EffectTerms:
        """One driver for the whole run."""
        return self.terms_of(self.driver(rng), len(time))

    def driver(self, rng: np.random.Generator) -> tuple[float, float, float]:
        """Draw one: shift [m], factor on the spread, factor on the fine noise."""
        shift, spread, fine = rng.normal(size=3) * (self.shift, self.log_spread, self.log_fine)
        return float(shift), float(np.exp(spread)), float(np.exp(fine))

    def terms_of(self, driver: tuple[float, float, float], n: int) -> EffectTerms:
        """The driver's terms for n rows."""
        shift, spread, fine = driver
        return EffectTerms(location=np.full(n, shift), spread=np.full(n, spread), fine=np.full(n, fine))

    def running(self, rng: np.random.Generator) -> RunningTerms:
        """See `HiddenEffect.running`."""
        return _RunningDriver(self, rng)


class _RunningDriver:
    def __init__(self, effect: Population, rng: np.random.Generator) -> None:
        self._effect, self._driver = effect, effect.driver(rng)

    def take(self, time: FloatArray) -> EffectTerms:
        return self._effect.terms_of(self._driver, len(time))
