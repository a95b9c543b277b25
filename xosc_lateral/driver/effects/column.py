"""What all effects of context columns share: a quantity, the driver's response to it, and how strong it acts."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects.acts import Acts, terms_of
from xosc_lateral.driver.effects.base import EffectTerms
from xosc_lateral.driver.effects.response import respond
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ColumnEffect(ABC):
    """A dependence on context columns: strength = coefficients . (respond(quantity) - reference).

    Parameters
    ----------
    acts : Acts
        What it changes.
    coefficients : tuple of float
        One per component of the quantity; [m] per unit of it for location, else natural logarithm per unit.
    errors : tuple of float
        Standard errors of the coefficients.
    lag_s, response_s : float
        Delay (negative: looks ahead) and first-order lag of the answer. [s]
    reference : tuple of float
        Value of the quantity at which nothing changes: its mean over the drives it was fitted on.

    Raises
    ------
    DriverProfileError
        If the lengths disagree, a number is not finite, or the response time is negative.

    Notes
    -----
    A table without one of the columns leaves the movement unchanged; `EffectTerms` is then empty.
    """

    kind: ClassVar[str]
    acts: Acts
    coefficients: tuple[float, ...] = ()
    errors: tuple[float, ...] = ()
    lag_s: float = 0.0
    response_s: float = 0.0
    reference: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Coerce and validate once."""
        object.__setattr__(self, "acts", Acts(self.acts))
        for name in ("coefficients", "errors", "reference"):
            object.__setattr__(self, name, tuple(float(value) for value in getattr(self, name)))
        numbers = (*self.coefficients, *self.errors, *self.reference, self.lag_s, self.response_s)
        if not np.isfinite(numbers).all() or self.response_s < 0:
            raise DriverProfileError(
                f"effect {self.kind}: {numbers} has a number that is not finite, or a response below 0 s"
            )
        if len({len(self.coefficients), len(self.errors), len(self.reference)}) != 1:
            raise DriverProfileError(f"effect {self.kind}: as many coefficients as errors and references are needed")

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """Context columns that it reads."""

    @property
    @abstractmethod
    def shape(self) -> str:
        """Word for the report: linear, threshold, saturating, product, levels, angular ..."""

    @abstractmethod
    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Driving quantity before the response, shape (n, k); NaN where "there is none" and that is neutral."""

    def answer(self, step: float, context: Mapping[str, FloatArray]) -> FloatArray:
        """Driving quantity as the driver answers to it, shape (n, k), on a grid of the given step [s]."""
        values = self.quantity(context)
        missing = np.isnan(values)
        if missing.any():
            stand_in = self.reference if self.reference else tuple(_finite_mean(column) for column in values.T)
            values = np.where(missing, np.asarray(stand_in), values)
        return respond(values, step, self.lag_s, self.response_s)

    def strength(self, step: float, context: Mapping[str, FloatArray]) -> FloatArray | None:
        """[m] or natural logarithm of a factor, shape (n,); None when a column is missing."""
        if any(column not in context for column in self.columns):
            return None
        return self.weighed(self.answer(step, context))

    def weighed(self, answer: FloatArray) -> FloatArray:
        """Strength of answers, shape (n, k): coefficients . (answer - reference), shape (n,)."""
        if answer.shape[1] == len(self.coefficients) == 1:  # most effects; a matrix product takes five times as long
            return np.asarray((answer[:, 0] - self.reference[0]) * self.coefficients[0])
        return np.asarray((answer - np.asarray(self.reference)) @ np.asarray(self.coefficients))

    def terms(self, time: FloatArray, context: Mapping[str, FloatArray], rng: np.random.Generator) -> EffectTerms:
        """Evaluate on a uniform time grid; `rng` is left untouched."""
        strength = self.strength(_step(time), context)
        return EffectTerms() if strength is None else terms_of(self.acts, strength)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        plain = {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}
        return {"kind": self.kind, **plain, "acts": self.acts.value}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Read back what `to_dict` gave."""
        known = {item.name for item in fields(cls)}
        values: dict[str, Any] = {name: value for name, value in data.items() if name != "kind"}
        if unknown := sorted(set(values) - known):
            raise DriverProfileError(f"effect {cls.kind}: unknown field {unknown[0]!r}")
        try:
            plain: dict[str, Any] = {
                key: tuple(value) if isinstance(value, list) else value for key, value in values.items()
            }
            return cls(**plain)
        except (TypeError, ValueError) as error:
            raise DriverProfileError(f"effect {cls.kind}: {error}") from error


def _step(time: FloatArray) -> float:
    return float(time[1] - time[0]) if len(time) > 1 else 1.0


def _tupled(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _finite_mean(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else 0.0
