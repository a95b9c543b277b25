"""A column that changes the spread of the slower movement only: more is let pass, but corrected as always."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, Effect
from xosc_lateral.identification.problem import Problem, of_squares
from xosc_lateral.identification.regression import Coarse, Fitted
from xosc_lateral.identification.squares import SLOW_S, log_sizes, slow_squares
from xosc_lateral.identification.terms.base import Stage
from xosc_lateral.identification.terms.column import ColumnTerm, columns_on_size, responses
from xosc_lateral.identification.terms.mean import MeanTerm
from xosc_lateral.identification.terms.spread import known_log_scale

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SlowSpreadTerm(ColumnTerm):
    """Log standard deviation of eight-second sums of the innovations by a column."""

    component: ClassVar[str] = "slow_spread"
    kind: ClassVar[str] = "scale"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.SPREAD,)
    place: ClassVar[int] = 2
    weight: ClassVar[float] = 2.0
    seen_held_out: ClassVar[bool] = False
    acts: ClassVar[Acts] = Acts.SPREAD
    what: ClassVar[str] = "spread"

    def size_columns(self, coarse: Coarse) -> FloatArray:
        """The bounded response, although the innovations' own scale does not follow it."""
        return self.bounded(coarse)

    @classmethod
    def problem(cls, fitted: Fitted) -> Problem:
        """Squares of running sums; an effect on the mean whose size is a little wrong leaves some where it is large."""
        squares = slow_squares(fitted)
        known = np.concatenate([known_log_scale(fitted), np.abs(responses(fitted, MeanTerm))], axis=1)
        return of_squares(fitted.coarse, squares.standardised, squares.valid, known)

    @classmethod
    def barred(cls, fitted: Fitted) -> frozenset[str]:
        """Columns that act on the movement's size already."""
        return columns_on_size(fitted)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Neighbouring sums overlap, so errors are wider."""
        sizes, errors = log_sizes(slow_squares(fitted), self.bounded(fitted.coarse))
        return (self.sized(fitted.coarse, Acts.SPREAD, sizes, errors * np.sqrt(SLOW_S)),)
