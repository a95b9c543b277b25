"""A step: from one moment on, everything is measured (or driven) elsewhere, as after a recalibrated camera.

References
----------
.. [1] G. E. P. Box, G. C. Tiao, "Intervention analysis with applications to economic and environmental problems", J.
       American Statistical Association 70, 1975.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect, NoState

FloatArray = NDArray[np.float64]


class Step(HiddenEffect, frozen=True, kw_only=True):
    """The mean offset jumps once.

    Parameters
    ----------
    size : float
        Positive: to the left. [m]
    size_error : float
        Standard error. [m]
    at_s : float
        When, in the drive's clock. [s]
    share_before : float
        Share of the fitted drive before the jump: the mean over the drive stays unchanged. [-]
    """

    size: float
    size_error: float = 0.0
    at_s: float = 0.0
    share_before: float = 0.5

    def advance(self, state: NoState, time: FloatArray, step: float) -> EffectTerms:
        """Below the mean before, above after, shape (n,) [m]; nothing is random."""
        after = (time >= self.at_s).astype(np.float64)
        return EffectTerms(location=self.size * (after - (1.0 - self.share_before)))
