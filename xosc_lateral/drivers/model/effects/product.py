"""Two columns that act together: each alone may do nothing.

References
----------
.. [1] L. S. Aiken, S. G. West, "Multiple Regression: Testing and Interpreting Interactions", 1991: centred factors.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.effects.column import ColumnEffect
from xosc_lateral.drivers.model.effects.shapes import level_share, nearness, presence, proximity
from xosc_lateral.drivers.model.records import Record


class Form(StrEnum):
    """How a column enters a product."""

    VALUE = "value"
    SINE = "sine"
    COSINE = "cosine"
    EQUALS = "equals"
    NEARNESS = "nearness"
    PRESENCE = "presence"
    PROXIMITY = "proximity"


class Factor(Record, frozen=True, kw_only=True):
    """One of the two: a context column, and how it enters.

    `at` is the full circle for sine and cosine, the level for equals, the scale for nearness and proximity, the centre
    (where the other column does nothing) for value; in the column's unit.
    """

    column: str
    form: Form = Form.VALUE
    at: float = 0.0

    def values(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Shape (n,), [-] or in the column's unit; NaN only where a value is NaN ("there is none")."""
        column = context[self.column]
        if self.form is Form.SINE:
            return np.asarray(np.sin(2.0 * np.pi / self.at * column))
        if self.form is Form.COSINE:
            return np.asarray(np.cos(2.0 * np.pi / self.at * column))
        if self.form is Form.EQUALS:
            return level_share(np.asarray(column, dtype=np.float64), self.at)
        if self.form is Form.PRESENCE:
            return presence(column)
        if self.form is Form.NEARNESS:
            return nearness(column, self.at)
        if self.form is Form.PROXIMITY:
            return proximity(column, self.at)
        return np.asarray(column, dtype=np.float64) - self.at

    def __str__(self) -> str:
        words = {Form.VALUE: "{c}", Form.SINE: "sin({c})", Form.COSINE: "cos({c})", Form.EQUALS: "[{c} = {a:g}]"}
        if self.form is Form.VALUE and self.at:
            return f"({self.column} - {self.at:.4g})"
        return words.get(self.form, "{f}({c})").format(c=self.column, a=self.at, f=self.form.value)


class Product(ColumnEffect, frozen=True, kw_only=True):
    """The product of two factors; where either is NaN ("there is none"), nothing changes."""

    factors: tuple[Factor, Factor]

    @property
    def columns(self) -> tuple[str, ...]:
        """The two columns."""
        return tuple(factor.column for factor in self.factors)

    @property
    def shape(self) -> str:
        """Word for the report."""
        return f"product ({self.factors[0]} x {self.factors[1]})"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Product of both, shape (n, 1). [product of the factors' units]"""
        first, second = (factor.values(context) for factor in self.factors)
        return (first * second)[:, None]
