"""Strength in proportion to a column."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.column import ColumnEffect

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Linear(ColumnEffect):
    """As much as the column says; where it is NaN ("there is none"), nothing changes."""

    kind: ClassVar[str] = "linear"
    column: str

    @property
    def columns(self) -> tuple[str, ...]:
        """The one column."""
        return (self.column,)

    @property
    def shape(self) -> str:
        """Word for the report."""
        return "linear"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """The column, shape (n, 1)."""
        return np.asarray(context[self.column], dtype=np.float64)[:, None]
