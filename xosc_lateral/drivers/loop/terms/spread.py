"""The size of the movement by a column: of all of it, of the slower part, or of the fine noise.

The logarithm of a standard deviation is linear in the column [1]_.

References
----------
.. [1] A. C. Harvey, "Estimating regression models with multiplicative heteroscedasticity", Econometrica 44, 1976.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.loop.autocorrelation import Problem
from xosc_lateral.drivers.loop.column_search import ColumnSearch, SearchedTerm
from xosc_lateral.drivers.loop.model import Fitted, Stage
from xosc_lateral.drivers.loop.search import Search
from xosc_lateral.drivers.loop.squares import SLOW_S, fine_squares, log_sizes, of_squares, quick_squares, slow_squares
from xosc_lateral.drivers.loop.terms.column import ColumnTerm, columns_on_size, of_kind
from xosc_lateral.drivers.loop.terms.mean import MeanTerm
from xosc_lateral.drivers.loop.timeline import Coarse
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Effect

# A column that p-values up to this speak for may be what makes stretches loud, rain for one (factors of 1.3 and 2 with
# p = 0.01 and 0.05: beside rain p of regimes is 0.2, without it 3e-4 and 1e-10). The best of all columns taken out,
# whatever its p-value, costs true regimes of a minute up to 19 orders of magnitude. [-]
MAY_ACT = 0.1
FINE_TWIN_Z = 2.0  # The fine noise follows an effect on the spread when it is that many standard errors from not. [-]


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
    """What the best other column may do to the movement's size, shape (n, k), and its p-value: hidden changes stand
    beside it."""
    return ColumnSearch(search, SpreadTerm, fitted).likely_response(MAY_ACT)


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
        """Squared innovations at 5 Hz, beside size and rate of effects on the mean, which are followed with errors."""
        coarse = fitted.coarse
        own = [coarse.response(term.effect, keep=True) for term in of_kind(fitted, cls)]
        moved = [coarse.response(term.effect, keep=True) for term in of_kind(fitted, MeanTerm)]
        errors = [np.abs(one) for shift in moved for one in (shift, np.gradient(shift, axis=0))]
        known = np.concatenate([known_log_scale(fitted), *own, *errors], axis=1)
        return of_squares(coarse, fine_squares(fitted), known)

    @classmethod
    def barred(cls, fitted: Fitted) -> frozenset[str]:
        """What acts within drives already: what its shape leaves of itself looks like noise."""
        terms = [one for one in fitted.terms if isinstance(one, ColumnTerm) and one.within_drives]
        return frozenset(name for term in terms for name in term.columns)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Log-linear regression of the squares."""
        return (fine_twin(self, fitted),)
