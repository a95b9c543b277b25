"""A spread that grows or shrinks steadily with time on the road: fatigue, say.

The logarithm of the standard deviation is linear in time [1]_.

References
----------
.. [1] A. C. Harvey, "Estimating regression models with multiplicative heteroscedasticity", Econometrica 44, 1976.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Effect, VarianceTrend
from xosc_lateral.identification.dictionary import orthonormal
from xosc_lateral.identification.log_scale import squared_innovations
from xosc_lateral.identification.regression import Coarse, Fitted, elapsed
from xosc_lateral.identification.significance import LEAST
from xosc_lateral.identification.squares import SLOW_S, fine_squares, log_sizes, slow_squares
from xosc_lateral.identification.terms.base import Description, Outcome, Removal, Stage, Term
from xosc_lateral.identification.terms.spread import what_columns_may_do

if TYPE_CHECKING:
    from xosc_lateral.identification.search import Search

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

COSINES = 0.4
"""Cosines that the long-run variance is taken from, over rows to the power of 2/3; source: see `_probability`. [-]"""


@dataclass(frozen=True, eq=False)
class VarianceTrendTerm(Term):
    """Log scale linear in time.

    Parameters
    ----------
    slow : bool
        Of the slower movement only.
    """

    component: ClassVar[str] = "variance_trend"
    kind: ClassVar[str] = "scale"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.SPREAD,)
    weight: ClassVar[float] = 1.0
    slow: bool = False

    @property
    def predictable(self) -> bool:
        """As far as the innovations grow."""
        return not self.slow

    def scale_columns(self, coarse: Coarse) -> FloatArray:
        """Time, -0.5 to 0.5, shape (n, 1); none of slow growth. [-]"""
        return np.zeros((len(coarse), 0)) if self.slow else elapsed(coarse)[:, None]

    def size_columns(self, coarse: Coarse) -> FloatArray:
        """Time, -0.5 to 0.5, shape (n, 1), whichever movement grows. [-]"""
        return elapsed(coarse)[:, None]

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Regress squares on time; clustered seconds count for less."""
        if not fitted.coarse.lasts or any(isinstance(term, cls) for term in fitted.terms):
            return None
        # what a column does to the size of any part of the movement is no trend, slow as the column may be
        known = what_columns_may_do(search, fitted)
        fast, slow = (_probability(fitted, own, known) for own in (False, True))
        term = cls(slow=slow < fast)
        p_value = min(1.0, 2.0 * min(fast, slow))
        return Outcome(term, (), p_value)

    def matches(self, other: Self) -> bool:
        """Either of the two."""
        return isinstance(other, VarianceTrendTerm)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Factor from the first to the last second."""
        coarse = fitted.coarse
        time, seen = elapsed(coarse), coarse.time[coarse.valid]
        if self.slow:
            sizes, errors = log_sizes(slow_squares(fitted), time[:, None])
            size, error, fine = float(sizes[0]), float(errors[0]) * np.sqrt(SLOW_S), 0.0
        else:
            part = fitted.scale_part(self)
            size = float(fitted.log_sizes[part][0])
            error = float(np.sqrt(fitted.log_covariance[part, part][0, 0]))
            fine = float(log_sizes(fine_squares(fitted), time[:, None])[0][0])
        factor = float(np.exp(size))
        ends = {"from_s": float(seen.min()), "to_s": float(seen.max())}
        return (VarianceTrend(factor=factor, factor_error=factor * error, fine_factor=float(np.exp(fine)), **ends),)

    def remove(self, fitted: Fitted, effects: tuple[Effect, ...], removal: Removal) -> None:
        """A plain function of time."""
        terms = effects[0].terms(fitted.coarse.timeline.time, {}, np.random.default_rng(0))
        removal.spread += np.log(terms.spread) if terms.spread is not None else 0.0
        removal.fine += np.log(terms.fine) if terms.fine is not None else 0.0

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Factor over the drive."""
        effect = effects[0]
        assert isinstance(effect, VarianceTrend)
        name = f"{'growing' if effect.factor > 1 else 'shrinking'} spread"
        statistic = "spread by time"
        return Description(name, "log-linear in time", effect.factor, effect.factor_error, statistic, statistic)


def _probability(fitted: Fitted, slow: bool, known: FloatArray) -> float:
    """Two-sided p-value of squares regressed on time, their long-run variance by equally weighted cosines [1]_.

    `known`, shape (n, k), is taken out of both.

    References
    ----------
    .. [1] E. Lazarus, D. Lewis, J. Stock, M. Watson, "HAR inference: recommendations for practice", J. Business &
       Economic Statistics 36, 2018.
    """
    from scipy.fft import dct
    from scipy.stats import t

    coarse = fitted.coarse
    if slow:
        own = slow_squares(fitted)
        squares, valid = own.standardised, own.valid
    else:
        squares, valid = squared_innovations(fitted.innovations, coarse.valid), coarse.valid
    basis = orthonormal(np.column_stack([np.ones(valid.sum()), known[valid]]))
    time, left = (values - basis @ (basis.T @ values) for values in (elapsed(coarse)[valid], squares[valid]))
    slope = float(time @ left) / max(float(time @ time), 1e-300)
    scores = time * (left - slope * time)
    cosines = max(4, round(COSINES * len(scores) ** (2.0 / 3.0)))
    weights = dct(scores, type=2, norm="ortho")[1 : cosines + 1]
    error = float(np.sqrt(len(scores) * np.mean(weights**2))) / max(float(time @ time), 1e-300)
    return max(2.0 * float(t.sf(abs(slope) / max(error, 1e-300), cosines)), LEAST)
