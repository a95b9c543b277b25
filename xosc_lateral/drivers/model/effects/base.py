"""What an effect is: a dependence of the offset on context, time or hidden state that a profile can hold.

References
----------
.. [1] N. Neis, J. Beyerer, "A two-level stochastic model for the lateral movement of vehicles within their lane", IEEE
       ITSC 2023, pp. 1896-1903, arXiv:2405.17080: coarse and fine part, which effects change.
.. [2] A. C. Harvey, "Estimating regression models with multiplicative heteroscedasticity", Econometrica 44, 1976:
       log-linear factors.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, ClassVar

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.drivers.model.records import Record, kebab


@dataclass(frozen=True, eq=False, slots=True)
class EffectTerms:
    """What effects do to the base movement, sample by sample, shape (n,) each. A term that is None changes nothing.

    The offset of a profile with effects is, with m the base model's mean and kappa, phi its coarse and fine part [m]::

        offset = location + m + spread * (kappa(tau) - m) + fine * phi,    d tau / dt = rate

    `location` is in [m]; the others are factors > 0 [-]. A `rate` of 2 restores the mean twice as fast.
    """

    location: FloatArray | None = None
    spread: FloatArray | None = None
    rate: FloatArray | None = None
    fine: FloatArray | None = None

    def rows(self, rows: slice | IntArray) -> EffectTerms:
        """The same at some rows. Shape of `rows` each. [m], [-]"""
        return EffectTerms(*(None if value is None else value[rows] for value in self.parts))

    @property
    def parts(self) -> tuple[FloatArray | None, ...]:
        """All of them, in the order of the fields. [m], [-]"""
        return self.location, self.spread, self.rate, self.fine


class Effect(Record, frozen=True, kw_only=True, tag_field="kind", tag=kebab):
    """One effect, frozen: a `ColumnEffect` or a `HiddenEffect`; parameters and their uncertainty are its fields."""

    kind: ClassVar[str]  # Name in the profile file: the class's, in lower case with hyphens.

    def __init_subclass__(cls, **settings: Any) -> None:
        super().__init_subclass__(**settings)
        cls.kind = kebab(cls.__name__)

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """Context columns that it reads; empty for a hidden effect."""
        raise NotImplementedError


def step_of(time: FloatArray) -> float:
    """Step [s] of an even time grid [s], shape (n,); of a single row 1 s."""
    return float(time[1] - time[0]) if len(time) > 1 else 1.0


FACTOR_LIMIT = 5.0
"""A factor on spread, rate of mean reversion or fine noise stays within 1/5..5: beyond the fitted range
of its column a log-linear effect would run away. [-]"""
LOG_LIMIT = float(np.log(FACTOR_LIMIT))


class Acts(StrEnum):
    """Part of the movement that an effect changes; its strength is [m] for location, else a natural logarithm."""

    LOCATION = "location"
    SPREAD = "spread"
    RATE = "rate"
    FINE = "fine"


def terms_of(acts: Acts, strength: FloatArray) -> EffectTerms:
    """Terms of an effect of the given strength, shape (n,): added [m] for location, its exponential [-] for factors."""
    if acts is Acts.LOCATION:
        return EffectTerms(location=strength)
    factor = np.exp(np.minimum(np.maximum(strength, -LOG_LIMIT), LOG_LIMIT))  # np.clip takes five times as long
    if acts is Acts.SPREAD:
        return EffectTerms(spread=factor)
    return EffectTerms(rate=factor) if acts is Acts.RATE else EffectTerms(fine=factor)
