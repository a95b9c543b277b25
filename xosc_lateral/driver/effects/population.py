"""Drivers that differ: each has a place and a spread of his own.

References
----------
.. [1] N. M. Laird, J. H. Ware, "Random-effects models for longitudinal data", Biometrics 38, 1982.
"""

from __future__ import annotations

from typing import ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect

FloatArray = NDArray[np.float64]


class PopulationState(msgspec.Struct):
    """One driver: shift [m], factor on the spread and on the fine noise [-]."""

    shift: float
    spread: float
    fine: float


class Population(HiddenEffect, frozen=True, kw_only=True):
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

    shift: float
    shift_error: float = 0.0
    log_spread: float = 0.0
    log_fine: float = 0.0

    State: ClassVar[type[msgspec.Struct]] = PopulationState

    def begin(self, rng: np.random.Generator, step: float) -> PopulationState:
        """Draw a driver; terms have shape (n,). `step` in [s]."""
        shift, spread, fine = rng.normal(size=3) * (self.shift, self.log_spread, self.log_fine)
        return PopulationState(float(shift), float(np.exp(spread)), float(np.exp(fine)))

    def advance(self, state: PopulationState, time: FloatArray, step: float) -> EffectTerms:
        """One driver for the whole drive: shift [m], factors [-], shape (n,)."""
        n = len(time)
        return EffectTerms(np.full(n, state.shift), np.full(n, state.spread), None, np.full(n, state.fine))
