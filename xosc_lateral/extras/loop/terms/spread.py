"""The size of the movement by a column: of all of it, of the slower part, or of the fine noise.

The logarithm of a standard deviation is linear in the column [1]_.

References
----------
.. [1] A. C. Harvey, "Estimating regression models with multiplicative heteroscedasticity", Econometrica 44, 1976.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, cast

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Effect
from xosc_lateral.extras.loop.autocorrelation import WhitenedRegression, Whitener, fit_autoregression, moving_sum
from xosc_lateral.extras.loop.column_search import ColumnSearch, SearchedTerm
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.model import CLIP, Fitted, Stage, own_levels
from xosc_lateral.extras.loop.terms.column import ColumnTerm, columns_on_size, of_kind
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.timeline import COARSE, Coarse, coarse_all, coarse_mean

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
    def problem(cls, fitted: Fitted) -> WhitenedRegression:
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


def what_a_column_may_do(search: Search, fitted: Fitted) -> tuple[FloatArray, float]:
    """What the best other column may do to the movement's size, shape (n, k), and its p-value."""
    key = (what_a_column_may_do, fitted.terms)
    if key not in search.tested:
        search.tested[key] = ColumnSearch(search, SpreadTerm, fitted).likely_response(MAY_ACT)
    return cast(tuple[FloatArray, float], search.tested[key])


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
    def problem(cls, fitted: Fitted) -> WhitenedRegression:
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
    def problem(cls, fitted: Fitted) -> WhitenedRegression:
        """Squared innovations at 5 Hz, beside size and rate of effects on the mean, which are followed with errors."""
        coarse = fitted.coarse
        fine = [coarse.response(term.effect, keep=True) for term in of_kind(fitted, cls)]
        moved = [coarse.response(term.effect, keep=True) for term in of_kind(fitted, MeanTerm)]
        errors = [np.abs(one) for shift in moved for one in (shift, np.gradient(shift, axis=0))]
        known = np.concatenate([known_log_scale(fitted), *fine, *errors], axis=1)
        return of_squares(coarse, fine_squares(fitted), known)

    @classmethod
    def barred(cls, fitted: Fitted) -> frozenset[str]:
        """What acts within drives already: what its shape leaves of itself looks like noise."""
        terms = [one for one in fitted.terms if isinstance(one, ColumnTerm) and one.within_drives]
        return frozenset(name for term in terms for name in term.columns)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Log-linear regression of the squares."""
        return (fine_twin(self, fitted),)


FINE_ORDER = 15  # Past samples (3 s) that the fine movement's autoregression sees.
# Past seconds of the squares that whitening sees: two time constants of the clusters of 6 s that are no regime. [s]
SQUARES_S = 12
SLOW_S = 8  # Whitened seconds that are averaged for the slower movement: below 1/16 Hz. [s]


@dataclass(frozen=True, eq=False, slots=True)
class Squares:
    """Mean squares per second, about 1, shape (n,), 0 where invalid; clipped where they are tested and sized."""

    values: FloatArray
    valid: BoolArray

    @property
    def standardised(self) -> FloatArray:
        """Clipped, mean 0 and variance 1 over the valid rows, 0 elsewhere."""
        if not self.valid.any():
            return np.zeros(len(self.values))
        clipped = np.minimum(self.values, CLIP)
        inside = clipped[self.valid]
        return np.where(self.valid, (clipped - inside.mean()) / max(float(inside.std()), 1e-12), 0.0)


def quick_squares(fitted: Fitted) -> Squares:
    """Squared innovations."""
    return Squares(np.square(fitted.innovations), fitted.coarse.valid)


def fine_squares(fitted: Fitted) -> Squares:
    """Squared innovations at 5 Hz, averaged to 1 Hz, responses taken out as far as the innovations show them."""
    coarse, timeline = fitted.coarse, fitted.coarse.timeline
    n = len(timeline)
    valid = timeline.valid & np.repeat(coarse.valid, COARSE)[:n] if len(coarse) * COARSE >= n else timeline.valid
    level = fitted.levels[timeline.drive]
    moved = np.where(valid, timeline.offset - level, 0.0)
    responses = np.where(valid, fitted.explained - level, 0.0)
    process = fit_autoregression(moved, valid, FINE_ORDER)
    rows, responses = moving_sum(process.polynomial, moved), moving_sum(process.polynomial, responses)
    settled = moving_sum(np.ones(process.order + 1), valid.astype(np.float64)) > process.order + 0.5
    power = float(responses[settled] @ responses[settled])
    seen = float(np.clip(responses[settled] @ rows[settled] / power, 0.0, 1.0)) if power > 0.0 else 0.0
    squares = coarse_mean(np.where(settled, np.square(rows - seen * responses), 0.0))
    whole = coarse_all(settled)
    return Squares(squares / own_levels(squares, whole, coarse.drive)[coarse.drive], whole)


def slow_squares(fitted: Fitted) -> Squares:
    """Squares of the whitened movement's running sums: more is let pass, but what is done is done as always."""
    valid = fitted.coarse.valid
    sums = moving_sum(np.ones(SLOW_S), fitted.innovations)
    whole = valid & (moving_sum(np.ones(SLOW_S), valid.astype(np.float64)) >= SLOW_S - 0.5)
    deviation = float(sums[whole].std()) if whole.any() else 1.0
    return Squares(np.where(whole, np.square(sums / max(deviation, 1e-12)), 0.0), whole)


def of_squares(coarse: Coarse, squares: Squares, columns: FloatArray) -> WhitenedRegression:
    """Regression of squares on columns, shape (n, k), that may make them larger.

    Squares come in clusters of seconds, which whitening takes out. Loud and quiet minutes it leaves: they are what a
    slow column does (an autoregression that sees them takes half of the effect of rain for memory), and where no column
    does it, the null keeps them too.
    """
    valid, series = squares.valid, squares.standardised
    left = series
    if columns.shape[1]:
        design = columns - columns[valid].mean(axis=0)
        left = series - design @ np.linalg.lstsq(design[valid], series[valid], rcond=None)[0]
    process = fit_autoregression(np.where(valid, left, 0.0), valid, SQUARES_S, longest=SQUARES_S)
    return WhitenedRegression(Whitener(process, valid, coarse.drive, np.ones(len(coarse))), series, columns)


def log_sizes(squares: Squares, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Log-linear regression [1]_ of a standard deviation on columns, shape (n, k), and its errors, shape (k,)."""
    design = columns[squares.valid] - columns[squares.valid].mean(axis=0)
    inverse = np.linalg.pinv(2.0 * design.T @ design)
    sizes = np.zeros(columns.shape[1])
    relative = seen = squares.values[squares.valid]
    for _ in range(8):
        # clipped about what is expected there: a large effect must not clip itself
        relative = seen / np.exp(np.clip(2.0 * design @ sizes, -6.0, 6.0))
        relative = np.minimum(relative / max(float(relative.mean()), 1e-300), CLIP)
        relative = relative / max(float(relative.mean()), 1e-300)
        sizes = sizes + inverse @ (design.T @ (relative - 1.0))
    return sizes, np.sqrt(np.diag(inverse)) * float(np.std(relative)) / np.sqrt(2.0)
