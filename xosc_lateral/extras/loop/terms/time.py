"""What changes with time and no column explains: the mean or the spread as a smooth function, or one step of the mean.

A driver learns or tires, a camera warms up or is calibrated anew. The smooths are half cosines over the drive, as many
as the test asks for; what the profile gets is penalised: the k-th one's size has a prior variance that falls with the
fourth power of k, as of an integrated random walk, at the scale that the sizes themselves make likeliest [1]_.

References
----------
.. [1] S. N. Wood, "Generalized Additive Models", 2nd ed., 2017, section 5.8 and chapter 6: smooths as random effects.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.effects import Acts, Effect, Step, TimeSmooth
from xosc_lateral.drivers.model.seeds import generator
from xosc_lateral.extras.loop import low_frequencies as low
from xosc_lateral.extras.loop.dictionary import Search, beside, orthonormal
from xosc_lateral.extras.loop.drives import (
    MEAN_INFLATION,
    SPREAD_INFLATION,
    Pooled,
    counted,
    own_time,
    slope_alike,
)
from xosc_lateral.extras.loop.model import CLIP, Description, Fitted, Outcome, Stage, Term, fit_model, proper
from xosc_lateral.extras.loop.refinement import Alternatives
from xosc_lateral.extras.loop.significance import LoopSeed
from xosc_lateral.extras.loop.terms import spread
from xosc_lateral.extras.loop.terms.column import ColumnTerm, columns_on_size
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.timeline import COARSE, MIN_DRIFT_S, MIN_VALID_S, Coarse

STEP_PARAMETERS = 2  # Of a step: its height and its moment.
# Time constants of an exponential that are tried, a factor of two apart. [s]
SETTLING_S = (150.0, 300.0, 600.0, 1200.0)
AS_LIKELY = float(np.log(20.0))  # A form so much less likely than the best, or less so, is not ruled out. [nat]
CHANGE_WITH_TIME = "change of the mean with time"
# Where it is surer than the best column by this factor, what that column may do is left to time. [-]
TIME_ADVANTAGE = 0.01


class _MeanByTime(Term):
    """Step or smooth of the mean: they are tested at the same time, and compete."""

    component: ClassVar[str] = "time_mean"
    weight: ClassVar[float] = 3.0

    @property
    def kind_key(self) -> str:
        """Two kinds share the component."""
        return self.kind

    def probability_beside(self, search: Search, fitted: Fitted) -> float:
        """p-value of the mean by time, whichever of the two it looks like beside the terms fitted."""
        test = StepTerm.test(search, fitted)
        return 1.0 if test is None else test.p_value


@dataclass(frozen=True, eq=False)
class StepTerm(_MeanByTime):
    """The mean jumps once."""

    kind: ClassVar[str] = "step"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.LOW_FREQUENCY,)
    seen_held_out: ClassVar[bool] = False
    at: int  # Row of the 1 Hz grid.
    others: tuple[str, ...] = ()  # Forms that are about as likely.
    alike: Alternatives = ()

    def mean_columns(self, coarse: Coarse) -> FloatArray:
        """0 before, 1 after, shape (n, 1). [-]"""
        return (np.arange(len(coarse)) >= self.at).astype(np.float64)[:, None]

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Step or smooth, whichever is likelier, each parameter at Schwarz's price (Annals of Statistics 6, 1978)."""
        coarse = fitted.coarse
        if any(isinstance(term, _MeanByTime) for term in fitted.terms):
            return None
        alike = mean_alike(fitted)
        if not coarse.lasts:  # short drives say which way they go, one by one, and nothing of the form
            if alike is None:
                return None
            return _unless_unlike(cls, search, fitted, alike, Outcome(TimeMeanTerm(), (), alike.p_value))
        rows, whitener = low.slow_rows(fitted)
        moments = low.step_moments(coarse)
        jumps = whitener.rows((np.arange(len(coarse))[:, None] >= moments).astype(np.float64))
        waves = whitener.rows(low.half_cosines_of(coarse, max(low.ORDERS)))
        slow, waves, jumps = (
            low.low_frequencies(one, coarse, coarse.valid, low.MEAN_SHORTEST_S) for one in (rows[:, None], waves, jumps)
        )
        p_value = low.mean_probability(slow[:, 0], waves, jumps, generator(search.seed, LoopSeed.LOW_FREQUENCY))
        if not len(moments):
            return _unless_unlike(cls, search, fitted, alike, Outcome(TimeMeanTerm(), (), p_value))
        unit = jumps / np.maximum(np.linalg.norm(jumps, axis=0), 1e-12)
        step = cls(low.moment_of(rows, whitener, int(moments[np.argmax(np.abs(unit.T @ slow[:, 0]))])))
        smooth = low.smooth_probabilities(slow[:, 0], waves, low.ORDERS)
        order = min(smooth, key=smooth.__getitem__)
        settling = [TimeMeanTerm(1, settling_s=seconds) for seconds in SETTLING_S]
        forms = {
            "step": _priced(fitted, step, STEP_PARAMETERS),
            "smooth": _priced(fitted, TimeMeanTerm(order), order),
            "settling": max(_priced(fitted, form, STEP_PARAMETERS) for form in settling),
        }
        best = max(forms, key=forms.__getitem__)
        others = tuple(one for one in forms if one != best and forms[one] > forms[best] - AS_LIKELY)
        change: StepTerm | TimeMeanTerm = TimeMeanTerm(form=best, others=others)
        change = replace(step, others=others) if best == "step" else change
        if cls.passes(search, p_value, fitted):
            change = replace(change, alike=_columns_as_likely(search, fitted, MeanTerm, forms[best]))
        return Outcome(change, (), p_value)

    def matches(self, other: Self) -> bool:
        """About the same moment."""
        return isinstance(other, StepTerm) and abs(self.at - other.at) <= low.SAME_S

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Height, moment, and the share of the drive before it: the mean stays."""
        coarse, part = fitted.coarse, fitted.mean_part(self)
        before = coarse.valid & (np.arange(len(coarse)) < self.at)
        step = Step(
            size=float(fitted.sizes[part][0]),
            size_error=float(np.sqrt(fitted.covariance[part, part][0, 0])),
            at_s=float(coarse.time[self.at]),
            share_before=float(before.sum() / coarse.valid.sum()),
        )
        return (step,)

    def quantity(self, coarse: Coarse, effects: tuple[Effect, ...]) -> FloatArray:
        """0 before, 1 after."""
        return (np.arange(len(coarse.timeline)) >= self.at * COARSE).astype(float)

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Height and moment."""
        effect = proper(effects, Step)
        name, shape = _named("step", self.others, f"at {effect.at_s:.0f} s")
        return Description(name, shape, effect.size, effect.size_error, f"mean by effect: {key}")


@dataclass(frozen=True, eq=False)
class TimeMeanTerm(_MeanByTime):
    """The mean is a smooth function of time; `StepTerm` tests both."""

    kind: ClassVar[str] = "drift"
    order: int = max(low.ORDERS)  # Half cosines that it is made of.
    settling_s: float = 0.0  # Time constant of an exponential in their place; 0: none. [s]
    form: str = "smooth"
    others: tuple[str, ...] = ()  # Forms that are about as likely.
    alike: Alternatives = ()

    def mean_columns(self, coarse: Coarse) -> FloatArray:
        """Half cosines, within -1..1, shape (n, order), or an exponential. [-]"""
        if self.settling_s:
            return np.exp(-(coarse.time - low.clock_range(coarse)[0]).clip(0.0) / self.settling_s)[:, None]
        return low.half_cosines_of(coarse, self.order)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Penalised sizes."""
        part = fitted.mean_part(self)
        sizes, errors = penalised_cosines(fitted.sizes[part], fitted.covariance[part, part])
        return (_smooth(fitted.coarse, location=tuple(sizes), location_errors=tuple(errors)),)

    def quantity(self, coarse: Coarse, effects: tuple[Effect, ...]) -> FloatArray:
        """The curve."""
        effect = proper(effects, TimeSmooth)
        return effect.path(effect.location, coarse.timeline.time)

    def removed(self, fitted: Fitted, effects: tuple[Effect, ...]) -> Sequence[tuple[Acts, FloatArray]]:
        """As the profile has it."""
        path = self.quantity(fitted.coarse, effects)
        return [(Acts.LOCATION, path - path[fitted.coarse.timeline.valid].mean())]

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Change between its extremes, in the order of time."""
        effect = proper(effects, TimeSmooth)
        size, error, shape = _swing(fitted.coarse, effect, effect.location, effect.location_errors)
        name, shape = _named(self.form, self.others, shape.removeprefix("smooth, "))
        return Description(
            "mean offset by time" if name == "smooth" else name, shape, size, error, f"mean by effect: {key}"
        )


@dataclass(frozen=True, eq=False)
class TimeSpreadTerm(Term):
    """The logarithm of the spread is a smooth function of time."""

    component: ClassVar[str] = "time_spread"
    kind: ClassVar[str] = "scale"
    stages: ClassVar[tuple[Stage, ...]] = (Stage.SPREAD,)
    weight: ClassVar[float] = 2.0
    order: int = max(low.ORDERS)  # Half cosines that it is made of.
    slow: bool = False  # Of the slower movement only.
    alike: Alternatives = ()

    def predictable(self, fitted: Fitted) -> bool:
        """As far as the innovations change."""
        return not self.slow

    def scale_columns(self, coarse: Coarse) -> FloatArray:
        """Half cosines, shape (n, order); none where only slow movement changes. [-]"""
        return np.zeros((len(coarse), 0)) if self.slow else low.half_cosines_of(coarse, self.order)

    def size_columns(self, coarse: Coarse) -> FloatArray:
        """Half cosines, shape (n, order), whichever movement changes. [-]"""
        return low.half_cosines_of(coarse, self.order)

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """The slowest half cosines of the squares beside those that are a little quicker, by an F test."""
        alike_in_all = spread_alike(fitted)
        if (not fitted.coarse.lasts and alike_in_all is None) or any(isinstance(term, cls) for term in fitted.terms):
            return None
        # what a column does to the size of any part of the movement is not time's doing, slow as the column may be
        known = search.cross_basis(columns_on_size(fitted))
        may_act, p_column = spread.what_a_column_may_do(search, fitted)
        columns = low.half_cosines_of(fitted.coarse, max(low.SPREAD_ORDERS))
        least_s = MIN_DRIFT_S if alike_in_all is None else MIN_VALID_S

        def best_beside(known: FloatArray) -> tuple[float, bool] | None:
            tested = []
            for slow, squares in enumerate((spread.quick_squares(fitted), spread.slow_squares(fitted))):
                valid, both = squares.valid, np.column_stack([squares.standardised, columns])
                constant = np.ones(valid.sum())
                both[valid] = beside(orthonormal(np.column_stack([constant, known[valid]])), both[valid])
                parts = (both[:, :1], both[:, 1:])
                rows, basis = (low.low_frequencies(own, fitted.coarse, valid, low.SHORTEST_S, least_s) for own in parts)
                tests = low.smooth_probabilities(rows[:, 0], basis, low.SPREAD_ORDERS)
                tested += [(p_value, bool(slow)) for p_value in tests.values()]
            return (min(1.0, min(tested)[0] * len(tested)), min(tested)[1]) if tested else None

        best = best_beside(known)
        if best is not None and best[0] > TIME_ADVANTAGE * p_column:
            best = best_beside(np.concatenate([known, may_act], axis=1))
        if best is None:
            return None
        p_value, slow = best
        alike: Alternatives = ()
        if not slow and cls.passes(search, p_value, fitted):
            by_time = max(_priced(fitted, cls(order), order) for order in low.SPREAD_ORDERS)
            alike = _columns_as_likely(search, fitted, spread.SpreadTerm, by_time)
        return _unless_unlike(cls, search, fitted, alike_in_all, Outcome(cls(slow=slow, alike=alike), (), p_value))

    def matches(self, other: Self) -> bool:
        """Whichever movement changes."""
        return isinstance(other, TimeSpreadTerm)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Penalised sizes; the fine noise goes along as far as it does."""
        coarse = fitted.coarse
        columns = low.half_cosines_of(coarse, self.order)
        if self.slow:
            sizes, errors = spread.log_sizes(spread.slow_squares(fitted), columns)
            sizes, errors = penalised_cosines(
                sizes, np.diag(np.square(errors) * spread.SLOW_S)
            )  # neighbouring sums overlap
            fine = np.zeros(len(sizes))
        else:
            part = fitted.scale_part(self)
            sizes, errors = penalised_cosines(fitted.log_sizes[part], fitted.log_covariance[part, part])
            fine, fine_errors = spread.log_sizes(spread.fine_squares(fitted), columns)
            fine = penalised_cosines(fine, np.diag(np.square(fine_errors)))[0]
        return (_smooth(coarse, spread=tuple(sizes), spread_errors=tuple(errors), fine=tuple(fine)),)

    def quantity(self, coarse: Coarse, effects: tuple[Effect, ...]) -> FloatArray:
        """The curve of the spread."""
        effect = proper(effects, TimeSmooth)
        return effect.path(effect.spread, coarse.timeline.time)

    def removed(self, fitted: Fitted, effects: tuple[Effect, ...]) -> Sequence[tuple[Acts, FloatArray]]:
        """A plain function of time."""
        effect, time = proper(effects, TimeSmooth), fitted.coarse.timeline.time
        return [(Acts.SPREAD, effect.path(effect.spread, time)), (Acts.FINE, effect.path(effect.fine, time))]

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Factor between its extremes, in the order of time."""
        effect = proper(effects, TimeSmooth)
        size, error, shape = _swing(fitted.coarse, effect, effect.spread, effect.spread_errors)
        factor = float(np.exp(size))
        return Description("spread by time", shape, factor, factor * error, f"spread by effect: {key}")


ALIKE = 0.05  # Level of the second question: does it change in every drive alike? [-]


def mean_alike(fitted: Fitted) -> Pooled | None:
    """Slope of the mean by time that all drives have in common [m/s]; None: fewer than three drives."""
    rows, whitener = low.slow_rows(fitted)
    return slope_alike(rows, whitener.rows(own_time(fitted.coarse)), fitted.coarse, MEAN_INFLATION)


def spread_alike(fitted: Fitted) -> Pooled | None:
    """The same of the logarithm of the spread. [1/s]"""
    coarse, squares = fitted.coarse, spread.quick_squares(fitted)
    problem = spread.of_squares(coarse, squares, spread.known_log_scale(fitted))
    rows, column = (problem.whitener.rows(one) for one in (problem.series, own_time(coarse)))
    pooled = slope_alike(rows, column, coarse, SPREAD_INFLATION)
    clipped = np.minimum(squares.values, CLIP)[squares.valid]
    unit = 0.5 * float(clipped.std() / max(float(clipped.mean()), 1e-300))  # of a square to that of a logarithm
    if pooled is None:
        return None
    # each drive's own slowest half cosine beside those that are a little quicker
    waves = np.cos(np.pi * own_time(coarse) / np.maximum(counted(coarse), 1.0)[coarse.drive])
    each = waves[:, None] * (coarse.drive[:, None] == np.flatnonzero(counted(coarse)))
    slow, basis = (
        low.low_frequencies(one, coarse, squares.valid, low.SHORTEST_S, MIN_VALID_S)
        for one in (squares.standardised[:, None], each)
    )
    within = low.smooth_probabilities(slow[:, 0], basis, (basis.shape[1],)).get(basis.shape[1], 1.0)
    return replace(pooled, size=unit * pooled.size, error=unit * pooled.error, within=within)


def _unless_unlike(kind: type[Term], search: Search, fitted: Fitted, alike: Pooled | None, outcome: Outcome) -> Outcome:
    """Something changes within drives; unless it does so in all of them alike, a profile can't say when."""
    passes = kind.passes(search, outcome.p_value, fitted)
    if alike is None or (passes and alike.p_value <= ALIKE):
        return outcome
    own_way = min(alike.within, outcome.p_value if passes else 1.0)
    return replace(outcome, term=None, own_way=own_way if kind.passes(search, own_way, fitted) else None)


def _named(form: str, others: tuple[str, ...], when: str) -> tuple[str, str]:
    """What a change is called, and its form in words; a change with time where other forms are as likely."""
    if not others:
        return form, when if form == "step" else f"{form}, {when}"
    return CHANGE_WITH_TIME, f"{form}, {when}; about as likely: {', '.join(others)}"


def _priced(fitted: Fitted, term: Term, parameters: int) -> float:
    """Log-likelihood with one more term, less Schwarz's price of its parameters. [nat]"""
    price = 0.5 * parameters * float(np.log(fitted.coarse.valid.sum()))
    return fit_model(fitted.coarse, (*fitted.terms, term)).log_likelihood - price


def _columns_as_likely(search: Search, fitted: Fitted, kind: type[ColumnTerm], by_time: float) -> Alternatives:
    """Columns that as they are explain about as much as time does, whose priced likelihood is `by_time`."""
    terms = (kind.of(structs.replace(one.effect, response_s=1.0)) for one in search.plain_candidates())
    return tuple(dict.fromkeys(term.columns for term in terms if _priced(fitted, term, 1) > by_time - AS_LIKELY))


def penalised_cosines(sizes: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sizes of half cosines and their errors, shape (k,), given that rougher ones are smaller beforehand."""
    estimates, known = low.penalised(sizes, covariance, np.diag(np.arange(1, len(sizes) + 1, dtype=np.float64) ** -4.0))
    return estimates, np.sqrt(np.diag(known))


def _smooth(coarse: Coarse, **sizes: tuple[float, ...]) -> TimeSmooth:
    from_s, to_s = low.clock_range(coarse)
    return TimeSmooth(from_s=from_s, to_s=to_s, **sizes)


def _swing(
    coarse: Coarse, effect: TimeSmooth, sizes: tuple[float, ...], errors: tuple[float, ...]
) -> tuple[float, float, str]:
    """Later extreme less earlier, its standard error, and when they are. [m] or natural logarithm"""
    time = np.unique(coarse.time[coarse.valid])
    path = effect.path(sizes, time)
    first, last = sorted((int(np.argmin(path)), int(np.argmax(path))))
    contrast = [np.diff(effect.path(tuple(row), time[[first, last]]))[0] for row in np.eye(len(sizes))]
    error = float(np.linalg.norm(np.multiply(contrast, errors)))
    return float(path[last] - path[first]), error, f"smooth, from {time[first]:.0f} s to {time[last]:.0f} s"
