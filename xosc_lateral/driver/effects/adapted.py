"""A movement that is another's: shifted, and larger or smaller, faster or slower by factors that never change."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.acts import FACTOR_LIMIT
from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect, NoState
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


class Adapted(HiddenEffect, frozen=True, kw_only=True):
    """What makes another driver of a profile's (`driver.derive`).

    Parameters
    ----------
    shift : float
        Of the mean offset, positive left. [m]
    spread, rate, fine : float
        Factors on the coarse movement, on its rate and on the fine movement, as of `EffectTerms`; 1/5 to 5. [-]
    """

    positive: ClassVar[tuple[str, ...]] = ("spread", "rate", "fine")
    shift: float = 0.0
    spread: float = 1.0
    rate: float = 1.0
    fine: float = 1.0

    def __post_init__(self) -> None:
        """Check the factors' range."""
        super().__post_init__()
        for name in self.positive:
            if not 1.0 / FACTOR_LIMIT <= getattr(self, name) <= FACTOR_LIMIT:
                raise DriverProfileError(
                    f"effect adapted: {name} {getattr(self, name):g}, expected {1 / FACTOR_LIMIT:g} to {FACTOR_LIMIT:g}"
                )

    def advance(self, state: NoState, time: FloatArray, step: float) -> EffectTerms:
        """The same at all times, shape (n,): shift [m], factors [-]; what is 1 is left out."""
        one = np.ones(len(time))
        spread, rate, fine = (None if factor == 1.0 else factor * one for factor in (self.spread, self.rate, self.fine))
        return EffectTerms(self.shift * one, spread, rate, fine)
