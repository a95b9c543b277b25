"""Strength in proportion to a column."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect

FloatArray = NDArray[np.float64]


class Linear(SingleColumnEffect, frozen=True, kw_only=True):
    """As much as the column says; where it is NaN ("there is none"), nothing changes."""

    @property
    def shape(self) -> str:
        """Word for the report."""
        return "linear"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """The column, shape (n, 1). [its own unit]"""
        return np.asarray(context[self.column], dtype=np.float64)[:, None]
