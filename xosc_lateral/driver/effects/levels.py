"""A value of its own for each level of a column of whole numbers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.single_column import SingleColumnEffect
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


class Levels(SingleColumnEffect, frozen=True, kw_only=True):
    """One coefficient for each named level; every other level is the base. Between levels, as near as it is.

    Parameters
    ----------
    column : str
        Column of whole numbers, or between them while it changes.
    levels : tuple of float
        Those that differ from the rest. [unit of the column]

    Raises
    ------
    DriverProfileError
        No level, or not a coefficient for each.
    """

    levels: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.levels or len(self.coefficients) not in (0, len(self.levels)):
            raise DriverProfileError(
                f"effect {self.kind} by {self.column}: {len(self.levels)} levels, {len(self.coefficients)} coefficients"
            )

    @property
    def shape(self) -> str:
        """Word for the report."""
        return f"levels ({', '.join(f'{level:g}' for level in self.levels)})"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """1 where the column is at the level, 0 from 1 away on, shape (n, number of levels). [-]"""
        values = np.asarray(context[self.column], dtype=np.float64)
        return np.stack([level_share(values, level) for level in self.levels], axis=1)


def level_share(values: FloatArray, level: float) -> FloatArray:
    """How far whole numbers are at a level, shape (n,): between two, as a scenario's lanes come and go. [-]"""
    return np.nan_to_num(np.clip(1.0 - np.abs(values - level), 0.0, 1.0), nan=0.0)
