"""The same to either side: strength in proportion to a column's size."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect

FloatArray = NDArray[np.float64]


class Magnitude(SingleColumnEffect, frozen=True, kw_only=True):
    """|column|: to the left as to the right; where it is NaN ("there is none"), nothing changes."""

    @property
    def shape(self) -> str:
        """Word for the report."""
        return "linear in its size, to either side alike"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Size of the column, shape (n, 1), >= 0. [its own unit]"""
        return np.abs(np.asarray(context[self.column], dtype=np.float64))[:, None]
