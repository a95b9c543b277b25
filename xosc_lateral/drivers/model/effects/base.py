"""What an effect is: a dependence of the offset on context, time or hidden state that a profile can hold.

What all effects of context columns share: a quantity, the driver's response to it, and how strong it acts. A
distributed lag of a function of the column [3]_, the lags as a delay and a first-order lag; coefficients may differ
between drivers as random effects do [4]_.

References
----------
.. [1] N. Neis, J. Beyerer, "A two-level stochastic model for the lateral movement of vehicles within their lane", IEEE
       ITSC 2023, pp. 1896-1903, arXiv:2405.17080: coarse and fine part, which effects change.
.. [2] A. C. Harvey, "Estimating regression models with multiplicative heteroscedasticity", Econometrica 44, 1976:
       log-linear factors.
.. [3] A. Gasparrini, B. Armstrong, M. G. Kenward, "Distributed lag non-linear models", Statistics in Medicine 29, 2010.
.. [4] N. M. Laird, J. H. Ware, "Random-effects models for longitudinal data", Biometrics 38, 1982.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import reduce
from operator import add
from typing import Any, ClassVar, Self

import msgspec
import numpy as np
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.limits import COURSE, RESPONSE
from xosc_lateral.base.segment import FADES
from xosc_lateral.drivers.model.effects.response import Response, ResponseState, respond
from xosc_lateral.drivers.model.records import Record, kebab, set_once


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


# ---- effects of context columns ----
MAX_ORDER = 9
"""More lags in a row are a delay. [-]"""
MOST_DRIVEN = 32
"""Values of a column between which the size of an effect is told, at most. [-]"""


class ColumnEffect(Effect, frozen=True, kw_only=True):
    """A dependence on context columns: strength = coefficients . (respond(quantity) - reference).

    A new one names its columns, its `shape` and its `quantity`. A table without one of the columns leaves the movement
    unchanged. Raises `DriverProfileError` if the lengths disagree, a number is not finite, the response time or a
    deviation is negative, or the order is not 1 to 9.
    """

    later = ("between_drivers", "response_range", "response_order", "course", "episode", "driven")

    # For the report, fields of the effect in braces: "linear", "proximity (fades over {0.scale:.3g})" ...
    words: ClassVar[str] = ""

    acts: Acts  # What it changes.
    # One per component of the quantity; [m] per unit of it for location, else natural logarithm per unit.
    coefficients: tuple[float, ...] = ()
    errors: tuple[float, ...] = ()  # Standard errors of the coefficients.
    lag_s: float = 0.0  # Delay of the response; negative: preview. [s]
    response_s: float = 0.0  # First-order lag of the response. [s]
    reference: tuple[float, ...] = ()  # Quantity at which nothing changes: its mean over the drives it was fitted on.
    # Standard deviations of the coefficients between drivers (random slopes); empty: all drivers respond alike.
    between_drivers: tuple[float, ...] = ()
    # Lowest and highest response, per component, that the effect was fitted on; responses beyond are taken as these.
    # Empty: no bounds. [unit of the quantity]
    response_range: tuple[tuple[float, float], ...] = msgspec.field(name="answer_range", default=())
    # Count of lags one after the other: after one, a jump of the quantity is a corner of the path, after two a bend.
    response_order: int = 1
    # Further delay [s] and weight [-] of each of several shifts in time that the response is the sum of, where one
    # delay does not do: into a bend, through it and out. Empty: one of weight 1.
    course: tuple[tuple[float, float], ...] = ()
    # Size of the quantity beyond which its peak is held until the next time: the last bend, the last vehicle overtaken.
    # 0: nothing is held. [unit of the quantity]
    episode: float = 0.0
    # Values of each column, rising, from 5 % to 95 % of the time that the effect was fitted on, None: there is none.
    # Between these its size is told. Empty: not known. [unit of the column]
    driven: tuple[tuple[float | None, ...], ...] = ()

    def __post_init__(self) -> None:
        tuples = ("coefficients", "errors", "reference", "between_drivers")
        set_once(self, acts=Acts(self.acts), **{name: tuple(map(float, getattr(self, name))) for name in tuples})
        numbers = (*self.coefficients, *self.errors, *self.reference, self.lag_s, self.response_s)
        if not np.isfinite(numbers).all() or self.response_s < 0:
            raise DriverProfileError(
                f"effect {self.kind}: {numbers} has a number that is not finite, or a response below 0 s"
            )
        if not 1 <= self.response_order <= MAX_ORDER:
            raise DriverProfileError(
                f"effect {self.kind}: response_order {self.response_order}, expected 1 to {MAX_ORDER}"
            )
        if len({len(self.coefficients), len(self.errors), len(self.reference)}) != 1:
            raise DriverProfileError(f"effect {self.kind}: as many coefficients as errors and references are needed")
        if self.between_drivers and (
            len(self.between_drivers) != len(self.coefficients)
            or not all(0.0 <= value < np.inf for value in self.between_drivers)
        ):
            raise DriverProfileError(
                f"effect {self.kind}: between_drivers {self.between_drivers}, expected none or a number >= 0 for each "
                "coefficient"
            )
        set_once(self, course=tuple((float(late), float(weight)) for late, weight in self.course))
        if not np.isfinite(np.asarray(self.course)).all():
            raise DriverProfileError(f"effect {self.kind}: course {self.course} has a number that is not finite")
        latest = max(abs(self.lag_s), self.response_s, *(abs(self.lag_s + late) for late, _ in self.course))
        for limit, value in ((RESPONSE, latest), (COURSE, len(self.course))):
            if value > limit.value:
                raise DriverProfileError(f"effect {self.kind}: {limit.refusal(value)}")
        if not 0.0 <= self.episode < np.inf:
            raise DriverProfileError(f"effect {self.kind}: episode {self.episode} must be 0 or more")
        ranges = tuple((float(low), float(high)) for low, high in self.response_range)
        set_once(self, response_range=ranges)
        if ranges and (
            len(ranges) != len(self.coefficients) or not all(-np.inf < low <= high < np.inf for low, high in ranges)
        ):
            raise DriverProfileError(
                f"effect {self.kind}: answer_range {ranges}, expected none or (lowest, highest) for each coefficient"
            )

        if self.driven and (
            len(self.driven) != len(self.columns)
            or not all(1 <= len(values) <= MOST_DRIVEN for values in self.driven)
            or not all(value is None or np.isfinite(value) for values in self.driven for value in values)
        ):
            raise DriverProfileError(
                f"effect {self.kind}: driven {self.driven}, expected none or 1 to {MOST_DRIVEN} numbers for each column"
            )

    @property
    def levels_off(self) -> bool:
        """Whether the quantity has a limit far out: infinity ("nobody in sight") is then as good as far away.

        Of one without a limit, infinity is "there is none" (NaN).
        """
        return False

    @property
    def shape(self) -> str:
        """Word for the report: linear, threshold, saturating, product, levels, angular ..."""
        held = f", the last peak beyond {self.episode:.3g} held" if self.episode else ""
        return f"{self.words.format(self)}{held}"

    @abstractmethod
    def quantity(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """Driving quantity before the response, shape (n, k), in the unit that coefficients are per; NaN: no effect.

        Context columns of shape (n,) are in their own units; NaN: there is none. Infinite only where it `levels_off`.
        """

    @classmethod
    def proposals(cls, column: str, values: FloatArray) -> Iterable[Self]:
        """Effects of a plug-in without coefficients that `close-loop` tries on a column of these values, shape (n,)."""
        return ()

    def seen(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """The quantity of columns that may be infinite, shape (n, k); NaN: no effect. [unit of the quantity]"""
        return self.quantity(context if self.levels_off else _finite(context, self.columns))

    def known(self, context: Mapping[str, FloatArray]) -> FloatArray:
        """The quantity with what has no effect in place of NaN, shape (n, k). [unit of the quantity]

        Where a column fades (`segment.FADES`), so does the quantity, to what it is where there is none.
        """
        values = self.seen(context)
        fading = [name for name in self.columns if name + FADES in context]
        if not fading:
            return self._filled(values, values)
        gone = {name: np.full(len(values), np.nan) for name in fading}
        without = self._filled(self.seen({**{name: context[name] for name in self.columns}, **gone}), values)
        share = np.prod([context[name + FADES] for name in fading], axis=0)[:, None]
        return np.asarray(without + share * (self._filled(values, values) - without))

    def _filled(self, values: FloatArray, like: FloatArray) -> FloatArray:
        """With the reference in place of NaN; without one, the mean of what is known of others like these."""
        missing = np.isnan(values)
        if not missing.any():
            return values
        known = [column[np.isfinite(column)] for column in like.T]
        stand_in = self.reference or tuple(float(column.mean()) if len(column) else 0.0 for column in known)
        return np.where(missing, np.asarray(stand_in), values)

    @property
    def response_time(self) -> float:
        """Of all first-order lags together, as late as one of this time. [s]"""
        return self.response_s * self.response_order

    def response(self, step: float, context: Mapping[str, FloatArray]) -> FloatArray:
        """Driving quantity as the driver responds to it, shape (n, k), on a grid of the given step [s]."""
        known, order = self.known(context), self.response_order
        timing = (known, step, self.lag_s, self.response_s)
        return respond(*timing, order=order, course=self.course, episode=self.episode)

    def settled(self, held: Mapping[str, FloatArray]) -> FloatArray:
        """The response, within bounds, while columns stay at values, shape (n,) each, NaN: none; shape (n, k)."""
        quantity = self.known(held)
        if self.episode:
            quantity = np.where(np.abs(quantity) >= self.episode, quantity, 0.0)
        settled = quantity * (sum(weight for _, weight in self.course) if self.course else 1.0)
        return np.clip(settled, *np.asarray(self.response_range).T) if self.response_range else settled

    def response_in_blocks(self, step: float, state: ResponseState | None = None, *, delay: int = 0) -> Response:
        """The response block by block, shape (n, k) each, from the start of a drive or from a state.

        `step` in [s], `delay` in steps: see `Response`.
        """
        timing = {"order": self.response_order, "delay": delay}
        return Response(step, self.lag_s, self.response_s, state, **timing, course=self.course, episode=self.episode)

    def strength(self, step: float, context: Mapping[str, FloatArray]) -> FloatArray | None:
        """[m] or natural logarithm of a factor, shape (n,); None when a column is missing."""
        if any(column not in context for column in self.columns):
            return None
        return self.weighed(self.response(step, context))

    def weighed(self, response: FloatArray, coefficients: Iterable[float | FloatArray] | None = None) -> FloatArray:
        """Strength of responses, shape (n, k): coefficients . (response - reference), shape (n,). [m] or [-]

        Coefficients are the effect's, or k of shape (n,) where every row is another driver's.
        """
        # Component by component: a matrix product adds in another order for one row than for many.
        parts = [
            (self._within(response[:, k], k) - reference) * coefficient
            for k, (coefficient, reference) in enumerate(
                zip(self.coefficients if coefficients is None else coefficients, self.reference, strict=True)
            )
        ]
        return np.asarray(reduce(add, parts) if parts else np.zeros(len(response)))

    def _within(self, response: FloatArray, component: int) -> FloatArray:
        return np.clip(response, *self.response_range[component]) if self.response_range else response

    def acting(self, response: FloatArray) -> EffectTerms:
        """Terms [m], [-] of responses, shape (n, k), in the unit of the quantity."""
        return terms_of(self.acts, self.weighed(response))

    def of_one_driver(self, rng: np.random.Generator) -> ColumnEffect:
        """The effect with one driver's coefficients, drawn from the population."""
        if not any(self.between_drivers):
            return self
        normal = rng.standard_normal(len(self.coefficients))
        drawn = np.asarray(self.coefficients) + np.asarray(self.between_drivers) * normal
        return replace(self, coefficients=tuple(drawn.tolist()), between_drivers=())


def _finite(context: Mapping[str, FloatArray], columns: Iterable[str]) -> dict[str, FloatArray]:
    read = {name: np.asarray(context[name]) for name in columns}
    return {name: np.where(far, np.nan, own) if (far := np.isinf(own)).any() else own for name, own in read.items()}
