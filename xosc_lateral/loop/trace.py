"""Trace what is left to the effect that explains it: choose, refine, prove against chance; until nothing is left."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.loop.chance import tail_probability
from xosc_lateral.loop.columns import known_columns
from xosc_lateral.loop.consequences import find_consequences
from xosc_lateral.loop.hidden import (
    find_clustering,
    find_growth,
    find_slow_growth,
)
from xosc_lateral.loop.looks import Look, look_rows
from xosc_lateral.loop.movement import Coarse, Fitted, Terms, fit_movement
from xosc_lateral.loop.proofs import Proposal, column_proposals, hidden_proposals
from xosc_lateral.loop.scan import scan, transform_answers
from xosc_lateral.loop.search import Search, prepare_search, usable_candidates
from xosc_lateral.loop.traced import LEVEL, Found, Trace, Tried, without_finding

FloatArray = NDArray[np.float64]

MAX_FINDINGS = 8
"""More effects than this in one table are not looked for."""

CLEARLY = 3.0
"""By so much a column must be likelier than time alone: many columns change slowly enough to look like time. [-]"""


_ON_THE_MEAN = (Look.LOCATION.value, "between", "periodic", "wander")

_TURN = {"between": 0, "regime": 2}
"""Nothing else explains the places that different drives keep; and regimes explain whatever comes in clusters: they are
asked last, when nothing that can be named does."""


def trace_effects(
    coarse: Coarse,
    seed: np.random.SeedSequence,
    *,
    initial: Terms | None = None,
    excluded: Iterable[str] = (),
    progress: Callable[[str], None] = lambda _: None,
) -> Trace:
    """Look, prove, add, look again.

    Parameters
    ----------
    coarse : Coarse
    seed : SeedSequence
        Of the shifts and simulated nulls.
    initial : Terms, optional
        What is in the model already.
    excluded : iterable of str
        Columns not to look at.
    progress : callable
        Told what is being done, in a few words.
    """
    columns, unused = known_columns(coarse.timeline)
    unused |= dict.fromkeys(excluded, "left out on request")
    progress("consequences of the car's own movement")
    consequences = find_consequences(coarse.timeline, columns)
    barred = {consequence.column for consequence in consequences} | set(excluded)
    columns = [column for column in columns if column.name not in barred]
    search = prepare_search(coarse, columns, seed, progress)
    terms = initial or Terms()
    start = fitted = fit_movement(coarse, terms)
    found: list[Found] = []
    tried: list[Tried] = []
    while len(found) < MAX_FINDINGS:
        outcome, tried = _one_round(search, fitted, len(found))
        if outcome is None:
            break
        found.append(outcome)
        fitted = outcome.after
    return _without_explained(search, Trace(coarse, found, tried, consequences, unused, columns, start, fitted))


def _one_round(search: Search, fitted: Fitted, number: int) -> tuple[Found | None, list[Tried]]:
    """The most urgent proposal that passes, and what did not."""
    proposals = [*column_proposals(search, fitted), *hidden_proposals(search, fitted, number)]
    tried: list[Tried] = []
    for proposal in sorted(proposals, key=lambda proposal: (_TURN.get(proposal.look, 1), proposal.urgency)):
        search.progress(f"round {number + 1}: proving {proposal.look}")
        outcome = proposal.prove()
        if isinstance(outcome, Found):
            return _better_explained(outcome, proposals), tried
        tried.append(outcome)
    return None, tried


def _better_explained(found: Found, proposals: Sequence[Proposal]) -> Found:
    """A spread that grows with time, or by a column that changes as slowly: the likelier of the two."""
    if found.look != "growth" or found.after.terms.slow_growth:
        return found
    by_column = [proposal.prove() for proposal in proposals if proposal.look == Look.SPREAD.value]
    likelier = [
        other
        for other in by_column
        if isinstance(other, Found)
        and other.candidate is not None
        and other.after.log_likelihood - 0.5 * other.candidate.cost - CLEARLY > found.after.log_likelihood
    ]
    return likelier[0] if likelier else found


def _without_explained(search: Search, trace: Trace) -> Trace:
    """Drop findings that later ones explain: where the mean moves by a column not known yet, spread does too."""
    for found in trace.found[:-1]:
        if found.look in _ON_THE_MEAN:
            continue
        without_it = fit_movement(trace.coarse, without_finding(trace.final.terms, found))
        search.progress(f"looking at {found.look} again")
        p_value = _probability_beside(search, found, without_it, trace.final)
        if p_value > LEVEL[found.look]:
            why = f"the other findings explain it: beside them chance gives as much in {100 * p_value:.2g} % of tables"
            columns = found.candidate.columns if found.candidate else ()
            tried = [*trace.tried, Tried(found.look, columns, p_value, why)]
            kept = [other for other in trace.found if other is not found]
            trace = replace(trace, found=kept, tried=tried, final=without_it)
    return trace


def _probability_beside(search: Search, found: Found, without_it: Fitted, final: Fitted) -> float:
    """Probability of a finding on the movement's size beside all others."""
    coarse = search.coarse
    if found.look == "growth":
        return min(find_growth(coarse, without_it).p_value, find_slow_growth(coarse, without_it).p_value)
    if found.look == "regime":
        return find_clustering(coarse, without_it, search.rng(3)).p_value
    assert found.candidate is not None, "all other looks are of columns"
    look, answer = Look(found.look), coarse.answer(found.candidate.effect)
    usable = usable_candidates(search, look, without_it)
    if not usable.any():  # nothing to compare it with
        return 0.0
    answer = answer / answer[coarse.valid].std(axis=0)
    costs, at_once = np.array([found.candidate.cost]), np.zeros(1, dtype=np.intp)
    rows = look_rows(look, coarse, without_it)
    statistic = scan(rows, [answer], transform_answers([answer]), costs, search.shifts, at_once).statistic[0]
    return tail_probability(float(statistic), search.scan(look, final).null[usable].max(axis=0))
