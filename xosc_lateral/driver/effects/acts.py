"""What an effect acts on, and how its strength becomes terms of the movement.

References
----------
.. [1] A. C. Harvey, "Estimating regression models with multiplicative heteroscedasticity", Econometrica 44, 1976:
       log-linear factors.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms

FloatArray = NDArray[np.float64]

FACTOR_LIMIT = 5.0
"""A factor on spread, rate of mean reversion or fine noise stays within 1/5..5: beyond the fitted range
of its column a log-linear effect would run away. [-]"""

LOG_LIMIT = float(np.log(FACTOR_LIMIT))
"""[-]"""


class Acts(StrEnum):
    """Part of the movement that an effect changes; its strength is [m] for location, else a natural logarithm."""

    LOCATION = "location"
    SPREAD = "spread"
    RATE = "rate"
    FINE = "fine"


def terms_of(acts: Acts, strength: FloatArray) -> EffectTerms:
    """Terms of an effect of the given strength, shape (n,): added [m] for location, its exponential [-] for factors."""
    if acts is Acts.LOCATION:
        return EffectTerms(location=strength)
    factor = np.exp(np.minimum(np.maximum(strength, -LOG_LIMIT), LOG_LIMIT))  # np.clip takes five times as long
    if acts is Acts.SPREAD:
        return EffectTerms(spread=factor)
    return EffectTerms(rate=factor) if acts is Acts.RATE else EffectTerms(fine=factor)
