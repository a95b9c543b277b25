"""Which terms a table of drives calls for: columns that may act, forward selection, and the nested judgement of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from msgspec import structs
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, ColumnEffect, Drift, VarianceTrend
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.identification.blocks import hold_out_blocks
from xosc_lateral.identification.columns import Column, known_columns
from xosc_lateral.identification.feedback import Feedback, find_feedback
from xosc_lateral.identification.nested import Gain, Nested, nest
from xosc_lateral.identification.regression import Coarse
from xosc_lateral.identification.search import Search
from xosc_lateral.identification.selection import Selection, select
from xosc_lateral.identification.stages import ERROR_BUDGET
from xosc_lateral.identification.terms.base import Term
from xosc_lateral.identification.terms.between import BetweenTerm, is_between
from xosc_lateral.identification.terms.drift import DriftTerm
from xosc_lateral.identification.terms.mean import MeanTerm
from xosc_lateral.identification.terms.spread import SpreadTerm
from xosc_lateral.identification.terms.step import StepTerm
from xosc_lateral.identification.terms.variance_trend import VarianceTrendTerm
from xosc_lateral.identification.timeline import Timeline

VETOED = "significant, but chosen and estimated on other blocks it predicts the held-out ones worse than nothing"
"""Why a term that loses on held-out rows is rejected."""

UNSURE = "significant by itself, but within its error of nothing beside what else was found"
"""Why a term whose size is shrunk to nothing is rejected."""

Progress = Callable[[float, str], None]
"""Told the share that is done and what is being done."""


@dataclass(frozen=True, eq=False)
class Identified:
    """What a table of drives calls for.

    Parameters
    ----------
    selection : Selection
        Terms that are kept, and everything rejected.
    nested : Nested or None
        Selections of all folds; None: nothing was found.
    gains : mapping of int to Gain
        By identity of the term.
    total : Gain or None
        Of all kept terms together.
    returned_base : str
        Why nothing is kept although something was found; empty otherwise.
    columns : list of Column
        That may act.
    feedback : list of Feedback
        Columns that follow from the movement.
    unused : mapping of str to str
        Columns that tell nothing, and why.
    """

    selection: Selection
    nested: Nested | None
    gains: Mapping[int, Gain]
    total: Gain | None
    returned_base: str
    columns: list[Column]
    feedback: list[Feedback]
    unused: Mapping[str, str]

    def least(self, component: str) -> float | None:
        """Smallest p-value that a component was given; None: it was not looked at."""
        seen = [one.p_value for one in self.selection.accepted if one.term.component == component]
        seen += [one.p_value for one in self.selection.rejected if one.component == component]
        return min(seen) if seen else None

    def emptied(self, why: str) -> Identified:
        """Everything that was found is taken back."""
        out = self.selection.without([one.term for one in self.selection.accepted], why)
        return replace(self, selection=out, gains={}, returned_base=why)


def identify(
    coarse: Coarse,
    seed: np.random.SeedSequence,
    *,
    initial: Sequence[Term] = (),
    excluded: Sequence[str] = (),
    progress: Progress = lambda share, what: None,
) -> Identified:
    """Select terms, and keep those that foretell blocks on which they were neither selected nor sized.

    Parameters
    ----------
    coarse : Coarse
    seed : SeedSequence
        Of the rotations and other nulls.
    initial : sequence of Term
        In the model already.
    excluded : sequence of str
        Columns that are not to be looked at.
    progress : callable
    """
    from threadpoolctl import threadpool_limits

    columns, feedback, unused = usable_columns(coarse.timeline, excluded)
    # products of small matrices gain nothing from threads, and lose a factor of ten to them where all cores are busy
    with threadpool_limits(1, user_api="blas"):
        search = Search.over(coarse, columns, seed, ERROR_BUDGET, lambda what: progress(0.1, what))
        selection = _of_some_size(select(search, initial))
        blocks = hold_out_blocks(coarse.timeline)
        kept, nested, gains, total, reason = _judged(search, selection, blocks, initial, progress)
    return Identified(kept, nested, gains, total, reason, columns, feedback, unused)


def usable_columns(
    timeline: Timeline, excluded: Sequence[str] = ()
) -> tuple[list[Column], list[Feedback], dict[str, str]]:
    """Columns that may act, those that follow from the movement, and those that tell nothing with the reason."""
    columns, unused = known_columns(timeline)
    unused |= dict.fromkeys(timeline.of_one_camera, "from the camera that measured the offset: it has the same errors")
    unused |= dict.fromkeys(excluded, "left out on request")
    columns = [column for column in columns if column.name not in unused]
    feedback = find_feedback(timeline, columns)
    follow = {one.column for one in feedback}
    return [column for column in columns if column.name not in follow], feedback, unused


def initial_terms(base: DriverProfile, timeline: Timeline) -> tuple[Term, ...]:
    """The base's own effects as far as the table has their columns: they are refitted, not found anew.

    The loop knows responses by one first-order lag, so that several in a row become one that is as late.
    """
    there = {"lane_width", *timeline.context}
    terms: list[Term] = []
    for effect in base.effects:
        if isinstance(effect, ColumnEffect) and set(effect.columns) <= there:
            bare = structs.replace(
                effect,
                coefficients=(),
                errors=(),
                reference=(),
                between_drivers=(),
                response_range=(),
                response_s=effect.response_time,
                response_order=1,
            )
            if effect.acts is Acts.LOCATION:
                between = is_between(effect) or _same_throughout(effect, timeline)
                terms.append(BetweenTerm.of(bare) if between else MeanTerm.of(bare))
            elif effect.acts is Acts.SPREAD:
                terms.append(SpreadTerm.of(bare))
        elif isinstance(effect, VarianceTrend):
            terms.append(VarianceTrendTerm())
        elif isinstance(effect, Drift):
            terms.append(DriftTerm())
    return tuple(terms)


def _same_throughout(effect: ColumnEffect, timeline: Timeline) -> bool:
    """Whether an effect's quantity is the same all through every drive, as a vehicle's class is."""
    context = {"lane_width": timeline.lane_width, **timeline.context}
    values = effect.known({name: context[name] for name in effect.columns})
    inside = [values[rows][timeline.valid[rows]] for rows in timeline.spans]
    return all(np.ptp(own, axis=0).max() == 0.0 for own in inside if len(own))


def _of_some_size(selection: Selection) -> Selection:
    """Less what is within one standard error of nothing beside what was found with it, and would be shrunk to nothing.

    Of terms that held-out rows can't judge: the others are told from nothing there.
    """
    for one in [one for one in selection.accepted if not one.term.predictable]:
        effects = [effect for effect in one.term.estimate(selection.final) if isinstance(effect, ColumnEffect)]
        if effects and not any(any(effect.coefficients) for effect in effects):
            selection = selection.without([one.term], UNSURE)
    return selection


def _judged(
    search: Search, selection: Selection, blocks: NDArray[np.intp], initial: Sequence[Term], progress: Progress
) -> tuple[Selection, Nested | None, dict[int, Gain], Gain | None, str]:
    """What loses on blocks that it was not chosen on goes, and all of it if all together loses."""
    if not selection.accepted:
        return selection, None, {}, None, ""
    # what happened once, and when, can't be found without the block in which it happened: folds size it, and know of it
    once = tuple(one.term for one in selection.accepted if one.term.component == StepTerm.component)
    there = Counter(getattr(term, "component", "") for term in selection.final.terms)
    looked_for = {one.term.component for one in selection.accepted} - {StepTerm.component}
    nested = nest(
        search,
        blocks,
        (*initial, *once),
        {component: there[component] for component in sorted(looked_for)},
        lambda share: progress(0.3 + 0.3 * share, "selecting without a fold"),
    )
    selection, nested, gains = _worst_first(selection, nested)
    reason, total = "", nested.together([one.term for one in selection.accepted if one.term.predictable])
    if any(one.term.predictable for one in selection.accepted) and not total.stands:
        low, high = total.interval
        reason = f"the effects found gain {total.mean:.2f} nat a held-out block ({low:.2f} to {high:.2f})"
        selection = selection.without([one.term for one in selection.accepted], reason)
    return selection, nested, gains, total, reason


def _worst_first(selection: Selection, nested: Nested) -> tuple[Selection, Nested, dict[int, Gain]]:
    """Less what loses, one by one, beginning with what loses most."""
    while True:
        # each beside those that are kept, and nothing else: a fold's misfit would be blamed on what is right
        nested = nested.only([one.term for one in selection.accepted])
        gains = {id(one.term): nested.of(one.term) for one in selection.accepted if one.term.predictable}
        judged = [one.term for one in selection.accepted if id(one.term) in gains]
        fallen = [term for term in judged if not gains[id(term)].stands]
        if not fallen:
            return selection, nested, gains
        selection = selection.without([min(fallen, key=lambda term: gains[id(term)].mean)], VETOED)
