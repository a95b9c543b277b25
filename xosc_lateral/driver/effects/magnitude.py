"""The same to either side: strength in proportion to a column's size."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.column import ColumnEffect

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Magnitude(ColumnEffect):
    """|column|: to the left as to the right; where it is NaN ("there is none"), nothing changes."""

    kind: ClassVar[str] = "magnitude"
    column: str

    @property
    def columns(self) -> tuple[str, ...]:
        """The one column."""
        return (self.column,)

    @property
    def shape(self) -> str:
        """Word for the report."""
        return "linear in its size, to either side alike"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Size of the column, shape (n, 1)."""
        return np.abs(np.asarray(context[self.column], dtype=np.float64))[:, None]
