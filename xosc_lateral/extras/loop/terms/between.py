"""A column whose usual value in a drive goes with the place that the drive keeps: slow vehicles keep right, say.

Every drive has a level of its own, so what hardly changes within drives can't act on the mean there. Here the levels
themselves are regressed on what each drive usually meets, weighted by how well each is known beside how much drives
differ anyway. With many drives the null deals them anew, which is exact: drives know nothing of one another. Columns of
whole drives go along with each other (the left lane is the fast one), and two may act against each other and show
together only: so pairs are tested, too. Of five drives and more, columns that are constant in each are tested by an
exact t, on the place as on the size of the movement.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Effect, Linear
from xosc_lateral.drivers.model.seeds import generator
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.drives import (
    FEWEST_BETWEEN,
    Pooled,
    counted,
    left_of_drives,
    regress,
    weights_between,
)
from xosc_lateral.extras.loop.model import Description, Fitted, Outcome, Stage, clipped_squares, design_of
from xosc_lateral.extras.loop.significance import MANY_DRIVES, NULL_DRAWS, LoopSeed, as_one_degree, upper_tail
from xosc_lateral.extras.loop.terms.column import ColumnTerm, of_kind
from xosc_lateral.extras.loop.timeline import missing_throughout

# Response time of an effect between drives: what a drive usually meets, as far as a run can know it. [s]
USUAL_S = 60.0
MIN_SECONDS = 10  # Of road-following in a drive that is counted. [s]
MIN_SUPPORT = 8.0  # A quantity that rests on fewer drives than this is not tested.
# Share of either member's variance that the other of a pair must leave: below, the two are one quantity twice. [-]
LEAST_APART = 0.1


@dataclass(frozen=True, eq=False)
class _DrivesTerm(ColumnTerm):
    """What differs from drive to drive."""

    stages: ClassVar[tuple[Stage, ...]] = (Stage.BETWEEN_DRIVES,)
    seen_held_out: ClassVar[bool] = False
    within_drives: ClassVar[bool] = False

    def describe(self, fitted: Fitted, effects: tuple[Effect, ...], key: str) -> Description:
        """Change or factor between drives; it has no lag."""
        size = super().describe(fitted, effects, key)
        return replace(size, shape=f"{size.shape}, between drives", lag_s=None, response_s=None)


@dataclass(frozen=True, eq=False)
class BetweenTerm(_DrivesTerm):
    """Between-driver regression of the drives' levels."""

    component: ClassVar[str] = "between"
    kind: ClassVar[str] = "location"
    weight: ClassVar[float] = 5.0
    acts: ClassVar[Acts] = Acts.LOCATION
    what: ClassVar[str] = "place that a drive keeps"
    group: ClassVar[str] = "mean"

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Best candidate, or pair of candidates, over all columns and shapes, against drives dealt anew."""
        coarse, places = fitted.coarse, _Places.of(fitted)
        if np.count_nonzero(places.weight) < MANY_DRIVES:
            return _best_of_whole_drives(cls, search, fitted)
        present = {name for term in of_kind(fitted, cls) for name in term.columns}
        candidates, usual, root = [], [], np.sqrt(places.weight)
        for candidate, values in zip(search.quantities.candidates, search.quantities.values, strict=True):
            if (
                len(candidate.columns) > 1
                or len(candidate.contrast) > 1
                or present & set(candidate.columns)
                # a line in a distance would set a neighbour who is far away apart from one who is gone
                or (isinstance(candidate.effect, Linear) and search.columns[candidate.columns[0]].gaps)
                # it would say which drive it is
                or missing_throughout(coarse.context[candidate.columns[0]], coarse.timeline).any()
            ):
                continue
            mean = left_of_drives(coarse.by_drive(values.astype(np.float64)), places.known, root)
            power = float(mean @ mean)
            if power > 1e-12 and power**2 / max(float(np.sum(mean**4)), 1e-300) >= MIN_SUPPORT:
                candidates.append(candidate)
                usual.append(mean / np.sqrt(power))
        if not candidates:
            return None
        members, p_value = best_of_drives(
            left_of_drives(places.place, places.known, root),
            places.weight > 0.0,
            np.stack(usual, axis=1),
            np.array([candidate.cost for candidate in candidates]),
            [candidate.columns[0] for candidate in candidates],
            generator(search.seed, LoopSeed.BETWEEN),
        )
        terms = [cls.of(structs.replace(candidates[index].effect, lag_s=0.0, response_s=USUAL_S)) for index in members]
        return Outcome(terms[0], tuple(term.columns[0] for term in terms), p_value, together=tuple(terms[1:]))

    def matches(self, other: Self) -> bool:
        """Any other: columns that go along with each other from drive to drive stand in for one another."""
        return isinstance(other, BetweenTerm)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Weighted least squares over drives, all such terms jointly."""
        sizes, errors = _Places.of(fitted).sizes()
        widths = {term: fitted.coarse.response(term.effect).shape[1] for term in of_kind(fitted, BetweenTerm)}
        is_self = np.repeat([term is self for term in widths], list(widths.values()))
        return (self.sized(fitted.coarse, Acts.LOCATION, sizes[is_self], errors[is_self]),)


@dataclass(frozen=True, eq=False)
class BetweenSpreadTerm(_DrivesTerm):
    """Between-driver regression of the logarithm of the drives' own sizes of movement."""

    component: ClassVar[str] = "between_spread"
    kind: ClassVar[str] = "scale"
    weight: ClassVar[float] = 3.0
    acts: ClassVar[Acts] = Acts.SPREAD
    what: ClassVar[str] = "spread that a drive has"

    @classmethod
    def test(cls, search: Search, fitted: Fitted) -> Outcome | None:
        """Best column that is constant in every drive, by an exact t of few drives."""
        return _best_of_whole_drives(cls, search, fitted)

    def estimate(self, fitted: Fitted) -> tuple[Effect, ...]:
        """Weighted least squares over drives; the fine noise goes along, as it does with a drive's own size."""
        usual = fitted.coarse.by_drive(fitted.coarse.response(self.effect)[:, 0])
        pooled = between_drives(fitted, type(self), usual)
        sizes, errors = np.array([pooled.size]), np.array([pooled.error])
        return tuple(self.sized(fitted.coarse, acts, sizes, errors) for acts in (Acts.SPREAD, Acts.FINE))


def whole_drive_columns(search: Search) -> dict[str, FloatArray]:
    """Columns that may act and are constant in every drive, shape (drives,), in their units; NaN: a drive too short."""
    coarse, constant = search.coarse, {}
    inside, lasting = coarse.timeline.valid, counted(coarse) > 0.0
    for name, column in search.columns.items():
        by_drive = [coarse.context[name][span][inside[span]] for span in coarse.timeline.spans]
        known = [values for values, lasts in zip(by_drive, lasting, strict=True) if lasts]
        if column.period or not all(np.isfinite(values).all() and np.ptp(values) == 0.0 for values in known):
            continue
        constant[name] = np.array(
            [values[0] if lasts else np.nan for values, lasts in zip(by_drive, lasting, strict=True)]
        )
    return constant


def can_be_told(values: FloatArray) -> bool:
    """Whether enough drives differ in a column, shape (drives,), not by a single one of them."""
    there = np.sort(values[np.isfinite(values)])
    return len(there) >= FEWEST_BETWEEN and bool(there[0] < there[-2] and there[1] < there[-1])


def between_drives(fitted: Fitted, kind: type[ColumnTerm], values: FloatArray) -> Pooled:
    """Slope of the drives' places or log sizes on a column, shape (drives,). [m] or natural logarithm per unit"""
    coarse, seconds = fitted.coarse, counted(fitted.coarse)
    rows = (seconds > 0.0) & np.isfinite(values)
    if kind is BetweenTerm:
        places, noise = fitted.levels, 1.0 / np.maximum(fitted.whitener.power, 1e-300)
    else:
        _, scales, known = design_of(coarse, fitted.terms)
        places = coarse.by_drive(np.log(fitted.scale) - scales @ fitted.log_sizes - known)
        squares = clipped_squares(fitted.innovations, coarse.valid)[coarse.valid]
        noise = 0.25 * float(squares.var() / squares.mean() ** 2) / np.maximum(seconds, 1.0)
    return regress(places[rows], noise[rows], values[rows])


def _best_of_whole_drives(kind: type[ColumnTerm], search: Search, fitted: Fitted) -> Outcome | None:
    if of_kind(fitted, kind):
        return None
    tested = {name: values for name, values in whole_drive_columns(search).items() if can_be_told(values)}
    p_values = {name: between_drives(fitted, kind, values).p_value for name, values in tested.items()}
    if not p_values:
        return None
    best = min(p_values, key=p_values.__getitem__)
    term = kind.of(Linear(acts=kind.acts, column=best, response_s=USUAL_S))
    return Outcome(term, (best,), min(1.0, p_values[best] * len(p_values)))


def is_between(effect: ColumnEffect) -> bool:
    """Whether an effect acts by what a drive usually meets."""
    return effect.response_s >= USUAL_S


def between_shift(fitted: Fitted) -> FloatArray:
    """What the effects between drives do to every drive's place, shape (drives,). [m]"""
    places = _Places.of(fitted)
    return np.asarray(places.known[:, 1:] @ places.sizes()[0])


@dataclass(frozen=True, eq=False, slots=True)
class _Places:
    """Places that drives keep."""

    place: FloatArray  # shape (drives,): Levels. [m]
    # shape (drives,): One over the variance of a place about what is known; 0: the drive is too short. [1/m^2]
    weight: FloatArray
    known: FloatArray  # shape (drives, k): A one and the effects between drives that are in the model.

    @classmethod
    def of(cls, fitted: Fitted) -> _Places:
        """With what is known of them, and how well."""
        coarse, groups = fitted.coarse, fitted.coarse.drives
        seconds = np.bincount(coarse.drive, coarse.valid.astype(float), minlength=groups)
        power = fitted.whitener.power
        noise = np.where((seconds >= MIN_SECONDS) & (power > 0.0), 1.0 / np.maximum(power, 1e-300), np.inf)
        responses = (coarse.response(term.effect) for term in of_kind(fitted, BetweenTerm))
        usual = [coarse.by_drive(part) for response in responses for part in response.T]
        known = np.column_stack([np.ones(groups), *usual])
        return cls(fitted.levels, weights_between(fitted.levels, noise, known), known)

    def sizes(self) -> tuple[FloatArray, FloatArray]:
        """Sizes of the known effects and their standard errors, shape (k,) each. [m] per unit"""
        weighed = self.known * self.weight[:, None]
        inverse = np.linalg.pinv(weighed.T @ self.known)
        return (inverse @ (weighed.T @ self.place))[1:], np.sqrt(np.diag(inverse))[1:]


def best_of_drives(
    left: FloatArray,
    counted: BoolArray,
    quantities: FloatArray,
    costs: FloatArray,
    columns: Sequence[str],
    rng: np.random.Generator,
) -> tuple[tuple[int, ...], float]:
    """One candidate or two of different columns that gain most in chi-square less their `costs`, against drives dealt
    anew; `left`, shape (drives,), and `quantities`, shape (drives, k), are free of what is known."""
    rows = np.flatnonzero(counted)
    draws = np.zeros((NULL_DRAWS + 1, len(left)))
    draws[0] = left
    for drawn in draws[1:]:
        drawn[rows] = left[rng.permutation(rows)]
    names, products = np.array(columns), quantities.T @ quantities
    apart = (names[:, None] != names) & (1.0 - np.square(products) >= LEAST_APART)
    first, second = np.nonzero(np.triu(apart, 1))
    product = products[first, second]

    def pairs(z: FloatArray) -> FloatArray:
        power = np.square(z[first]) + np.square(z[second]) - 2.0 * product * z[first] * z[second]
        return np.asarray(power / (1.0 - np.square(product)))

    z = draws @ quantities
    singles = np.square(z) - costs
    scores = singles.max(axis=1)
    if len(first):
        best = np.array([pairs(drawn).max() for drawn in z])  # one by one: a table of all would fill gigabytes
        scores = np.maximum(scores, as_one_degree(best, 2) - 2.0 * np.log(len(first)))
    p_value, alone = upper_tail(float(scores[0]), scores[1:]), int(np.argmax(singles[0]))
    if singles[0, alone] >= scores[0]:
        return (alone,), p_value
    pair = int(np.argmax(pairs(z[0])))
    return (int(first[pair]), int(second[pair])), p_value
