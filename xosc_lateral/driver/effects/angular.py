"""Strength by a direction: an angle has no beginning and no end.

References
----------
.. [1] K. V. Mardia, P. E. Jupp, "Directional Statistics", 2000: regression on sine and cosine of an angle.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect

FloatArray = NDArray[np.float64]


class Angular(SingleColumnEffect, frozen=True, kw_only=True):
    """Sine and cosine of an angle, a coefficient each.

    Parameters
    ----------
    column : str
        Where it is NaN ("there is none"), nothing changes.
    period : float
        Full circle in the column's unit: 360 deg or 2 pi rad.
    """

    period: float = 360.0

    @property
    def shape(self) -> str:
        """Word for the report."""
        return "angular"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Sine and cosine, shape (n, 2), within -1..1. [-]"""
        angle = 2.0 * np.pi / self.period * context[self.column]
        return np.stack([np.sin(angle), np.cos(angle)], axis=1)
