"""Forward selection of terms: test, add, test again, until nothing is left that chance would not produce.

References
----------
.. [1] Y. Mundlak, "On the pooling of time series and cross section data", Econometrica 46, 1978: an effect within
       groups beside that between them, in `is_undone_by_levels`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from logging import getLogger

import numpy as np
from msgspec import structs
from scipy.special import stdtr

from xosc_lateral.base.arrays import NORMAL_95
from xosc_lateral.base.plugins import defined_in
from xosc_lateral.drivers.fitting.regression import clustered_least_squares, small_sample_factor
from xosc_lateral.drivers.model.effects import ColumnEffect, Form, Product
from xosc_lateral.drivers.model.effects.ends import ends_of
from xosc_lateral.extras.loop import terms
from xosc_lateral.extras.loop.core_model import MIN_DRIVES
from xosc_lateral.extras.loop.dictionary import Search
from xosc_lateral.extras.loop.model import Fitted, Outcome, Stage, Term, design_of, fit_model, proper
from xosc_lateral.extras.loop.significance import BUDGET
from xosc_lateral.extras.loop.terms.column import ColumnTerm

# Every term that a file of `terms` defines, by the file's name.
TERMS: tuple[type[Term], ...] = defined_in(terms.__name__, Term)  # type: ignore[type-abstract]


def in_stages(kinds: tuple[type[Term], ...]) -> tuple[tuple[type[Term], ...], ...]:
    """Kinds of term by stage, in the order in which they are tested."""
    asked = sorted(kinds, key=lambda kind: kind.place)
    return tuple(tuple(kind for kind in asked if stage in kind.stages) for stage in Stage)


def shared_among(kinds: tuple[type[Term], ...]) -> dict[str, float]:
    """Part of the error budget of every component, by the terms' own weights; those of one component share a part."""
    weights = {kind.component: kind.weight for kind in kinds}
    return {component: BUDGET * weight / sum(weights.values()) for component, weight in weights.items()}


STAGES = in_stages(TERMS)  # Of a stage, what has the smallest p-value is added first.
ERROR_BUDGET = shared_among(TERMS)  # Of all kinds of term.
# What a mistake in a test or a description raises; errors that are meant for the user are others.
UNFORESEEN = (ArithmeticError, AssertionError, LookupError, TypeError, ValueError)
MAX_TERMS = 8  # Terms of one table, at most.
UNDONE_LEVEL = 0.01  # Probability with which an effect between drives that is as within them is taken back.
BY_PRODUCT = "it is the product with another column that acts"
# Why a term of the movement's size is taken back that holds within drives alone.
UNDONE = "significant within drives, but between them the movement's size does not follow it"


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
        """Whether the held-out blocks leave a significant term standing: no loss by a standard error (Breiman et al.
        1984).

        They are a veto, not a second proof: beside a gain of 12 nat over all blocks chance alone gives 6 either way,
        and what a fold gets wrong of lag, shape and size is lost on top. What no fold found again does not stand.
        """
        return self.mean + self.error > 0.0


@dataclass(frozen=True, eq=False)
class Accepted:
    """A term that chance does not explain; `gain`: on held-out rows, None: not judged."""

    term: Term
    p_value: float
    gain: Gain | None = None


@dataclass(frozen=True, slots=True)
class Rejected:
    """A candidate that did not pass; `was_found`: it was significant, and taken back; `own_way`: each drive changes."""

    component: str
    columns: tuple[str, ...]
    p_value: float
    why: str
    was_found: bool = False
    own_way: bool = False
    term: Term | None = None  # Of what a product stands for: it comes back where the product goes.


@dataclass(frozen=True, eq=False)
class Selection:
    """Everything accepted in the order of finding, the best of each component that was not, fits before and after."""

    accepted: tuple[Accepted, ...]
    rejected: tuple[Rejected, ...]
    start: Fitted
    final: Fitted

    def without(self, terms: Sequence[Term], why: str) -> Selection:
        """Less some accepted terms, fitted again; what only a product that goes stood for comes back."""
        if not terms:
            return self
        gone = {id(term) for term in terms}
        out = [one for one in self.accepted if id(one.term) in gone]
        left = [one for one in self.accepted if one not in out]
        products = [{frozenset(one.term.columns) for one in some} for some in (out, left)]
        back = {
            one: Accepted(one.term, one.p_value)
            for one in self.rejected
            if one.term is not None
            and [any(set(one.columns) < columns for columns in some) for some in products] == [True, False]
        }
        rejected = [one for one in self.rejected if one not in back]
        rejected += [
            Rejected(*about, was_found=True, term=one.term if why == BY_PRODUCT else None)
            for one in out
            for about in [(one.term.component, one.term.columns, one.p_value, why)]
        ]
        fitted = [term for term in self.final.terms if id(term) not in gone] + [one.term for one in back.values()]
        return Selection((*left, *back.values()), tuple(rejected), self.start, fit_model(self.final.coarse, fitted))

    def exchanged(self, before: Term, after: Term) -> Selection:
        """With one accepted term in place of another, fitted again."""
        accepted = tuple(replace(one, term=after) if one.term is before else one for one in self.accepted)
        fitted = [after if term is before else term for term in self.final.terms]
        return replace(self, accepted=accepted, final=fit_model(self.final.coarse, fitted))


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
                try:
                    test = _tested(search, kind, fitted)
                except UNFORESEEN as error:
                    seen_at[component] = len(accepted)
                    rejected[component] = Rejected(component, (), 1.0, failed("its test", error))
                    continue
                if test is None:
                    continue
                if test.term is not None and kind.passes(search, test.p_value, fitted):
                    passed.append((test.p_value, (test.term, *test.together), test))
                else:
                    seen_at[component] = len(accepted)
                    why = f"not significant: its p-value is above {search.levels[component]:.2g}"
                    if (own_way := test.own_way) is not None:
                        why = (
                            f"it changes within drives (p = {own_way:.1e}), in each in its own way, which no profile "
                            "knows"
                        )
                    rejected[component] = Rejected(
                        component, test.columns, test.p_value, why, own_way=own_way is not None
                    )
            if not passed:
                break
            p_value, new, test = min(passed, key=lambda candidate: candidate[0])
            former = [candidate for candidate in accepted if candidate.term is test.instead_of]
            accepted = [candidate for candidate in accepted if candidate not in former]
            accepted += [Accepted(term, min([p_value, *(candidate.p_value for candidate in former)])) for term in new]
            seen_at = {}
            fitted = test.after or fit_model(search.coarse, (*fitted.terms, *new))
    # a column that was found is not among what was not, over time or in slow movement, say
    known = {(alike.component, one.term.columns) for one in accepted for alike in TERMS if alike.asks_as(one.term)}
    failing = tuple(rest for rest in rejected.values() if (rest.component, rest.columns) not in known)
    selection = Selection(tuple(accepted), failing, start, fitted)
    for candidate in accepted:
        try:
            selection = _tested_again(search, selection, candidate)
        except UNFORESEEN as error:
            selection = selection.without([candidate.term], failed("its second test", error))
    selection = beside_products(_that_can_be_told(selection))
    undone = [one.term for one in selection.accepted if is_undone_by_levels(selection.final, one.term)]
    return selection.without(undone, UNDONE)


def _tested(search: Search, kind: type[Term], fitted: Fitted) -> Outcome | None:
    """A test's outcome; one that is known already, unless a part of a table, which need not be sure, may take more."""
    known: Outcome | None = search.tested.get((kind, fitted.terms))
    if known is None or known.unsure or (known.term is None and kind.passes(search, known.p_value, fitted)):
        known = search.tested[kind, fitted.terms] = kind.test(search, fitted)
    return known


def failed(what: str, error: Exception) -> str:
    """Why a finding is given up where the program is wrong; the log gets where."""
    getLogger(__name__).error("%s failed", what, exc_info=error)
    return f"{what} failed, which is a fault of this program ({type(error).__name__}: {error})"


def _that_can_be_told(selection: Selection) -> Selection:
    """Less what can't be sized or described: one faulty effect must not cost the others."""
    asks: tuple[Callable[[Fitted, Term], object], ...] = (
        Fitted.effects_of,  # of all first: what is said of one is said beside the others
        lambda final, term: term.describe(final, final.effects_of(term), ""),
    )
    for ask in asks:
        for accepted in selection.accepted:
            try:
                ask(selection.final, accepted.term)
            except UNFORESEEN as error:
                selection = selection.without([accepted.term], failed("its description", error))
    return selection


def beside_products(selection: Selection) -> Selection:
    """Less what a column does alone that is within its error of nothing beside its product (Nelder 1977): the product's
    space holds the column's own effect, so it is sized beside it, not searched for again.

    Beside it a product counts from the other column's median: what the column does alone is then what it does usually.
    """
    coarse = selection.final.coarse
    for term in [one.term for one in selection.accepted if isinstance(one.term, ColumnTerm)]:
        if isinstance(term.effect, Product):
            single = {one.term.columns for one in selection.accepted if one.term.kind == term.kind}
            centred = tuple(
                structs.replace(factor, at=float(np.nanmedian(coarse.context[factor.column][coarse.timeline.valid])))
                if factor.form is Form.VALUE and factor.at and (other.column,) in single
                else factor
                for factor, other in zip(term.effect.factors, reversed(term.effect.factors), strict=True)
            )
            if centred != term.effect.factors:
                effect = structs.replace(term.effect, factors=centred)
                selection = selection.exchanged(term, replace(term, effect=effect))
    parts = [one.term for one in selection.accepted if isinstance(one.term, ColumnTerm)]
    for term in parts:
        if not any(set(term.columns) < set(other.columns) for other in parts):
            continue
        alone = ends_of(proper(selection.final.effects_of(term), ColumnEffect))  # type: ignore[type-abstract]
        if alone is None or abs(alone.change) <= NORMAL_95 * alone.error:
            selection = selection.without([term], BY_PRODUCT)
    return selection


def is_undone_by_levels(fitted: Fitted, term: Term) -> bool:
    """Whether the drives' own levels of the movement's size undo more than half of what a term says of them, clearly.

    Terms are sized within drives [1]_. A profile has no levels of these very drives, so an effect that they undo, of a
    place that few drives cross, say, would be a factor of ten between drives that nobody measured.
    """
    coarse, part = fitted.coarse, fitted.scale_part(term)
    seconds = np.bincount(coarse.drive[coarse.valid], minlength=coarse.drives).astype(np.float64)
    counted = int(np.count_nonzero(seconds))
    if part.start == part.stop or counted < MIN_DRIVES:
        return False
    _, scales, known = design_of(coarse, fitted.terms)
    says = coarse.by_drive(scales[:, part] @ fitted.log_sizes[part])
    level = coarse.by_drive(np.log(fitted.scale) - scales @ fitted.log_sizes - known)
    says, level = (np.sqrt(seconds) * (one - np.average(one, weights=seconds)) for one in (says, level))
    (slope,), ((variance,),) = clustered_least_squares(says[:, None], level, np.arange(coarse.drives))
    error = float(np.sqrt(variance * small_sample_factor(counted, counted, 2)))
    return error > 0.0 and float(stdtr(counted - 2, (slope + 0.5) / error)) < UNDONE_LEVEL


def _tested_again(search: Search, selection: Selection, candidate: Accepted) -> Selection:
    """The same without a term that no longer stands beside what was found after it.

    Rotations keep how loud the movement is, not where: a column that goes along with loud stretches scores on the mean.
    And what no column explained may be explained by one that was found later.
    """
    if candidate not in selection.accepted:
        return selection
    later = [other.term for other in selection.accepted[selection.accepted.index(candidate) + 1 :]]
    later = [term for term in later if not set(candidate.term.columns) < set(term.columns)]
    if not any(candidate.term.may_be_explained_by(term, search.coarse) for term in later):
        return selection
    without = selection.without([candidate.term], "it does not stand beside what was found after it")
    search.progress(f"looking at {candidate.term.component.replace('_', ' ')} again")
    p_value = candidate.term.probability_beside(search, without.final)
    return selection if candidate.term.passes(search, p_value, without.final) else without
