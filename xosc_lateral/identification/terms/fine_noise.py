"""A column that changes the fine noise: a sensor, say, that reads less exactly."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from xosc_lateral.driver.effects import Acts, Effect
from xosc_lateral.identification.problem import Problem, of_squares
from xosc_lateral.identification.regression import Fitted
from xosc_lateral.identification.squares import fine_squares
from xosc_lateral.identification.terms.base import Stage
from xosc_lateral.identification.terms.column import ColumnTerm, columns_acting, responses
from xosc_lateral.identification.terms.mean import MeanTerm
from xosc_lateral.identification.terms.spread import fine_twin, known_log_scale


@dataclass(frozen=True, eq=False)
class FineNoiseTerm(ColumnTerm):
    """Log standard deviation of the innovations at 5 Hz by a column."""

    component: ClassVar[str] = "fine_noise"
    kind: ClassVar[str] = "scale"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.MOVEMENT,)
    weight: ClassVar[float] = 1.0
    seen_held_out: ClassVar[bool] = False
    single: ClassVar[bool] = True
    acts: ClassVar[Acts] = Acts.FINE
    what: ClassVar[str] = "fine noise"

    @classmethod
    def problem(cls, fitted: Fitted) -> Problem:
        """Squared innovations at 5 Hz.

        An effect on the mean is followed with errors: they grow with it where its size is a little wrong, and with its
        rate of change where its timing is.
        """
        squares = fine_squares(fitted)
        moved = responses(fitted, MeanTerm)
        known = [known_log_scale(fitted), responses(fitted, cls), np.abs(moved)]
        if moved.shape[1]:
            known.append(np.abs(np.gradient(moved, axis=0)))
        return of_squares(fitted.coarse, squares.standardised, squares.valid, np.concatenate(known, axis=1))

    @classmethod
    def barred(cls, fitted: Fitted) -> frozenset[str]:
        """What acts on anything else already: what its shape leaves of itself looks like noise."""
        return columns_acting(fitted)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Log-linear regression of the squares."""
        return (fine_twin(self, fitted),)
