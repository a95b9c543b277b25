"""Which terms a table of drives calls for: columns that may act, forward selection, and the nested judgement of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from msgspec import structs

from xosc_lateral.drivers.loop.columns import Assigned, Column, Role, known_columns, roles_of
from xosc_lateral.drivers.loop.cross_validation import Nested, Progress, nest
from xosc_lateral.drivers.loop.dictionary import Quantities, Search
from xosc_lateral.drivers.loop.feedback import Feedback, find_feedback
from xosc_lateral.drivers.loop.model import Term, fit_model
from xosc_lateral.drivers.loop.selection import ERROR_BUDGET, Gain, Rejected, Selection, select
from xosc_lateral.drivers.loop.terms.between import BetweenTerm, is_between
from xosc_lateral.drivers.loop.terms.mean import MeanTerm
from xosc_lateral.drivers.loop.terms.spread import SpreadTerm
from xosc_lateral.drivers.loop.terms.time import AS_LIKELY, StepTerm, TimeMeanTerm, TimeSpreadTerm
from xosc_lateral.drivers.loop.timeline import Coarse, Timeline, unsized
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Drift, TimeSmooth, VarianceTrend
from xosc_lateral.drivers.model.profile import DriverProfile

# Why a term that loses on held-out rows is rejected.
VETOED = "significant, but chosen and estimated on other blocks it predicts the held-out ones worse than nothing"
# Why a column that goes one way is not tested.
CLOCK = "a clock: what changes with it changes with time, which is tested as such"


@dataclass(frozen=True, eq=False)
class Usable:
    """The columns of a table: that may act, that follow from the movement, that are not tested and why; all roles."""

    columns: list[Column]
    feedback: list[Feedback]
    unused: Mapping[str, str]
    roles: Mapping[str, Assigned]


@dataclass(frozen=True, eq=False)
class Identified:
    """What a table of drives calls for."""

    usable: Usable
    selection: Selection  # Terms that are kept, each with its held-out gain, and everything rejected.
    quantities: Quantities  # What was searched.
    nested: Nested | None = None  # Selections of all folds; None: nothing was found.
    total: Gain | None = None  # Of all kept terms together.
    returned_base: str = ""  # Why nothing is kept although something was found; empty otherwise.

    @property
    def taken_back(self) -> tuple[Rejected, ...]:
        """What was significant and is not kept."""
        return tuple(one for one in self.selection.rejected if one.was_found)

    def without(self, terms: Sequence[Term], why: str) -> Identified:
        """Some of what was found is taken back; the base is returned where nothing is left."""
        out = self.selection.without(terms, why)
        if not out.accepted:
            return replace(self, selection=out, nested=None, total=None, returned_base=why)
        kept = [one.term for one in out.accepted]
        nested = None if self.nested is None else self.nested.only(kept, terms)
        return replace(self, selection=out, nested=nested)


def identify(
    coarse: Coarse,
    seed: np.random.SeedSequence,
    *,
    initial: Sequence[Term] = (),
    excluded: Sequence[str] = (),
    roles: Mapping[str, str] = MappingProxyType({}),
    progress: Progress = lambda share, what: None,
) -> Identified:
    """Select terms beside the `initial` ones, and keep those that predict blocks on which they were neither selected
    nor sized."""
    from threadpoolctl import threadpool_limits

    usable = usable_columns(coarse.timeline, excluded, roles)
    # products of small matrices gain nothing from threads, and lose a factor of ten to them where all cores are busy
    with threadpool_limits(1, user_api="blas"):
        search = Search.over(coarse, usable.columns, seed, ERROR_BUDGET, lambda what: progress(0.1, what))
        selection = name_time_beside(search, select(search, initial))
        if not selection.accepted:
            return Identified(usable, selection, search.quantities)
        accepted = [one.term for one in selection.accepted]

        def finished(share: float) -> None:
            progress(0.3 + 0.3 * share, "selecting without a fold")

        nested = nest(search, initial, accepted, finished)
        return _worst_first(Identified(usable, selection, search.quantities, nested))


def name_time_beside(search: Search, selection: Selection) -> Selection:
    """Columns that changed as a change with time would, which explains about as much: either may be why."""
    for accepted_term in selection.accepted:
        if not isinstance(accepted_term.term, MeanTerm | SpreadTerm) or not search.coarse.lasts:
            continue
        without = selection.without([accepted_term.term], "").final
        test = (StepTerm if isinstance(accepted_term.term, MeanTerm) else TimeSpreadTerm).test(search, without)
        if test is None or test.term is None or not test.term.passes(search, test.p_value, without):
            continue
        by_time = fit_model(search.coarse, (*without.terms, test.term))
        if by_time.log_likelihood > selection.final.log_likelihood - AS_LIKELY:
            term = replace(accepted_term.term, alike=(*accepted_term.term.alike, ("time",)))
            accepted = tuple(
                replace(other, term=term) if other is accepted_term else other for other in selection.accepted
            )
            terms = [term if other is accepted_term.term else other for other in selection.final.terms]
            selection = replace(selection, accepted=accepted, final=fit_model(search.coarse, terms))
    return selection


def usable_columns(
    timeline: Timeline, excluded: Sequence[str] = (), roles: Mapping[str, str] = MappingProxyType({})
) -> Usable:
    """Columns that may act, those that follow from the movement, and those that are not tested with the reason."""
    columns, unused = known_columns(timeline)
    assigned = roles_of(timeline, {"lane_width", *timeline.context}, roles)
    unused |= dict.fromkeys(timeline.of_one_camera, "from the camera that measured the offset: it has the same errors")
    unused |= dict.fromkeys(excluded, "left out on request")
    clocks = (column.name for column in columns if assigned[column.name].role is Role.TIME)
    unused |= {name: CLOCK for name in clocks if name not in unused}
    columns = [replace(one, role=assigned[one.name].role) for one in columns if one.name not in unused]
    feedback = find_feedback(timeline, columns, assigned)
    follow = {one.column for one in feedback}
    return Usable([column for column in columns if column.name not in follow], feedback, unused, assigned)


def initial_terms(base: DriverProfile, timeline: Timeline) -> tuple[Term, ...]:
    """The base's own effects as far as the table has their columns, refitted, several lags in a row as one as late."""
    there = {"lane_width", *timeline.context}
    terms: list[Term] = []
    for effect in base.effects:
        if isinstance(effect, ColumnEffect) and set(effect.columns) <= there:
            known = structs.replace(unsized(effect), response_s=effect.response_time, response_order=1)
            if effect.acts is Acts.LOCATION:
                between = is_between(effect) or _same_throughout(effect, timeline)
                terms.append(BetweenTerm.of(known) if between else MeanTerm.of(known))
            elif effect.acts is Acts.SPREAD:
                terms.append(SpreadTerm.of(known))
        elif isinstance(effect, VarianceTrend):
            terms.append(TimeSpreadTerm(order=1))
        elif isinstance(effect, Drift):
            terms.append(TimeMeanTerm())
        elif isinstance(effect, TimeSmooth):
            terms += [TimeMeanTerm(len(effect.location))] if effect.location else []
            terms += [TimeSpreadTerm(len(effect.spread))] if effect.spread else []
    return tuple(terms)


def _same_throughout(effect: ColumnEffect, timeline: Timeline) -> bool:
    """Whether an effect's quantity is the same all through every drive, as a vehicle's class is."""
    context = {"lane_width": timeline.lane_width, **timeline.context}
    values = effect.known({name: context[name] for name in effect.columns})
    inside = [values[rows][timeline.valid[rows]] for rows in timeline.spans]
    return all(np.ptp(own, axis=0).max() == 0.0 for own in inside if len(own))


def _worst_first(identified: Identified) -> Identified:
    """Less what loses on blocks that it was not chosen on, the worst first; or nothing, if all together loses."""
    while identified.nested is not None:
        terms = [one.term for one in identified.selection.accepted]
        # each beside those that are kept, and nothing else: a fold's misfit would be blamed on what is right
        nested = identified.nested.only(terms)
        gains = [nested.of(term) if term.predictable else None for term in terms]
        identified = replace(identified, nested=nested)
        fallen = [(gain.mean, term) for term, gain in zip(terms, gains, strict=True) if gain and not gain.stands]
        if fallen:
            identified = identified.without([min(fallen, key=lambda pair: pair[0])[1]], VETOED)
            continue
        accepted = tuple(
            replace(one, gain=gain) for one, gain in zip(identified.selection.accepted, gains, strict=True)
        )
        identified = replace(identified, selection=replace(identified.selection, accepted=accepted))
        if any(gains):
            total = nested.together([term for term, gain in zip(terms, gains, strict=True) if gain])
            identified = replace(identified, total=total)
            if not total.stands:
                low, high = total.interval
                why = f"the effects found gain {total.mean:.2f} nat a held-out block ({low:.2f} to {high:.2f})"
                identified = identified.without(terms, why)
        break
    return identified
