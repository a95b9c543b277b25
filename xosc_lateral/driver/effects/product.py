"""Two columns that act together: each alone may do nothing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.column import ColumnEffect
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


class Form(StrEnum):
    """How a column enters a product."""

    VALUE = "value"
    SINE = "sine"
    COSINE = "cosine"
    EQUALS = "equals"
    NEARNESS = "nearness"
    PRESENCE = "presence"


@dataclass(frozen=True, kw_only=True)
class Factor:
    """One of the two.

    Parameters
    ----------
    column : str
        Context column.
    form : Form
        How it enters.
    at : float
        Full circle for sine and cosine, the level for equals, the scale for nearness; unused otherwise.
    """

    column: str
    form: Form = Form.VALUE
    at: float = 0.0

    def values(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Shape (n,); NaN only where a value is NaN ("there is none")."""
        column = context[self.column]
        if self.form is Form.SINE:
            return np.asarray(np.sin(2.0 * np.pi / self.at * column))
        if self.form is Form.COSINE:
            return np.asarray(np.cos(2.0 * np.pi / self.at * column))
        if self.form is Form.EQUALS:
            return np.asarray(np.rint(column) == self.at, dtype=np.float64)
        if self.form is Form.PRESENCE:
            return np.asarray(np.isfinite(column), dtype=np.float64)
        if self.form is Form.NEARNESS:
            near = self.at / np.maximum(np.abs(column), self.at)
            return np.nan_to_num(near, nan=0.0)
        return np.asarray(column, dtype=np.float64)

    def __str__(self) -> str:
        words = {Form.VALUE: "{c}", Form.SINE: "sin({c})", Form.COSINE: "cos({c})", Form.EQUALS: "[{c} = {a:g}]"}
        return words.get(self.form, "{f}({c})").format(c=self.column, a=self.at, f=self.form.value)


@dataclass(frozen=True, kw_only=True)
class Product(ColumnEffect):
    """The product of two factors; where either is NaN ("there is none"), nothing changes."""

    kind: ClassVar[str] = "product"
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
        """Shape (n, 1)."""
        first, second = (factor.values(context) for factor in self.factors)
        return (first * second)[:, None]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        data = super().to_dict()
        return data | {"factors": [asdict(factor) | {"form": factor.form.value} for factor in self.factors]}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Read back what `to_dict` gave."""
        try:
            factors = tuple(
                Factor(column=f["column"], form=Form(f["form"]), at=float(f["at"])) for f in data["factors"]
            )
        except (KeyError, TypeError, ValueError) as error:
            raise DriverProfileError(f"effect product: factors {data.get('factors')!r} can't be read") from error
        if len(factors) != 2:
            raise DriverProfileError(f"effect product: {len(factors)} factors, 2 are needed")
        return super().from_dict(dict(data) | {"factors": factors})
