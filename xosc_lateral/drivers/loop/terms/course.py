"""The mean by one column, with any course over time: into a bend, through it and out.

One delay and one time constant say when a driver responds, not that he swings out before a bend and is back before its
end. Here the response is a sum of shifts in time, from what he sees ahead to where a bend has long ended: a distributed
lag [1]_, its weights smooth [2]_. It takes the place of a simpler term of the same column: one column, one finding.

References
----------
.. [1] A. Gasparrini, B. Armstrong, M. G. Kenward, "Distributed lag non-linear models", Statistics in Medicine 29, 2010.
.. [2] R. J. Shiller, "A distributed lag estimator derived from smoothness priors", Econometrica 41, 1973.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.loop.candidates import Family
from xosc_lateral.drivers.loop.column_search import grows
from xosc_lateral.drivers.loop.dictionary import Search
from xosc_lateral.drivers.loop.model import Description, Fitted, Outcome, Stage, fit_model
from xosc_lateral.drivers.loop.omnibus import DELAYS, check_remainder, smooth_covariance, tents, weights_of
from xosc_lateral.drivers.loop.passage import Passage, typical_passage
from xosc_lateral.drivers.loop.terms.column import ColumnTerm, of_kind
from xosc_lateral.drivers.loop.terms.mean import MeanTerm
from xosc_lateral.drivers.loop.terms.time import penalised
from xosc_lateral.drivers.loop.timeline import Coarse, coarse_mean
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Effect

# Time constant of the first-order lag before the shifts, which are a second apart: no shift shows as a corner. [s]
RESPONSE_S = 1.0


@dataclass(frozen=True, eq=False)
class CourseTerm(MeanTerm):
    """Mean offset by a column's course: generalised least squares on whitened offsets, one column per delay."""

    component: ClassVar[str] = "course"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.LOW_FREQUENCY, Stage.MEAN_AGAIN)
    place: ClassVar[int] = 1
    weight: ClassVar[float] = 3.0

    @property
    def kind_key(self) -> str:
        """It is a finding on the mean like any."""
        return MeanTerm.component

    def mean_columns(self, coarse: Coarse) -> FloatArray:
        """The response at every delay, less its mean, shape (n, delays). [unit of the quantity]"""
        moved = _shifted(coarse_mean(coarse.fine_response(self.effect)), coarse)
        return np.asarray(moved - moved[coarse.valid].mean(axis=0))

    def fine_mean_columns(self, coarse: Coarse) -> FloatArray:
        """The same between the seconds."""
        return super(MeanTerm, self).fine_mean_columns(coarse)

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Whether the innovations that are left are predicted by any column; the one that does it best, as a whole."""
        taken = {term.columns for term in of_kind(fitted, cls)}
        checked = check_remainder(fitted, search.quantities, search.seed, taken)
        if not checked.columns:
            return None
        outcome = Outcome(None, checked.columns, checked.p_value)
        former = next((term for term in of_kind(fitted, MeanTerm) if term.columns == checked.columns), None)
        if not cls.passes(search, checked.p_value, fitted):
            return outcome
        rest = [term for term in fitted.terms if term is not former]
        shapes = [former.effect] if isinstance(former, ColumnTerm) else _plain_shapes(search, checked.columns)
        terms = [cls.of(structs.replace(shape, lag_s=0.0, response_s=RESPONSE_S)) for shape in shapes]
        fits = [fit_model(fitted.coarse, (*rest, term)) for term in terms]
        if not fits:
            return outcome
        best = int(np.argmax([fit.log_likelihood for fit in fits]))
        if grows(fitted, fits[best]) or fits[best].log_likelihood < fitted.log_likelihood:
            return outcome
        return replace(outcome, term=terms[best], after=fits[best], instead_of=former)

    def probability_beside(self, search: Search, fitted: Fitted) -> float:
        """p-value of its column by any course beside the terms fitted."""
        return check_remainder(fitted, search.quantities, search.seed, only=self.columns).p_value

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """One effect with a course; its weights' error as that of what they do in a typical passage."""
        sizes, covariance = self._weights(fitted)
        weights = weights_of(DELAYS).T @ sizes
        total = max(float(np.abs(weights).sum()), 1e-300)
        seconds = range(int(DELAYS[0]), int(DELAYS[-1]) + 1)
        course = tuple((float(late), float(one / total)) for late, one in zip(seconds, weights, strict=True))
        sized = structs.replace(self.effect, course=course, response_range=())
        response = fitted.coarse.fine_response(sized)[fitted.coarse.timeline.valid]
        passage = self._passage(fitted, sizes, covariance)
        return (
            structs.replace(
                sized,
                acts=Acts.LOCATION,
                coefficients=(total,),
                errors=(total * passage.share_of_error,),
                reference=(float(response.mean()),),
                response_range=((float(response.min()), float(response.max())),),
            ),
        )

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """What the car does in a typical passage: the farthest that it goes."""
        passage = self._passage(fitted, *self._weights(fitted))
        described = super().describe(fitted, effects, key)
        size, error = passage.largest_shift
        shape = f"{described.shape}, over time"
        return replace(
            described, shape=shape, size_m=size, size_error=error, lag_s=None, response_s=None, passage=passage
        )

    def _weights(self, fitted: Fitted) -> tuple[FloatArray, FloatArray]:
        """Gain at each delay and its covariance, smooth as far as the rows leave it open. [m] per unit"""
        part = fitted.mean_part(self)
        return penalised(fitted.sizes[part], fitted.covariance[part, part], smooth_covariance(len(DELAYS)))

    def _passage(self, fitted: Fitted, sizes: FloatArray, covariance: FloatArray) -> Passage:
        passage = typical_passage(fitted.coarse, self.effect)
        quantity = coarse_mean(
            self.effect.response(fitted.coarse.timeline.step, {self.effect.columns[0]: passage.column})
        )
        moved = tents(quantity[:, 0], DELAYS, np.zeros(len(quantity), dtype=np.intp))
        moved = moved - moved[0]
        return passage.with_path(moved @ sizes, np.sqrt(np.sum((moved @ covariance) * moved, axis=1)))


def _shifted(values: FloatArray, coarse: Coarse) -> FloatArray:
    return tents(values[:, 0], DELAYS, coarse.drive)


def _plain_shapes(search: Search, columns: tuple[str, ...]) -> list[ColumnEffect]:
    """Shapes of one component, of a column as it is."""
    members = [one for one in search.quantities.candidates if one.family is Family.PLAIN and one.columns == columns]
    return [one.effect for one in members if len(one.contrast) == 1]
