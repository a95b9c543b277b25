"""A value of its own for each level of a column of whole numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect

FloatArray = NDArray[np.float64]


class Levels(SingleColumnEffect, frozen=True, kw_only=True):
    """One coefficient for each named level; every other level is the base.

    Parameters
    ----------
    column : str
        Column of whole numbers.
    levels : tuple of float
        Those that differ from the rest. [unit of the column]
    """

    levels: tuple[float, ...]

    @property
    def shape(self) -> str:
        """Word for the report."""
        return f"levels ({', '.join(f'{level:g}' for level in self.levels)})"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """1 where the column is at the level, else 0, shape (n, number of levels). [-]"""
        values = np.rint(context[self.column])
        return np.stack([(values == level).astype(np.float64) for level in self.levels], axis=1)
