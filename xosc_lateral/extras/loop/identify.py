"""Which terms a table of drives calls for: columns that may act, forward selection, and the nested judgement of it.

What is accepted is judged on held-out blocks, on which it was neither selected nor sized [1]_.

References
----------
.. [1] S. Varma, R. Simon, "Bias in error estimation when using cross-validation for model selection", BMC
       Bioinformatics 7, 2006: selection belongs into the folds.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from msgspec import structs

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.process import cores
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect, Drift, TimeSmooth, VarianceTrend
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.loop.autocorrelation import Whitener
from xosc_lateral.extras.loop.columns import Assigned, Column, Feedback, Role, find_feedback, known_columns, roles_of
from xosc_lateral.extras.loop.dictionary import Quantities, Search
from xosc_lateral.extras.loop.model import CLIP, Fitted, Term, design_of, fit_model, own_levels
from xosc_lateral.extras.loop.selection import ERROR_BUDGET, Gain, Rejected, Selection, select
from xosc_lateral.extras.loop.terms.between import BetweenTerm, is_between
from xosc_lateral.extras.loop.terms.mean import MeanTerm
from xosc_lateral.extras.loop.terms.spread import SpreadTerm
from xosc_lateral.extras.loop.terms.time import AS_LIKELY, StepTerm, TimeMeanTerm, TimeSpreadTerm
from xosc_lateral.extras.loop.timeline import Coarse, Timeline, coarse_middle, unsized

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
    search: Search  # Where it was searched for.
    nested: Nested | None = None  # Selections of all folds; None: nothing was found.
    total: Gain | None = None  # Of all kept terms together.
    returned_base: str = ""  # Why nothing is kept although something was found; empty otherwise.

    @property
    def quantities(self) -> Quantities:
        """What was searched."""
        return self.search.quantities

    @property
    def taken_back(self) -> tuple[Rejected, ...]:
        """What was significant and is not kept."""
        return tuple(one for one in self.selection.rejected if one.was_found)

    def without(self, terms: Sequence[Term], why: str) -> Identified:
        """Some of what was found is taken back; the base is returned where nothing is left."""
        out = self.selection.without(terms, why)
        if not out.accepted:
            return replace(self, selection=out, nested=None, total=None, returned_base=why)
        nested = None if self.nested is None else self.nested.only([one.term for one in out.accepted], terms)
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
    """Select terms beside the `initial` ones; keep what predicts blocks that it was not selected and sized on."""
    usable, search = search_of(coarse, seed, excluded, roles, lambda what: progress(0.1, what))
    selection = name_time_beside(search, select(search, initial))
    if not selection.accepted:
        return Identified(usable, selection, replace(search, progress=str))  # a value: nobody is told any more
    accepted = [one.term for one in selection.accepted]
    nested = nest(search, initial, accepted, lambda share: progress(0.3 + 0.3 * share, "selecting without a fold"))
    return _worst_first(Identified(usable, selection, replace(search, progress=str), nested))


def search_of(
    coarse: Coarse,
    seed: np.random.SeedSequence,
    excluded: Sequence[str],
    roles: Mapping[str, str],
    progress: Callable[[str], None] = lambda _: None,
) -> tuple[Usable, Search]:
    """Columns of drives, and where effects of those that may act are searched for."""
    usable = usable_columns(coarse.timeline, excluded, roles)
    return usable, Search.over(coarse, usable.columns, seed, ERROR_BUDGET, progress)


def name_time_beside(search: Search, selection: Selection) -> Selection:
    """Columns that changed as a change with time would, which explains about as much: either may be why."""
    for finding in selection.accepted:
        before = finding.term
        if not isinstance(before, MeanTerm | SpreadTerm):
            continue
        without = selection.without([before], "").final
        test = (StepTerm if isinstance(before, MeanTerm) else TimeSpreadTerm).test(search, without)
        if test is None or test.term is None or not test.term.passes(search, test.p_value, without):
            continue
        by_time = fit_model(search.coarse, (*without.terms, test.term))
        if by_time.log_likelihood > selection.final.log_likelihood - AS_LIKELY:
            selection = selection.exchanged(before, replace(before, alike=(*before.alike, ("time",))))
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
    context = {"lane_width": timeline.lane_width, **timeline.context}
    terms: list[Term] = []
    for effect in base.effects:
        if isinstance(effect, ColumnEffect) and context.keys() >= set(effect.columns):
            known = structs.replace(unsized(effect), response_s=effect.response_time, response_order=1)
            if effect.acts is Acts.LOCATION:
                values = effect.known({name: context[name] for name in effect.columns})
                inside = [values[rows][timeline.valid[rows]] for rows in timeline.spans]
                # the same all through every drive, as a vehicle's class is
                steady = all(np.ptp(own, axis=0).max() == 0.0 for own in inside if len(own))
                terms.append((BetweenTerm if is_between(effect) or steady else MeanTerm).of(known))
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


def _worst_first(identified: Identified) -> Identified:
    """Less what loses on blocks that it was not chosen on, the worst first; or nothing, if all together loses."""
    while identified.nested is not None:
        terms = [one.term for one in identified.selection.accepted]
        # each beside those that are kept, and nothing else: a fold's misfit would be blamed on what is right
        nested = identified.nested.only(terms)
        gains = [nested.of(term) if term.predictable(identified.selection.final) else None for term in terms]
        identified = replace(identified, nested=nested)
        fallen = [(gain.mean, term) for term, gain in zip(terms, gains, strict=True) if gain and not gain.stands]
        if fallen:
            identified = identified.without([min(fallen, key=lambda pair: pair[0])[1]], VETOED)
            continue
        judged = zip(identified.selection.accepted, gains, strict=True)
        accepted = tuple(replace(one, gain=gain) for one, gain in judged)
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


# ---- what is held out ----
Progress = Callable[[float, str], None]  # Gets the share that is done and what is being done.
FOLDS = 4  # Every part of the drives is held out once, and predicted from the other three.
# Length of the blocks of a drive that are held out; drives shorter than three blocks are held out whole. [s]
BLOCK_S = 150.0


def hold_out_blocks(timeline: Timeline) -> IntArray:
    """Number of the block that every row is in, shape (n,) [-]; block b belongs to fold b modulo `FOLDS`."""
    blocks = np.zeros(len(timeline), dtype=np.intp)
    length = round(BLOCK_S / timeline.step)
    next_block = 0
    for span in timeline.spans:
        n = span.stop - span.start
        parts = max(1, n // length) if n >= 3 * length else 1
        blocks[span] = next_block + np.minimum(np.arange(n) * parts // n, parts - 1)
        next_block += parts
    return blocks


def folds_of(blocks: IntArray) -> int:
    """Number of folds, at most `FOLDS`: fewer when there are fewer blocks. `blocks` of shape (n,). [-]"""
    return min(FOLDS, int(blocks.max()) + 1)


def held_out_words(timeline: Timeline) -> str:
    """What is held out, for the record."""
    blocks = hold_out_blocks(timeline)
    number, folds = int(blocks.max()) + 1, folds_of(blocks)
    if folds == 1:
        return "nothing: the table is too short to hold a block out"
    what = "drives" if number < 1.5 * len(timeline.names) else f"blocks of about {BLOCK_S:g} s"
    return (
        f"{number} {what} in {folds} folds: the rows of a fold are scored by profiles whose base model, effects and "
        "sizes were chosen and fitted on the other folds"
    )


def held_out_gain(fitted: Fitted, rest: Fitted, coarse: Coarse, held: BoolArray) -> FloatArray:
    """Gain in log-likelihood of `fitted` over `rest`, which has fewer terms, shape (n,); 0 where not held. [nat]

    Both get the autoregression of `fitted`: what is judged is where the car should be and how large its movement is. An
    autoregression fitted beside a term differs by what the term takes out of the movement, and is judged by *every*
    held-out row, also where the term does nothing: on the motorway recording it cost 0.3 to 0.5 nat a vehicle, as much
    as the neighbour on the right gains. The held-out rows' own levels of place and spread are taken from themselves.
    """
    return _log_likelihood(fitted, fitted, coarse, held) - _log_likelihood(rest, fitted, coarse, held)


def _log_likelihood(fitted: Fitted, noise: Fitted, coarse: Coarse, held: BoolArray) -> FloatArray:
    """Of every valid row in `held`, shape (n,), with the autoregression of `noise`; 0 elsewhere."""
    rows = coarse.valid & held
    columns, scales, known = design_of(fitted.coarse, fitted.terms)
    whitener = Whitener(noise.whitener.process, rows, coarse.drive, np.exp(scales @ fitted.log_sizes + known))
    squares = np.square(whitener.rows(np.where(rows, coarse.offset - columns @ fitted.sizes, 0.0)))
    typical = max(float(squares[rows].mean()), 1e-300) if rows.any() else 1.0
    level = own_levels(np.minimum(squares, CLIP * typical), rows, coarse.drive) * typical
    variance = level[coarse.drive]
    factor = whitener.by_position(noise.starts)
    deviation = np.sqrt(variance) * factor * whitener.deviations
    return np.where(rows, -0.5 * np.minimum(squares / (variance * factor**2), CLIP) - np.log(deviation), 0.0)


@dataclass(frozen=True, eq=False)
class Nested:
    """Selections of all folds, one each, and what they gain.

    What is scored knows nothing of the rows that are held out: neither how many effects there are, nor of which kind.
    What judges a single effect has as many of its kind as the table: a level that all folds have to reach would bias
    its gain. What a fold lacks of an effect, the others have more of: it is significant in just those whose own
    held-out rows show least of it.
    """

    scored: tuple[Selection, ...]  # By the table's levels.
    selections: tuple[Selection, ...]  # At least as many terms of every component as the table has, the best ones.
    coarse: Coarse
    blocks: IntArray  # shape (n,): On the 1 Hz grid.

    def only(self, terms: Sequence[Term], gone: Sequence[Term] = ()) -> Nested:
        """What judges without what a fold chose that is none of these terms; what is scored without those `gone`."""
        judging = (_without(one, lambda term: not _any_matches(term, terms)) for one in self.selections)
        scored = (_without(one, lambda term: _any_matches(term, gone)) for one in self.scored)
        return replace(self, selections=tuple(judging), scored=tuple(scored))

    def of(self, term: Term) -> Gain:
        """What one accepted term gains: each fold's own version of it, in or out; nothing where it was not chosen."""
        pairs: list[tuple[Fitted, Fitted] | None] = []
        for final in (selection.final for selection in self.selections):
            version = next((one for one in final.terms if one.matches(term)), None)
            rest = [one for one in final.terms if one is not version]
            pairs.append(None if version is None else (final, fit_model(final.coarse, rest)))
        return self._gain(pairs, sum(pair is not None for pair in pairs))

    def together(self, terms: Sequence[Term]) -> Gain:
        """What several accepted terms gain over the start: in each fold those of them that were chosen there."""
        pairs: list[tuple[Fitted, Fitted] | None] = []
        for selection in self.selections:
            start = selection.start
            chosen = [one.term for one in selection.accepted if _any_matches(one.term, terms)]
            pairs.append((fit_model(start.coarse, (*start.terms, *chosen)), start) if chosen else None)
        return self._gain(pairs, len(pairs))

    def _gain(self, pairs: Sequence[tuple[Fitted, Fitted] | None], folds: int) -> Gain:
        """Over the blocks, of each fold's fits with and without."""
        rows = np.zeros(len(self.blocks))
        for fold, pair in enumerate(pairs):
            if pair is not None:
                rows += held_out_gain(*pair, self.coarse, self.blocks % len(pairs) == fold)
        return gain_over(rows, self.blocks, self.coarse.valid, folds)


def gain_over(rows: FloatArray, blocks: IntArray, valid: BoolArray, folds: int) -> Gain:
    """Mean over blocks of what their rows gain, shape (n,), with its standard error. [nat]"""
    sums = np.bincount(blocks, rows)[np.unique(blocks[valid])]
    error = float(np.std(sums, ddof=1) / np.sqrt(len(sums))) if len(sums) > 1 else 0.0
    return Gain(float(sums.mean()), error, folds)


def nest(
    search: Search,
    initial: Sequence[Term],
    accepted: Sequence[Term],
    progress: Callable[[float], None] = lambda _: None,
) -> Nested:
    """Select anew without each fold: by the table's levels, and then at least as many terms as were `found` there."""
    coarse, blocks = search.coarse, hold_out_blocks(search.coarse.timeline)
    seconds, folds = coarse_middle(blocks)[: len(coarse)], folds_of(blocks)
    # what happened once can't be found without the block in which it happened: what judges the others knows when
    once = tuple(term for term in accepted if term.component == StepTerm.component)
    wanted = Counter(term.component for term in accepted if term not in once)

    def selected(fold: int) -> tuple[Selection, Selection]:
        part = coarse.only(seconds % folds != fold) if folds > 1 else coarse
        part_of_search = replace(search, coarse=part, progress=lambda _: None, tested={})
        scored = judged = select(part_of_search, initial)
        part_of_search.forget()
        there = Counter(one.term.component for one in scored.accepted)
        if once or any(there[component] < number for component, number in wanted.items()):
            more = replace(part_of_search, wanted=wanted)
            judged = select(more, (*initial, *once))
            more.forget()
        return scored, judged

    pairs = []
    search.forget()
    # threads: the work is in compiled code that lets others run, and all folds read the same candidates
    with ThreadPoolExecutor(min(folds, cores())) as pool:
        for pair in pool.map(selected, range(folds)):
            pairs.append(pair)
            progress(len(pairs) / folds)
    return Nested(tuple(pair[0] for pair in pairs), tuple(pair[1] for pair in pairs), coarse, seconds)


def _without(selection: Selection, leave_out: Callable[[Term], bool]) -> Selection:
    return selection.without([one.term for one in selection.accepted if leave_out(one.term)], "")


def _any_matches(term: Term, others: Sequence[Term]) -> bool:
    return any(term.kind == other.kind and term.matches(other) for other in others)
