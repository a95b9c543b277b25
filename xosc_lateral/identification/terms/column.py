"""Terms of context columns: what moves the mean, and what changes the spread of all movement or the fine noise.

The logarithm of a standard deviation is linear in the column [1]_.

References
----------
.. [1] A. C. Harvey, "Estimating regression models with multiplicative heteroscedasticity", Econometrica 44, 1976.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from msgspec import structs

from xosc_lateral.arrays import FloatArray
from xosc_lateral.driver.effects import Acts, ColumnEffect, Effect
from xosc_lateral.identification.autocorrelation import Problem
from xosc_lateral.identification.column_search import find_column, likely_response, probability_of
from xosc_lateral.identification.innovations import (
    SLOW_S,
    fine_squares,
    log_sizes,
    of_squares,
    quick_squares,
    slow_squares,
)
from xosc_lateral.identification.refinement import Alternatives
from xosc_lateral.identification.regression import Coarse, Fitted
from xosc_lateral.identification.terms.base import Description, Outcome, Removal, Stage, Term
from xosc_lateral.identification.timeline import coarse_mean
from xosc_lateral.identification.timing import span, widening

if TYPE_CHECKING:
    from xosc_lateral.identification.selection import Search

# Responses between which a factor on the movement is believed; the report tells its size between the same. [-]
FACTOR_QUANTILES = (0.05, 0.95)
# A column that p-values up to this speak for may be what makes stretches loud, rain for one (factors of 1.3 and 2 with
# p = 0.01 and 0.05: beside rain p of regimes is 0.2, without it 3e-4 and 1e-10). The best of all columns taken out,
# whatever its p-value, costs true regimes of a minute up to 19 orders of magnitude. [-]
MAY_ACT = 0.1
FINE_TWIN_Z = 2.0  # The fine noise follows an effect on the spread when it is that many standard errors from not. [-]


@dataclass(frozen=True, eq=False)
class ColumnTerm(Term):
    """An effect of one or two columns."""

    acts: ClassVar[Acts]
    what: ClassVar[str]  # What it acts on, in words.
    group: ClassVar[str] = "spread"  # Mean or spread: which summary statistics show it.
    effect: ColumnEffect  # Without coefficients.
    alike: Alternatives = ()  # Columns of each other effect that explains as much.

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that the effect reads."""
        return self.effect.columns

    @classmethod
    def of(cls, effect: ColumnEffect, alike: Alternatives = ()) -> Self:
        """A term of an effect that may act on something else."""
        return cls(structs.replace(effect, acts=cls.acts), alike)

    def remove(self, fitted: Fitted, effects: tuple[Effect, ...], removal: Removal) -> None:
        """Evaluate the sized effects."""
        for effect in effects:
            assert isinstance(effect, ColumnEffect)
            part = {Acts.LOCATION: removal.location, Acts.SPREAD: removal.spread, Acts.FINE: removal.fine}[effect.acts]
            part += fitted.coarse.strength(effect)

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Change between the 5 % and 95 % quantile of what drives it."""
        effect = effects[0]
        assert isinstance(effect, ColumnEffect)
        strength = span(fitted.coarse, effect)
        sizes, errors = np.asarray(effect.coefficients), np.asarray(effect.errors)
        relative = float(np.linalg.norm(errors)) / max(float(np.linalg.norm(sizes)), 1e-12)
        on_mean = effect.acts is Acts.LOCATION
        size = strength if on_mean else float(np.exp(strength))
        return Description(
            effect=f"{self.what} by {' and '.join(effect.columns)}",
            shape=effect.shape,
            size_m=size,
            size_error=abs(strength) * relative * (1.0 if on_mean else size),
            statistic=f"{self.group} by effect: {key}",
            measure=f"{'mean offset' if on_mean else 'spread'} by fifths of the effect's own quantity",
            lag_s=effect.lag_s,
            response_s=effect.response_s,
        )

    def ends(self, coarse: Coarse) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest response that counts, about the mean response, shape (k,) each.

        All that was seen, for a shift. For what multiplies the movement the 5 % and 95 % quantile: a log-linear factor
        would be anything at a column's few extremes.
        """
        response = coarse.response(self.effect, keep=True)[coarse.valid]
        least, most = response.min(axis=0), response.max(axis=0)
        if self.acts is Acts.LOCATION:
            return least, most
        low, high = np.quantile(response, FACTOR_QUANTILES, axis=0)
        varies = high > low  # not so for a switch that is hardly ever on
        return np.where(varies, low, least), np.where(varies, high, most)

    def bounded(self, coarse: Coarse) -> FloatArray:
        """Responses within `ends`, about their mean, shape (n, k). [unit of the quantity]"""
        response = np.clip(coarse.response(self.effect, keep=True), *self.ends(coarse))
        return np.asarray(response - response[coarse.valid].mean(axis=0))

    def sized(self, coarse: Coarse, acts: Acts, sizes: FloatArray, errors: FloatArray) -> ColumnEffect:
        """The effect with its sizes, shrunk by how sure they are, bounded, zero at its mean."""
        raw = coarse.fine_response(self.effect)[coarse.timeline.valid]
        usual, (low, high) = raw.mean(axis=0), self.ends(coarse)
        within = np.clip(raw, usual + low, usual + high)
        return structs.replace(
            self.effect,
            acts=acts,
            coefficients=tuple(shrunk(sizes, errors)),
            errors=tuple(errors),
            reference=tuple(within.mean(axis=0)),
            response_range=tuple(zip((usual + low).tolist(), (usual + high).tolist(), strict=True)),
        )


def shrunk(sizes: FloatArray, errors: FloatArray) -> FloatArray:
    """Positive-part James-Stein, shape and unit of `sizes`: at a z of 2 three quarters are kept, at 5 all but 4 %."""
    squares = float(np.sum(np.square(sizes / np.maximum(errors, 1e-300))))
    return np.asarray(sizes * max(0.0, 1.0 - len(sizes) / max(squares, 1e-300)))


def of_kind(fitted: Fitted, kind: type[ColumnTerm]) -> list[ColumnTerm]:
    """Terms of one kind in a fit."""
    return [term for term in fitted.terms if isinstance(term, kind)]


def columns_on_size(fitted: Fitted) -> frozenset[str]:
    """Columns that act on the movement's size."""
    terms = [one for one in fitted.terms if isinstance(one, ColumnTerm) and one.acts is not Acts.LOCATION]
    return frozenset(name for term in terms for name in term.columns)


class SearchedTerm(ColumnTerm):
    """An effect that the dictionary is searched for, in a regression of its own."""

    @classmethod
    @abstractmethod
    def problem(cls, fitted: Fitted) -> Problem:
        """Regression in which a column of this kind is tested, with the terms fitted already."""

    @classmethod
    def reweighted(cls, fitted: Fitted, after: Fitted) -> Problem | None:
        """The same regression beside `fitted`, weighted by the noise that is left in `after`; None: no other."""
        return None

    @classmethod
    def barred(cls, fitted: Fitted) -> frozenset[str]:
        """Columns that this kind may not take up beside the terms fitted."""
        return frozenset()

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """The best candidate of the whole dictionary against rotations."""
        return find_column(search, cls, fitted)

    def probability_beside(self, search: Search, fitted: Fitted) -> float:
        """p-value of its columns in whatever shape suits them beside the terms fitted."""
        return probability_of(search, type(self), fitted, self.columns)


@dataclass(frozen=True, eq=False)
class MeanTerm(SearchedTerm):
    """Mean offset by a column: generalised least squares on whitened offsets."""

    component: ClassVar[str] = "mean"
    kind: ClassVar[str] = "location"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.MEAN, Stage.MEAN_AGAIN)
    weight: ClassVar[float] = 5.0
    acts: ClassVar[Acts] = Acts.LOCATION
    what: ClassVar[str] = "mean offset"
    group: ClassVar[str] = "mean"

    def mean_columns(self, coarse: Coarse) -> FloatArray:
        """The response, shape (n, k). [unit of the quantity]"""
        return coarse.response(self.effect, keep=True)

    def fine_mean_columns(self, coarse: Coarse) -> FloatArray:
        """The response as the profile gives it: steps of a second would be noise."""
        response = coarse.fine_response(self.effect)
        return np.asarray(response - coarse_mean(response)[coarse.valid].mean(axis=0))

    def may_be_explained_by(self, later: Term, coarse: Coarse) -> bool:
        """What changes the spread: the null keeps how loud the movement is, not where."""
        return bool(later.scale_columns(coarse).shape[1]) or later.known_scale(coarse) is not None

    @classmethod
    def problem(cls, fitted: Fitted) -> Problem:
        """Whitened offsets."""
        return Problem(fitted.whitener, fitted.coarse.offset, fitted.columns)

    @classmethod
    def reweighted(cls, fitted: Fitted, after: Fitted) -> Problem:
        """Whitened by what is left in `after`: an effect that is still in the offsets looks like memory."""
        return Problem(after.whitener, fitted.coarse.offset, fitted.columns)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """From the joint fit; shrunk as if timing and shape were known, with errors for what is not."""
        part = fitted.mean_part(self)
        errors = np.sqrt(np.maximum(np.diag(fitted.covariance)[part], 0.0))
        effect = self.sized(fitted.coarse, Acts.LOCATION, fitted.sizes[part], errors)
        return (structs.replace(effect, errors=tuple(widening(fitted, effect, part) * errors)),)


@dataclass(frozen=True, eq=False)
class SpreadTerm(SearchedTerm):
    """Log standard deviation of the innovations by a column: regression of their squares."""

    component: ClassVar[str] = "spread"
    kind: ClassVar[str] = "scale"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.SPREAD,)
    place: ClassVar[int] = 1
    weight: ClassVar[float] = 3.0
    acts: ClassVar[Acts] = Acts.SPREAD
    what: ClassVar[str] = "spread"

    def scale_columns(self, coarse: Coarse) -> FloatArray:
        """The bounded response, shape (n, k). [unit of the quantity]"""
        return self.bounded(coarse)

    @classmethod
    def problem(cls, fitted: Fitted) -> Problem:
        """Squared innovations."""
        return of_squares(fitted.coarse, quick_squares(fitted), known_log_scale(fitted))

    @classmethod
    def barred(cls, fitted: Fitted) -> frozenset[str]:
        """Columns that act on the movement's size already."""
        return columns_on_size(fitted)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """From the joint fit; the fine noise goes along where it does so clearly."""
        part = fitted.scale_part(self)
        errors = np.sqrt(np.maximum(np.diag(fitted.log_covariance)[part], 0.0))
        spread = self.sized(fitted.coarse, Acts.SPREAD, fitted.log_sizes[part], errors)
        twin = fine_twin(self, fitted)
        clear = np.max(np.abs(twin.coefficients) / np.maximum(twin.errors, 1e-12)) >= FINE_TWIN_Z
        return (spread, twin) if clear else (spread,)


def fine_twin(term: ColumnTerm, fitted: Fitted) -> ColumnEffect:
    """The same quantity's effect on the fine noise."""
    sizes, errors = log_sizes(fine_squares(fitted), term.bounded(fitted.coarse))
    return term.sized(fitted.coarse, Acts.FINE, sizes, errors)


def known_log_scale(fitted: Fitted) -> FloatArray:
    """What is known of the movement's log size, shape (n, k). [any unit]"""
    coarse = fitted.coarse
    known = [scale[:, None] for term in fitted.terms if (scale := term.known_scale(coarse)) is not None]
    columns = [term.size_columns(coarse) for term in fitted.terms]
    return np.concatenate([np.zeros((len(coarse), 0)), *columns, *known], axis=1)


def what_columns_do(search: Search, fitted: Fitted) -> FloatArray:
    """What columns that were found do to the movement's size, in any shape, shape (n, k)."""
    return search.cross_basis(columns_on_size(fitted))


def what_a_column_may_do(search: Search, fitted: Fitted) -> tuple[FloatArray, float]:
    """What the best of the other columns may do to the movement's size, shape (n, k), and its p-value.

    Beside it hidden changes of the size have to stand: regimes, a smooth of time.
    """
    return likely_response(search, SpreadTerm, fitted, MAY_ACT)


@dataclass(frozen=True, eq=False)
class SlowSpreadTerm(SpreadTerm):
    """Log standard deviation of eight-second sums of the innovations by a column: of who lets more pass."""

    component: ClassVar[str] = "slow_spread"
    place: ClassVar[int] = 2
    weight: ClassVar[float] = 2.0
    seen_held_out: ClassVar[bool] = False

    def scale_columns(self, coarse: Coarse) -> FloatArray:
        """None: the innovations' own scale does not follow it."""
        return np.zeros((len(coarse), 0))

    def size_columns(self, coarse: Coarse) -> FloatArray:
        """The bounded response, shape (n, k). [unit of the quantity]"""
        return self.bounded(coarse)

    @classmethod
    def problem(cls, fitted: Fitted) -> Problem:
        """Squares of running sums; an effect on the mean whose size is a little wrong leaves some where it is large."""
        coarse = fitted.coarse
        moved = [np.abs(coarse.response(term.effect, keep=True)) for term in of_kind(fitted, MeanTerm)]
        known = np.concatenate([known_log_scale(fitted), *moved], axis=1)
        return of_squares(coarse, slow_squares(fitted), known)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Neighbouring sums overlap, so errors are wider."""
        sizes, errors = log_sizes(slow_squares(fitted), self.bounded(fitted.coarse))
        return (self.sized(fitted.coarse, Acts.SPREAD, sizes, errors * np.sqrt(SLOW_S)),)


@dataclass(frozen=True, eq=False)
class FineNoiseTerm(SearchedTerm):
    """Log standard deviation of the innovations at 5 Hz by a column: five times as many squares as by the second."""

    component: ClassVar[str] = "fine_noise"
    kind: ClassVar[str] = "scale"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.FINE_NOISE,)
    weight: ClassVar[float] = 1.0
    seen_held_out: ClassVar[bool] = False
    acts: ClassVar[Acts] = Acts.FINE
    what: ClassVar[str] = "fine noise"

    @classmethod
    def problem(cls, fitted: Fitted) -> Problem:
        """Squared innovations at 5 Hz.

        An effect on the mean is followed with errors: they grow with it where its size is a little wrong, and with its
        rate of change where its timing is.
        """
        coarse = fitted.coarse
        own = [coarse.response(term.effect, keep=True) for term in of_kind(fitted, cls)]
        moved = [coarse.response(term.effect, keep=True) for term in of_kind(fitted, MeanTerm)]
        errors = [np.abs(one) for shift in moved for one in (shift, np.gradient(shift, axis=0))]
        known = np.concatenate([known_log_scale(fitted), *own, *errors], axis=1)
        return of_squares(coarse, fine_squares(fitted), known)

    @classmethod
    def barred(cls, fitted: Fitted) -> frozenset[str]:
        """What acts within drives already: what its shape leaves of itself looks like noise."""
        terms = [one for one in fitted.terms if isinstance(one, ColumnTerm) and one.component != "between"]
        return frozenset(name for term in terms for name in term.columns)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Log-linear regression of the squares."""
        return (fine_twin(self, fitted),)
