"""In proportion near the middle, levelling off at both ends."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


class Saturating(SingleColumnEffect, frozen=True, kw_only=True):
    """tanh((column - middle) / scale).

    Parameters
    ----------
    column : str
        Where it is NaN ("there is none"), nothing changes; infinity is the far end of the curve.
    middle, scale : float
        scale > 0. [unit of the column]
    """

    middle: float
    scale: float

    def __post_init__(self) -> None:
        """Refuse a scale that is not positive."""
        super().__post_init__()
        if not self.scale > 0:
            raise DriverProfileError(f"effect saturating of {self.column}: scale {self.scale} must be above 0")

    @property
    def levels_off(self) -> bool:
        """At both ends."""
        return True

    @property
    def shape(self) -> str:
        """Word for the report."""
        return f"saturating (beyond {self.middle:.4g} +- {self.scale:.3g})"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Between -1 and 1, shape (n, 1). [-]"""
        return np.asarray(np.tanh((context[self.column] - self.middle) / self.scale))[:, None]
