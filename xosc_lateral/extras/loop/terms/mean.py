"""The mean by a column, by one lag and time constant, or with any course over time: into a bend, through it and out.

One delay and one time constant say when a driver responds, not that he swings out before a bend and is back before its
end. A course is a sum of shifts in time, from what he sees ahead to where a bend has long ended: a distributed lag
[1]_, its weights smooth [2]_. It takes the place of a simpler term of the same column: one column, one finding.

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
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Effect, Product, Proximity
from xosc_lateral.drivers.model.effects.ends import ends_of
from xosc_lateral.extras.loop import refinement
from xosc_lateral.extras.loop.autocorrelation import WhitenedRegression
from xosc_lateral.extras.loop.candidates import shapes_of
from xosc_lateral.extras.loop.column_search import SearchedTerm, grows
from xosc_lateral.extras.loop.columns import Column, read_column
from xosc_lateral.extras.loop.dictionary import Search, beside
from xosc_lateral.extras.loop.drives import OwnSlopes, own_slopes
from xosc_lateral.extras.loop.low_frequencies import penalised
from xosc_lateral.extras.loop.model import Description, Fitted, Outcome, Stage, Term, fit_model, proper
from xosc_lateral.extras.loop.omnibus import KERNELS, SECONDS, SMOOTH_COVARIANCE, check_remainder, tents
from xosc_lateral.extras.loop.passage import Passage, typical_passage
from xosc_lateral.extras.loop.terms.column import driven_values, of_kind
from xosc_lateral.extras.loop.timeline import Coarse, coarse_mean

NEAR_S = 2.0  # Lags that differ from the estimate by up to this are compared. [s]
# Scales that are compared, as shares of the estimate, 7 % apart: between two that refinement tries, 40 % apart, the
# change from the usual to the near end differs by a third.
NEAR_SCALES = tuple(np.geomspace(0.5, 2.0, 21).tolist())
# 95 % quantile of chi-square with one degree of freedom: the interval gives up half as much log-likelihood. [-]
CHI_SQUARE = 3.84


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
    def problem(cls, fitted: Fitted) -> WhitenedRegression:
        """Whitened offsets."""
        return WhitenedRegression(fitted.whitener, fitted.coarse.offset, fitted.columns)

    @classmethod
    def reweighted(cls, fitted: Fitted, after: Fitted) -> WhitenedRegression:
        """Whitened by what is left in `after`: an effect that is still in the offsets looks like memory."""
        return WhitenedRegression(after.whitener, fitted.coarse.offset, fitted.columns)

    def predictable(self, fitted: Fitted) -> bool:
        """Not where drives surely differ: no other drive knows what it does in one, and their mean is right in none."""
        return (slopes := self.own_slopes(fitted)) is None or not slopes.differ

    def matches(self, other: Term) -> bool:
        """Whatever its course over time."""
        return isinstance(other, MeanTerm) and self.columns == other.columns

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Change between the ends of its column; where drives surely differ, in those in which it surely acts."""
        described, slopes = super().describe(fitted, effects, key), self.own_slopes(fitted)
        if slopes is None or not slopes.differ:
            return described
        if slopes.there:
            effect = proper(effects, ColumnEffect)  # type: ignore[type-abstract]
            # as its timing and shape leave it open
            wider = float(np.max(effect.errors / np.sqrt(np.diag(fitted.covariance)[fitted.mean_part(self)])))
            size, error = described.size_m * slopes.size_there, wider * abs(described.size_m) * slopes.error_there
            described = replace(described, size_m=size, size_error=error)
        return replace(described, own_slopes=slopes)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """From the joint fit; shrunk as if timing and shape were known, with errors for what is not."""
        part = fitted.mean_part(self)
        errors = np.sqrt(np.maximum(np.diag(fitted.covariance)[part], 0.0))
        effect = self.sized(fitted.coarse, Acts.LOCATION, fitted.sizes[part], errors)
        wide = structs.replace(effect, errors=tuple(widening(fitted, effect, part) * errors))
        slopes = self.own_slopes(fitted)
        if slopes is None or not slopes.differ:
            return (wide,)
        sizes = fitted.sizes[part]  # not shrunk: where drives differ, a mean within its error of nothing is no doubt
        scatter = tuple(slopes.scatter * np.abs(sizes))
        return (structs.replace(wide, coefficients=tuple(sizes), between_drivers=scatter),)

    def own_slopes(self, fitted: Fitted) -> OwnSlopes | None:
        """How it differs from drive to drive."""
        white, path = fitted.whitener.rows, fitted.whitener.rows(fitted.path(self))
        left = white(fitted.coarse.offset - fitted.columns @ fitted.sizes)
        return own_slopes(left + path, path, fitted.coarse)


def widening(fitted: Fitted, effect: ColumnEffect, part: slice) -> float:
    """Factor on the standard errors of an effect on the mean, at least 1.

    How far the profile-likelihood interval (Venzon, Moolgavkar 1988) of the change over the driving range reaches from
    the estimate with lag and time constant free, or the shape of its column, or the distances over which its product
    fades, over how far it reaches with all of them known. The likelihood is that of independent rows, scaled to the
    variance that stretches of a minute show (Chandler, Bate 2007).
    """
    ends = ends_of(effect)
    held = {name: np.array([ends.low[name], ends.high[name]]) for name in effect.columns} if ends else {}

    def between(shape: ColumnEffect) -> FloatArray:
        low, high = shape.settled(held)
        return np.asarray(high - low)

    contrast = between(effect) if ends else np.zeros(1)
    if not contrast.any():
        return 1.0
    white = fitted.whitener.rows
    others, _ = np.linalg.qr(white(np.delete(fitted.columns, np.r_[part], axis=1)))
    left = beside(others, white(fitted.coarse.offset))
    estimated = _profile(beside(others, white(fitted.columns[:, part])), left, contrast)
    profiles = [estimated]
    for response in _timed(fitted, effect):
        rows = beside(others, white(response.reshape(len(response), -1)))
        width = len(contrast)
        profiles += [_profile(rows[:, at : at + width], left, contrast) for at in range(0, rows.shape[1], width)]
    for shape in _shapes(fitted.coarse, effect):
        profiles.append(_profile(beside(others, white(fitted.coarse.response(shape))), left, between(shape)))
    gain, size, variance = np.asarray(profiles).T
    noise = float(left @ left - gain.max()) / max(1, int(fitted.coarse.valid.sum()))
    clustered = float(contrast @ fitted.covariance[part, part] @ contrast)
    room = CHI_SQUARE * clustered / max(noise * estimated[2], 1e-300) - (gain.max() - gain) / noise
    inside = room > 0.0
    half = np.sqrt(noise * variance[inside] * room[inside])
    reach = float(np.max(np.abs(size[inside] - estimated[1]) + half))
    return float(max(1.0, reach / max(np.sqrt(CHI_SQUARE * clustered), 1e-300)))


def _shapes(coarse: Coarse, effect: ColumnEffect) -> list[ColumnEffect]:
    """Other shapes of the only column, or scales and centres of a product, with one coefficient and the same timing."""
    timing = {"lag_s": effect.lag_s, "response_s": effect.response_s}
    if isinstance(effect, Product):
        others = (*refinement.other_scales(effect, NEAR_SCALES), *refinement.other_centres(effect, coarse))
        return [structs.replace(other, response_range=()) for other in others]
    if len(effect.columns) > 1 or len(effect.coefficients) > 1:
        return []
    (name,) = effect.columns
    seen = coarse.context[name][coarse.timeline.valid]
    column = read_column(name, seen, coarse.timeline.periods.get(name, 0.0))
    if not isinstance(column, Column):
        return []
    plain, bent, _ = shapes_of(column, seen, curves=False)
    scales = [share * effect.scale for share in NEAR_SCALES] if isinstance(effect, Proximity) else []
    shapes = (*plain, *bent, *(structs.replace(effect, scale=scale) for scale in scales))
    single = (shape for shape in shapes if shape.seen({name: seen[:1]}).shape[1] == 1)
    return [structs.replace(shape, response_range=(), **timing) for shape in single]


def _timed(fitted: Fitted, effect: ColumnEffect) -> list[FloatArray]:
    """Responses at 1 Hz per time constant, shape (n, lags, k)."""
    coarse = fitted.coarse
    late = [
        round(float(lag) / coarse.timeline.step)
        for lag in refinement.lags_about(effect.lag_s, NEAR_S, refinement.LAG_STEPS[-1])
    ]
    quantity = coarse.fine_response(structs.replace(effect, lag_s=0.0, response_s=0.0, response_range=()))
    sums = (refinement.running_sums(coarse, quantity, response_s) for response_s in refinement.FINE_RESPONSES)
    return [np.stack([refinement.means_by_second(one, shift) for shift in late], axis=1) for one in sums]


def _profile(rows: FloatArray, left: FloatArray, contrast: FloatArray) -> tuple[float, float, float]:
    """Squares explained, the contrast's size, and its variance for noise of variance 1."""
    inverse, products = np.linalg.pinv(rows.T @ rows), rows.T @ left
    explained, size = products @ inverse @ products, contrast @ inverse @ products
    return float(explained), float(size), float(contrast @ inverse @ contrast)


# ---- courses over time ----
# Time constant of the first-order lag before the shifts, which are a second apart: no shift shows as a corner. [s]
RESPONSE_S = 1.0


@dataclass(frozen=True, eq=False)
class CourseTerm(MeanTerm):
    """Mean offset by a column's course: generalised least squares on whitened offsets, one column per delay.

    Of a shape with several coefficients (a curve, levels) the course is that of the sum that was fitted before.
    """

    component: ClassVar[str] = "course"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.LOW_FREQUENCY, Stage.MEAN_AGAIN)
    place: ClassVar[int] = 1
    weight: ClassVar[float] = 3.0
    mix: tuple[float, ...] = (1.0,)  # Weight of each component of the quantity; all keep it at every delay.

    @property
    def kind_key(self) -> str:
        """It is a finding on the mean like any."""
        return MeanTerm.component

    def mean_columns(self, coarse: Coarse) -> FloatArray:
        """The response at every delay, less its mean, shape (n, delays). [unit of the quantity]"""
        moved = tents(coarse_mean(coarse.fine_response(self.effect)) @ np.asarray(self.mix), coarse.drive)
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
        members = [one for one in search.plain_candidates() if one.columns == checked.columns]
        shapes = [(one.effect, np.ones(1)) for one in members]
        if former is not None:
            shapes = [(former.effect, fitted.sizes[fitted.mean_part(former)])]
        terms = [cls.over_time(effect, sizes) for effect, sizes in shapes]
        fits = [fit_model(fitted.coarse, (*rest, term)) for term in terms]
        if not fits:
            return outcome
        best = int(np.argmax([fit.log_likelihood for fit in fits]))
        if grows(fitted, fits[best]) or fits[best].log_likelihood < fitted.log_likelihood:
            return outcome
        return replace(outcome, term=terms[best], after=fits[best], instead_of=former)

    @classmethod
    def over_time(cls, effect: ColumnEffect, sizes: FloatArray) -> CourseTerm:
        """A term of an effect's column in its shape, its components in proportion to their sizes, shape (k,)."""
        timed = structs.replace(effect, lag_s=0.0, response_s=RESPONSE_S, response_order=1, course=(), episode=0.0)
        mix = sizes / max(float(np.abs(sizes).max()), 1e-300)
        return replace(cls.of(timed), mix=tuple(mix.tolist()))

    def probability_beside(self, search: Search, fitted: Fitted) -> float:
        """p-value of its column by any course beside the terms fitted."""
        return check_remainder(fitted, search.quantities, search.seed, only=self.columns).p_value

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """One effect with a course; its weights' error as that of what they do in a typical passage."""
        sizes, covariance = self._weights(fitted)
        weights, (size, error) = KERNELS.T @ sizes, self._passage(fitted, sizes, covariance).largest_shift
        total = max(float(np.abs(weights).sum()), 1e-300)
        course = tuple((float(late), float(one / total)) for late, one in zip(SECONDS, weights, strict=True))
        sized = structs.replace(self.effect, course=course, response_range=())
        response = fitted.coarse.fine_response(sized)[fitted.coarse.timeline.valid]
        effect = structs.replace(
            sized,
            acts=Acts.LOCATION,
            coefficients=tuple(total * np.asarray(self.mix)),
            errors=tuple(total * np.abs(self.mix) * error / max(abs(size), 1e-12)),
            reference=tuple(response.mean(axis=0)),
            response_range=tuple(zip(response.min(axis=0).tolist(), response.max(axis=0).tolist(), strict=True)),
            driven=driven_values(fitted.coarse, self.columns),
        )
        return (effect,)

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """What the car does in a typical passage: the farthest that it goes."""
        passage = self._passage(fitted, *self._weights(fitted))
        described = super().describe(fitted, effects, key)
        size, error = passage.largest_shift
        over_time = replace(described, shape=f"{described.shape}, over time", lag_s=None, response_s=None)
        return replace(over_time, size_m=size, size_error=error, passage=passage)

    def _weights(self, fitted: Fitted) -> tuple[FloatArray, FloatArray]:
        """Gain at each delay and its covariance, smooth as far as the rows leave it open. [m] per unit"""
        part = fitted.mean_part(self)
        return penalised(fitted.sizes[part], fitted.covariance[part, part], SMOOTH_COVARIANCE)

    def _passage(self, fitted: Fitted, sizes: FloatArray, covariance: FloatArray) -> Passage:
        passage, step = typical_passage(fitted.coarse, self.effect), fitted.coarse.timeline.step
        quantity = coarse_mean(self.effect.response(step, {self.effect.columns[0]: passage.column}))
        moved = tents(quantity @ np.asarray(self.mix), np.zeros(len(quantity), dtype=np.intp))
        moved = moved - moved[0]
        error = np.sqrt(np.sum((moved @ covariance) * moved, axis=1))
        return replace(passage, path=moved @ sizes, error=error)
