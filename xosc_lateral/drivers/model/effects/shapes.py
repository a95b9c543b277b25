"""Effects of one context column, or of two together: how strength follows from them; NaN ("none") changes nothing.

References
----------
.. [1] C. de Boor, "A Practical Guide to Splines", 1978, chapter VIII: truncated powers, of first degree in `Piecewise`.
.. [2] K. V. Mardia, P. E. Jupp, "Directional Statistics", 2000: regression on sine and cosine of an angle, `Angular`.
.. [3] L. S. Aiken, S. G. West, "Multiple Regression: Testing and Interpreting Interactions", 1991: centred factors.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from itertools import pairwise
from typing import Annotated, ClassVar

import numpy as np
from msgspec import Meta

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.model.effects.base import ColumnEffect
from xosc_lateral.drivers.model.records import Record, set_once


class SingleColumnEffect(ColumnEffect, frozen=True, kw_only=True):
    """An effect of one column. Raises `DriverProfileError` if a field in `positive` is not above 0."""

    positive: ClassVar[tuple[str, ...]] = ()

    column: str

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.positive:
            if not getattr(self, name) > 0:
                raise DriverProfileError(
                    f"effect {self.kind} of {self.column}: {name} {getattr(self, name)} must be above 0"
                )

    @property
    def columns(self) -> tuple[str, ...]:
        """The one column."""
        return (self.column,)

    def values(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """The column, shape (n,). [its own unit]"""
        return np.asarray(context[self.column], dtype=np.float64)


class Linear(SingleColumnEffect, frozen=True, kw_only=True):
    """As much as the column says."""

    words: ClassVar[str] = "linear"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """The column, shape (n, 1). [its own unit]"""
        return self.values(context)[:, None]


class Magnitude(SingleColumnEffect, frozen=True, kw_only=True):
    """|column|: to the left as to the right."""

    words: ClassVar[str] = "linear in its size, to either side alike"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Size of the column, shape (n, 1), >= 0. [its own unit]"""
        return np.abs(self.values(context))[:, None]


class Saturating(SingleColumnEffect, frozen=True, kw_only=True):
    """tanh((column - middle) / scale), scale > 0 [both in the column's unit]; infinity is the far end of the curve."""

    words: ClassVar[str] = "saturating (beyond {0.middle:.4g} +- {0.scale:.3g})"
    positive: ClassVar[tuple[str, ...]] = ("scale",)

    middle: float
    scale: float

    @property
    def shape(self) -> str:
        """Word for the report; of a held one the side of its peak counts."""
        beyond = self.scale * float(np.arctanh(min(self.episode, 1.0 - 1e-9)))
        return f"side of the last peak beyond {beyond:.3g}, held until the next" if self.episode else super().shape

    @property
    def levels_off(self) -> bool:
        """At both ends."""
        return True

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Between -1 and 1, shape (n, 1). [-]"""
        return np.asarray(np.tanh((context[self.column] - self.middle) / self.scale))[:, None]


class Threshold(SingleColumnEffect, frozen=True, kw_only=True):
    """Acts beyond a limit only; NaN counts as on the side that does not act."""

    at: Annotated[float, Meta(description="The limit. [unit of the column]")]
    above: Annotated[bool, Meta(description="Whether it acts above the limit, or below.")] = True
    jump: Annotated[bool, Meta(description="As a whole at once; else in proportion to the distance beyond.")] = True

    @property
    def levels_off(self) -> bool:
        """A step does."""
        return self.jump

    @property
    def shape(self) -> str:
        """Word for the report."""
        return f"threshold ({'step' if self.jump else 'hinge'} {'above' if self.above else 'below'} {self.at:.4g})"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """0 on the quiet side, 1 [-] or the distance from the limit [column's unit] on the other; shape (n, 1)."""
        beyond = (context[self.column] - self.at) * (1.0 if self.above else -1.0)
        with np.errstate(invalid="ignore"):
            return np.where(beyond > 0, 1.0 if self.jump else beyond, 0.0)[:, None]


class Piecewise(SingleColumnEffect, frozen=True, kw_only=True):
    """A polygon over the column, straight on beyond the outermost of its increasing knots [unit of the column].

    The first coefficient is the slope up to the first knot, each further one the change of slope at a knot.
    """

    knots: tuple[float, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        set_once(self, knots=tuple(float(knot) for knot in self.knots))
        if not self.knots or not all(low < high for low, high in pairwise(self.knots)):
            raise DriverProfileError(f"effect piecewise of {self.column}: knots {self.knots} must increase")

    @property
    def shape(self) -> str:
        """Word for the report."""
        return f"curve (bends at {', '.join(f'{knot:.4g}' for knot in self.knots)})"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """The column, and how far it is beyond each knot, shape (n, number of knots + 1). [the column's unit]"""
        values = self.values(context)
        return np.stack(
            [values, *(np.where(values > knot, values - knot, 0.0 * values) for knot in self.knots)], axis=1
        )


class Levels(SingleColumnEffect, frozen=True, kw_only=True):
    """One coefficient for each of some levels of a column of whole numbers; every other level is the base.

    Between levels, while the column changes, as near as it is. Raises `DriverProfileError` without a level, or without
    a coefficient for each.
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
        values = self.values(context)
        return np.stack([level_share(values, level) for level in self.levels], axis=1)


class Nearness(SingleColumnEffect, frozen=True, kw_only=True):
    """scale / max(|distance|, scale): 1 from touching up to `scale` [unit of the column], fading beyond.

    With `presence` 1 wherever there is one, at whatever distance; 0 where there is none (NaN).
    """

    scale: float = 1.0
    presence: bool = False

    @property
    def shape(self) -> str:
        """Word for the report."""
        return "presence" if self.presence else "nearness (1 / distance)"

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """From 0 (none) to 1, shape (n, 1). [-]"""
        column = context[self.column]
        return (presence(column) if self.presence else nearness(column, self.scale))[:, None]


class Proximity(SingleColumnEffect, frozen=True, kw_only=True):
    """exp(-|distance| / scale): 1 alongside, 37 % at `scale` > 0 [unit of the column], 0 where there is none (NaN)."""

    words: ClassVar[str] = "proximity (fades over {0.scale:.3g})"
    positive: ClassVar[tuple[str, ...]] = ("scale",)

    scale: float

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """From 0 (none) to 1 (alongside), shape (n, 1). [-]"""
        return proximity(context[self.column], self.scale)[:, None]


class Angular(SingleColumnEffect, frozen=True, kw_only=True):
    """Sine and cosine of an angle, a coefficient each; full circle 360 deg or 2 pi rad, in the column's unit."""

    words: ClassVar[str] = "angular"

    period: float = 360.0

    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Sine and cosine, shape (n, 2), within -1..1. [-]"""
        angle = 2.0 * np.pi / self.period * context[self.column]
        return np.stack([np.sin(angle), np.cos(angle)], axis=1)


def level_share(values: FloatArray, level: float) -> FloatArray:
    """How far whole numbers are at a level, shape (n,): between two, as a scenario's lanes come and go. [-]"""
    return np.nan_to_num(np.clip(1.0 - np.abs(values - level), 0.0, 1.0), nan=0.0)


def presence(distance: FloatArray) -> FloatArray:
    """1 where there is somebody, 0 where not (NaN, infinite), shape (n,). [-]"""
    return np.asarray(np.isfinite(distance), dtype=np.float64)


def nearness(distance: FloatArray, scale: float) -> FloatArray:
    """scale / max(|distance|, scale), 0 where there is nobody, shape (n,). [-]"""
    return np.nan_to_num(scale / np.maximum(np.abs(distance), scale), nan=0.0)


def proximity(distance: FloatArray, scale: float) -> FloatArray:
    """exp(-|distance| / scale), 0 where there is nobody, shape (n,). [-]"""
    return np.nan_to_num(np.exp(-np.abs(distance) / scale), nan=0.0)


# ---- Two columns that act together: each alone may do nothing ----
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
