"""Variance trend: the movement grows with time on the road; fatigue, say.

Our own form: the logarithm of the spread is linear in time, the one form of a factor that depends on no choice of zero.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.hidden import HiddenEffect, NoState

FloatArray = NDArray[np.float64]


class VarianceTrend(HiddenEffect, frozen=True, kw_only=True):
    """Spread and fine noise change steadily with time on the road; outside the fitted time the outermost value holds.

    Parameters
    ----------
    factor : float
        Spread at `to_s` over spread at `from_s`, > 0. [-]
    factor_error : float
        Standard error. [-]
    fine_factor : float
        The same for the fine noise. [-]
    from_s, to_s : float
        Time that it was fitted on, in the drive's clock. [s]
    """

    positive: ClassVar[tuple[str, ...]] = ("factor", "fine_factor")
    factor: float
    factor_error: float = 0.0
    fine_factor: float = 1.0
    from_s: float = 0.0
    to_s: float = 3600.0

    def advance(self, state: NoState, time: FloatArray, step: float) -> EffectTerms:
        """1 in the middle of the fitted time, shape (n,) [-]; nothing is random."""
        share = np.clip((time - self.from_s) / max(self.to_s - self.from_s, 1e-9), 0.0, 1.0) - 0.5
        return EffectTerms(spread=self.factor**share, fine=self.fine_factor**share)
