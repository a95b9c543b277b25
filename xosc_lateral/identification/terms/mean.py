"""The mean by a column."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from msgspec import structs

from xosc_lateral.arrays import FloatArray
from xosc_lateral.driver.effects import Acts, Effect
from xosc_lateral.identification.autocorrelation import Problem
from xosc_lateral.identification.column_search import SearchedTerm
from xosc_lateral.identification.model import Fitted, Stage, Term
from xosc_lateral.identification.timeline import Coarse, coarse_mean
from xosc_lateral.identification.timing import widening


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
