"""What stays the same in all rounds of a trace: candidates, their answers, and which of them a look may use."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.loop.candidates import Candidate, product_candidates, single_candidates, with_responses
from xosc_lateral.loop.columns import Column
from xosc_lateral.loop.looks import Look, look_rows
from xosc_lateral.loop.movement import Coarse, Fitted
from xosc_lateral.loop.scan import ComplexArray, Scan, draw_shifts, scan, transform_answers

FloatArray = NDArray[np.float64]

RESEMBLING, SHADOW_SHARE = 0.5, 0.15
"""A quantity so correlated to an effect's is its shadow if it explains less than this share of what that does. [-]"""

MIN_SUPPORT_PACE = 200.0
"""The same for the restoring strength, of which every second tells little. [s]"""

MIN_SUPPORT = 60.0
"""A quantity that hangs on fewer seconds than this is not looked at: anything may have happened just then. [s]"""


@dataclass(frozen=True, eq=False)
class Search:
    """What stays the same in all rounds."""

    coarse: Coarse
    candidates: list[Candidate]
    answers: list[FloatArray]
    transforms: list[ComplexArray]
    support: FloatArray
    costs: FloatArray
    shifts: NDArray[np.intp]
    seed: np.random.SeedSequence
    columns: list[Column]
    progress: Callable[[str], None]

    def scan(self, look: Look, fitted: Fitted) -> Scan:
        """All candidates in one look."""
        return scan(look_rows(look, self.coarse, fitted), self.answers, self.transforms, self.costs, self.shifts)

    def rng(self, *key: int) -> np.random.Generator:
        """Independent stream by purpose."""
        return np.random.default_rng(np.random.SeedSequence(self.seed.entropy, spawn_key=key))


def prepare_search(
    coarse: Coarse, columns: list[Column], seed: np.random.SeedSequence, progress: Callable[[str], None]
) -> Search:
    """Candidates of the columns that hang on enough seconds, their answers and the shifts of the null."""
    seen = coarse.timeline.valid
    context = {name: values[seen] for name, values in coarse.context.items()}
    everything = with_responses(single_candidates(columns, context) + product_candidates(columns, context))
    kept, answers, supports = [], [], []
    for candidate in everything:
        answer = coarse.answer(candidate.effect)
        deviation = answer[coarse.valid].std(axis=0)
        if not np.all(deviation > 1e-9 * (1e-9 + np.abs(answer).max(axis=0))):
            continue
        support = support_of(answer[coarse.valid])
        if support >= MIN_SUPPORT:
            kept.append(candidate)
            supports.append(support)
            answers.append(answer / deviation)
    shifts = draw_shifts(len(coarse), np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=(0,))))
    costs = np.array([candidate.cost for candidate in kept])
    return Search(
        coarse, kept, answers, transform_answers(answers), np.asarray(supports), costs, shifts, seed, columns, progress
    )


def support_of(answer: FloatArray) -> float:
    """Seconds (rows) on which an answer's variance rests, for its scarcest component: (sum x^2)^2 / sum x^4."""
    squares = np.square(answer - answer.mean(axis=0))
    return float((squares.sum(axis=0) ** 2 / np.maximum(np.square(squares).sum(axis=0), 1e-300)).min())


def usable_candidates(search: Search, look: Look, fitted: Fitted) -> NDArray[np.bool_]:
    """Candidates that this look may take up: none that only repeats an effect it has already."""
    terms = fitted.terms
    if look is Look.LOCATION:
        present = terms.location
        repeats = {effect.columns for effect in present}
        return np.array([candidate.columns not in repeats or candidate.cost > 0 for candidate in search.candidates])
    barred: set[str] = set()
    for effect in (*terms.spread, *terms.pace, *terms.fine, *terms.slow):
        barred |= set(effect.columns)
    if look not in (Look.SPREAD, Look.SLOW):
        # how a driver gets to where an effect moves him is not wholly in the model: it looks like noise by that column
        for effect in terms.location:
            barred |= set(effect.columns)
    single = look in (Look.PACE, Look.FINE)
    entangled = terms.growth or terms.slow_growth or terms.regime_scale is not None or bool(terms.spread or terms.slow)
    # a second effect on the fine noise would be what the first one's shape leaves of itself
    if look is Look.FINE and (entangled or terms.fine):
        return np.zeros(len(search.candidates), dtype=np.bool_)
    least = MIN_SUPPORT_PACE if look is Look.PACE else 0.0
    return np.array(
        [
            not (barred & set(candidate.columns))
            and not (single and search.answers[index].shape[1] > 1)
            and search.support[index] >= least
            for index, candidate in enumerate(search.candidates)
        ]
    )


def shadows(search: Search, look: Look, fitted: Fitted, result: Scan) -> NDArray[np.bool_]:
    """Candidates that resemble an effect on the mean and explain little beside it: what its shape leaves of it."""
    shadows = np.zeros(len(search.candidates), dtype=np.bool_)
    if look is not Look.LOCATION:
        return shadows
    inside, at = search.coarse.valid, 0
    for effect in fitted.terms.location:
        own = search.coarse.answer(effect)
        rows = slice(at, at + own.shape[1])
        at = rows.stop
        sizes, covariance = fitted.location_sizes[rows], fitted.location_covariance[rows, rows]
        explained = float(sizes @ np.linalg.pinv(covariance) @ sizes)
        strength = (own @ sizes)[inside]
        strength = strength / max(float(np.linalg.norm(strength)), 1e-12)
        for index, answer in enumerate(search.answers):
            columns = answer[inside] - answer[inside].mean(axis=0)
            basis = np.linalg.qr(columns)[0]
            alike = float(np.linalg.norm(basis.T @ strength))
            shadows[index] |= alike > RESEMBLING and result.chi_square[index] < SHADOW_SHARE * explained
    return shadows


def at_lag(search: Search, index: int, result: Scan) -> FloatArray:
    """A candidate's answer at the lag that the scan liked best."""
    effect = search.candidates[index].effect
    return search.coarse.answer(replace(effect, lag_s=float(result.lag[index])))
