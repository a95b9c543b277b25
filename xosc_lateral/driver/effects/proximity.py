"""A neighbour's influence that fades with distance and is gone beyond: none where there is none."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


class Proximity(SingleColumnEffect, frozen=True, kw_only=True):
    """exp(-|distance| / scale): 1 alongside, 0 far away and where there is none (NaN).

    Parameters
    ----------
    column : str
        A distance, of either sign; NaN: there is none.
    scale : float
        Distance over which the influence falls to 37 %; > 0. [unit of the column]
    """

    scale: float

    def __post_init__(self) -> None:
        """Refuse a scale that is not positive."""
        super().__post_init__()
        if not self.scale > 0:
            raise DriverProfileError(f"effect proximity of {self.column}: scale {self.scale} must be above 0")

    @property
    def shape(self) -> str:
        """Word for the report."""
        return f"proximity (fades over {self.scale:.3g})"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """From 0 (none) to 1 (alongside), shape (n, 1)."""
        return np.nan_to_num(np.exp(-np.abs(np.asarray(context[self.column])) / self.scale), nan=0.0)[:, None]
