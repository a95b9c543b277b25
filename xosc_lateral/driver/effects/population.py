"""Drivers that differ: each has a place and a spread of his own."""

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
        ones = np.ones(len(time))
        shift, spread, fine = rng.normal(size=3) * (self.shift, self.log_spread, self.log_fine)
        return EffectTerms(location=shift * ones, spread=np.exp(spread) * ones, fine=np.exp(fine) * ones)
