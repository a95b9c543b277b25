"""Forward selection of terms: test, add, test again, until nothing is left that chance would not produce."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from xosc_lateral.arrays import FloatArray
from xosc_lateral.identification import terms
from xosc_lateral.identification.candidates import candidates_of
from xosc_lateral.identification.columns import Column
from xosc_lateral.identification.dictionary import CROSS_BASIS, TIMINGS, Quantities, orthonormal
from xosc_lateral.identification.refinement import Alternatives
from xosc_lateral.identification.regression import Coarse, Fitted, fit_model
from xosc_lateral.identification.significance import Budget
from xosc_lateral.identification.terms.base import Stage, Term
from xosc_lateral.normal import NORMAL_95
from xosc_lateral.plugins import defined_in

# Every term that a file of `terms` defines, by the file's name.
TERMS: tuple[type[Term], ...] = defined_in(terms.__name__, Term)  # type: ignore[type-abstract]


def in_stages(kinds: tuple[type[Term], ...]) -> tuple[tuple[type[Term], ...], ...]:
    """Kinds of term by stage, in the order in which they are tested."""
    asked = sorted(kinds, key=lambda kind: kind.place)
    return tuple(tuple(kind for kind in asked if stage in kind.stages) for stage in Stage)


def shared_among(kinds: tuple[type[Term], ...]) -> Budget:
    """The error budget by the terms' own weights; those of one component compete, and share one part of it."""
    return Budget(
        {kind.component: kind.weight for kind in kinds}, {kind.component: kind.least_drives for kind in kinds}
    )


STAGES = in_stages(TERMS)  # Of a stage, what has the smallest p-value is added first.
ERROR_BUDGET = shared_among(TERMS)  # Of all kinds of term.
MAX_TERMS = 8  # Terms of one table, at most.
# Products are tried among so many columns at most, those whose role is known first: sixty more columns must not cost
# twenty times as much.
MAX_PRODUCT_COLUMNS = 24
# Scored dictionaries that are kept, each of tens of megabytes: of the mean and of the spread beside the same fit.
KEPT = 2


@dataclass(frozen=True, eq=False)
class Search:
    """What stays the same while terms are selected: columns, candidates before whitening, random streams."""

    coarse: Coarse
    columns: Mapping[str, Column]  # That may act.
    quantities: Quantities
    seed: np.random.SeedSequence
    budget: Budget  # How surely each component has to be found.
    progress: Callable[[str], None]  # Gets what is being done, in a few words.
    # How many terms a component has in the table that this is a part of: so many are added, best first, whatever their
    # p-values, and components that have none are not tested. None: this is the table.
    wanted: Mapping[str, int] | None = None
    _kept: dict[tuple[object, int], tuple[object, Any]] = field(default_factory=dict, init=False, repr=False)

    @classmethod
    def over(
        cls,
        coarse: Coarse,
        columns: list[Column],
        seed: np.random.SeedSequence,
        budget: Budget,
        progress: Callable[[str], None] = lambda _: None,
    ) -> Search:
        """Evaluate all candidates once."""
        inside = coarse.timeline.valid
        seen = {column.name: coarse.context[column.name][inside] for column in columns}
        candidates = candidates_of(columns, seen, most=MAX_PRODUCT_COLUMNS)
        quantities = Quantities.of(candidates, coarse.timeline, coarse.context, coarse.valid)
        return cls(coarse, {column.name: column for column in columns}, quantities, seed, budget, progress)

    def once(self, kind: object, fitted: object, make: Callable[[], Any]) -> Any:
        """What is worked out for one kind of term beside one fit, as it was or else now; the last few are kept.

        For one thread: a search that is replaced, by that of a fold, begins with a memory of its own.
        """
        key = (kind, id(fitted))
        if key not in self._kept:
            self._kept[key] = (fitted, make())  # the fit is kept with it: no other has its id meanwhile
            for old in list(self._kept)[:-KEPT]:
                del self._kept[old]
        return self._kept[key][1]

    def cross_basis(self, columns: Collection[str]) -> FloatArray:
        """What columns can do in any shape, at any lag and response, at 1 Hz, orthonormal, shape (n, rank)."""
        known = frozenset(columns)
        own = np.array([known.issuperset(one.columns) for one in self.quantities.candidates], dtype=np.bool_)
        seconds, valid = np.arange(len(self.coarse)), self.coarse.valid[:, None]
        blocks = []
        for response_s, lags in TIMINGS.items():
            response = self.quantities.responses(np.flatnonzero(own), response_s)
            blocks += [response[np.clip(seconds - lag, 0, len(seconds) - 1)] * valid for lag in lags]
        return orthonormal(np.concatenate(blocks, axis=1).astype(np.float64), CROSS_BASIS)

    def level_of(self, component: str) -> float:
        """Family-wise level that a component may spend."""
        return self.budget.level_of(component, self.coarse.drives)

    def passes(self, component: str, p_value: float, terms: Sequence[Term]) -> bool:
        """Whether the best that was found of a component is good enough to be added to terms."""
        if p_value <= self.level_of(component):
            return True
        there = sum(term.component == component for term in terms)
        return self.wanted is not None and there < self.wanted.get(component, 0)

    def rng(self, *key: int) -> np.random.Generator:
        """Independent stream by purpose."""
        return np.random.default_rng(np.random.SeedSequence(self.seed.entropy, spawn_key=key))


@dataclass(frozen=True, slots=True)
class Gain:
    """Gain in log-likelihood on rows that nothing was chosen or fitted on."""

    mean: float  # Over blocks, per block. [nat]
    error: float  # Standard error of the mean. [nat]
    folds: int  # In how many folds the term was chosen again.

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the mean gain."""
        return self.mean - NORMAL_95 * self.error, self.mean + NORMAL_95 * self.error

    @property
    def stands(self) -> bool:
        """Whether the held-out blocks leave a significant term standing: no loss by a standard error [1]_.

        They are a veto, not a second proof: beside a gain of 12 nat over all blocks chance alone gives 6 either way,
        and what a fold gets wrong of lag, shape and size is lost on top. What no fold found again does not stand.

        References
        ----------
        .. [1] L. Breiman, J. Friedman, R. Olshen, C. Stone, "Classification and Regression Trees", 1984, section 3.4.3.
        """
        return self.mean + self.error > 0.0


@dataclass(frozen=True, eq=False)
class Accepted:
    """A term that chance does not explain; `gain`: on held-out rows, None: not judged."""

    term: Term
    p_value: float
    gain: Gain | None = None

    @property
    def alike(self) -> Alternatives:
        """Columns of each other effect that explains as much."""
        alike: Alternatives = getattr(self.term, "alike", ())
        return alike


@dataclass(frozen=True, slots=True)
class Rejected:
    """A candidate that did not pass; `was_found`: it was significant, and taken back."""

    component: str
    columns: tuple[str, ...]
    p_value: float
    why: str
    was_found: bool = False


@dataclass(frozen=True, eq=False)
class Selection:
    """Everything accepted in the order of finding, the best of each component that was not, fits before and after."""

    accepted: tuple[Accepted, ...]
    rejected: tuple[Rejected, ...]
    start: Fitted
    final: Fitted

    def without(self, terms: Sequence[Term], why: str) -> Selection:
        """Less some accepted terms, fitted again."""
        gone = {id(term) for term in terms}
        out = [one for one in self.accepted if id(one.term) in gone]
        taken_back = (Rejected(one.term.component, one.term.columns, one.p_value, why, was_found=True) for one in out)
        return Selection(
            tuple(one for one in self.accepted if one not in out),
            (*self.rejected, *taken_back),
            self.start,
            fit_model(self.final.coarse, [term for term in self.final.terms if id(term) not in gone]),
        )


def select(search: Search, initial: Sequence[Term] = ()) -> Selection:
    """Add terms stage by stage to those that are in the model already."""
    start = fitted = fit_model(search.coarse, initial)
    accepted: list[Accepted] = []
    rejected: dict[str, Rejected] = {}
    seen_at: dict[str, int] = {}
    for stage in STAGES:
        kinds = [kind for kind in stage if search.wanted is None or kind.component in search.wanted]
        while len(accepted) < MAX_TERMS:
            passed = []
            # a kind that found nothing is not asked again before something else was added
            for kind in [kind for kind in kinds if seen_at.get(kind.component) != len(accepted)]:
                component = kind.component
                search.progress(f"looking at {component.replace('_', ' ')}")
                test = kind.test(search, fitted)
                if test is None:
                    continue
                if test.term is not None and search.passes(component, test.p_value, fitted.terms):
                    passed.append((test.p_value, (test.term, *test.together), test.after))
                else:
                    seen_at[component] = len(accepted)
                    why = f"not significant: its p-value is above {search.level_of(component):.2g}"
                    rejected[component] = Rejected(component, test.columns, test.p_value, why)
            if not passed:
                break
            p_value, new, after = min(passed, key=lambda one: one[0])
            accepted += [Accepted(term, p_value) for term in new]
            fitted = after or fit_model(search.coarse, (*fitted.terms, *new))
    selection = Selection(tuple(accepted), tuple(rejected.values()), start, fitted)
    for one in accepted:
        selection = _tested_again(search, selection, one)
    return selection


def _tested_again(search: Search, selection: Selection, one: Accepted) -> Selection:
    """The same without a term that no longer stands beside what was found after it.

    Rotations keep how loud the movement is, not where: a column that goes along with loud stretches scores on the mean.
    And what no column explained may be explained by one that was found later.
    """
    if one not in selection.accepted:
        return selection
    later = [other.term for other in selection.accepted[selection.accepted.index(one) + 1 :]]
    if not any(one.term.may_be_explained_by(term, search.coarse) for term in later):
        return selection
    without = selection.without([one.term], "what was found after it explains it")
    search.progress(f"looking at {one.term.component.replace('_', ' ')} again")
    p_value = one.term.probability_beside(search, without.final)
    return selection if search.passes(one.term.component, p_value, without.final.terms) else without
