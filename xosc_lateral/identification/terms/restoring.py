"""A column that changes how fast the driver comes back to his place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, Effect
from xosc_lateral.identification.column_search import SearchedTerm
from xosc_lateral.identification.problem import Problem, of_products
from xosc_lateral.identification.regression import Fitted
from xosc_lateral.identification.terms.base import Stage
from xosc_lateral.identification.terms.column import columns_acting, responses
from xosc_lateral.identification.timing import driving_range

FloatArray = NDArray[np.float64]

RECENT_S = 3.0
"""Time over which the recent offset is averaged that the restoring acts on. [s]"""

MAX_FACTOR = 3.0
"""Largest change of the restoring strength between the 5 % and 95 % quantile that is believed. [-]"""


@dataclass(frozen=True, eq=False)
class RestoringTerm(SearchedTerm):
    """Innovations by a column times the recent offset."""

    component: ClassVar[str] = "restoring"
    kind: ClassVar[str] = "dynamics"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.MOVEMENT,)
    weight: ClassVar[float] = 0.5
    seen_held_out: ClassVar[bool] = False
    single: ClassVar[bool] = True
    acts: ClassVar[Acts] = Acts.RATE
    what: ClassVar[str] = "restoring strength"

    @classmethod
    def problem(cls, fitted: Fitted) -> Problem:
        """Innovations on quantity times recent offset."""
        return of_products(fitted.coarse, fitted.innovations, responses(fitted, cls), recent_offset(fitted))

    @classmethod
    def barred(cls, fitted: Fitted) -> frozenset[str]:
        """What acts on anything else already."""
        return columns_acting(fitted)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Innovations stay the same, so a stronger pull also narrows the spread by its square root."""
        coarse, recent = fitted.coarse, recent_offset(fitted)
        response = coarse.response(self.effect)[:, 0]
        inside = coarse.valid & np.concatenate([[False], coarse.valid[:-1]])
        design = np.stack([recent, recent * response], axis=1)[inside]
        change = np.diff(fitted.movement, prepend=0.0)[inside] / fitted.whitener.process.deviations[-1]
        base = float(design[:, 0] @ change) / max(float(design[:, 0] @ design[:, 0]), 1e-12)
        inverse = np.linalg.pinv(design.T @ design)
        slope = float((inverse @ (design.T @ fitted.innovations[inside]))[1])
        low, high = driving_range(coarse, self.effect)
        limit = np.log(MAX_FACTOR) / max(float(abs(high[0] - low[0])), 1e-12)
        size = float(np.clip(slope / min(base, -1e-3), -limit, limit))
        error = float(np.sqrt(inverse[1, 1])) / max(abs(base), 1e-3)
        rate = self.sized(coarse, Acts.RATE, np.array([size]), np.array([error]))
        return rate, structs.replace(
            rate, acts=Acts.SPREAD, coefficients=(-0.5 * rate.coefficients[0],), errors=(0.5 * error,)
        )


def recent_offset(fitted: Fitted) -> FloatArray:
    """Recent movement before each second, variance 1, shape (n,): what he steers back from; 0 where unknown. [-]"""
    from scipy.signal import lfilter

    valid = fitted.coarse.valid
    keep = float(np.exp(-1.0 / RECENT_S))
    before = np.concatenate([[0.0], fitted.movement[:-1]])
    recent = np.where(valid, np.asarray(lfilter([1.0 - keep], [1.0, -keep], before)), 0.0)
    return np.asarray(recent / max(float(recent[valid].std()), 1e-12))
