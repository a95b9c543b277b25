"""An effect of one's own: it goes up and down with a column, as none of the package's effects does."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drivers.model.effects import Acts, ColumnEffect

FloatArray = NDArray[np.float64]

PERIODS = (1.0, 2.0, 4.0)
"""That our quantities are known to come in."""


class Ripple(ColumnEffect, frozen=True, kw_only=True):
    """Strength in proportion to the cosine of a column.

    Parameters
    ----------
    column : str
    period : float
        In the column's unit.
    """

    column: str
    period: float

    @property
    def columns(self) -> tuple[str, ...]:
        """The one column."""
        return (self.column,)

    @property
    def shape(self) -> str:
        """Word for the report."""
        return "ripple"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Cosine, shape (n, 1)."""
        return np.asarray(np.cos(2.0 * np.pi / self.period * np.asarray(context[self.column])))[:, None]

    @classmethod
    def proposals(cls, column: str, values: FloatArray) -> Iterator[Ripple]:
        """What `close-loop` tries on a column, shape (n,): periods that fit into its range at least twice."""
        low, high = np.nanquantile(values, [0.02, 0.98])
        for period in PERIODS:
            if high - low > 2.0 * period:
                yield cls(acts=Acts.LOCATION, column=column, period=period)
