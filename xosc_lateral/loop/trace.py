"""Trace what is left to the effect that explains it: choose, refine, prove against chance; until nothing is left."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import Acts, ColumnEffect
from xosc_lateral.loop.candidates import Candidate, product_candidates, single_candidates, with_responses
from xosc_lateral.loop.chance import tail_probability
from xosc_lateral.loop.columns import Column, known_columns
from xosc_lateral.loop.consequences import Consequence, find_consequences
from xosc_lateral.loop.hidden import (
    Clustering,
    Growth,
    Peak,
    find_clustering,
    find_growth,
    find_peak,
    find_slow_growth,
)
from xosc_lateral.loop.looks import Look, fine_rows, look_rows, slow_rows
from xosc_lateral.loop.movement import Coarse, Fitted, Terms, fit_movement
from xosc_lateral.loop.refine import refine, target_of
from xosc_lateral.loop.regimes import fit_regimes, regime_log_scale
from xosc_lateral.loop.scan import ComplexArray, Scan, draw_shifts, scan, transform_answers
from xosc_lateral.loop.sizing import log_sizes
from xosc_lateral.loop.wander import Wander, find_wander

FloatArray = NDArray[np.float64]

LEVEL = {
    "location": 0.010,
    "scale": 0.005,
    "dynamics": 0.0003,
    "fine": 0.002,
    "slow": 0.002,
    "growth": 0.001,
    "regime": 0.001,
    "periodic": 0.002,
    "wander": 0.003,
}
"""Probability of a false finding that each look may spend: 2.6 % together, hidden effects included. 5 % are allowed; no
model of a driver is quite right, so drives without an effect show somewhat more than this adds up to."""

MAX_FINDINGS = 8
"""More effects than this in one table are not looked for."""

RESEMBLING, SHADOW_SHARE = 0.5, 0.15
"""A quantity so correlated to an effect's is its shadow if it explains less than this share of what that does. [-]"""

MIN_REGIME_S = 10.0
"""Shorter regimes are none. [s]"""

LEAST_FACTOR = {Look.SPREAD: 1.1, Look.SLOW: 1.1, Look.FINE: 1.25}
"""A change of the spread, or of the fine noise (a centimetre), by less is no finding, however sure. [-]"""

MIN_SUPPORT_PACE = 200.0
"""The same for the restoring strength, of which every second tells little. [s]"""

MIN_SUPPORT = 60.0
"""A quantity that hangs on fewer seconds than this is not looked at: anything may have happened just then. [s]"""

CLEARLY = 3.0
"""By so much a column must be likelier than time alone: many columns change slowly enough to look like time. [-]"""

RECHECKED = 40
"""So many of the scan's best are scored exactly."""

WORTH_PROVING = 0.3
"""A look whose best candidate is less likely than this by a crude count is proven against its null."""


@dataclass(frozen=True, eq=False)
class Found:
    """An effect that chance does not explain.

    Parameters
    ----------
    look : str
        Key of `LEVEL`.
    p_value : float
        Family-wise over everything that the look tried.
    candidate : Candidate, optional
        For an effect of columns.
    rivals : tuple of str
        Columns that the data can't tell from it.
    detail : object
        What a hidden look found.
    before, after : Fitted
        Without and with it, when it was found.
    """

    look: str
    p_value: float
    before: Fitted
    after: Fitted
    candidate: Candidate | None = None
    rivals: tuple[str, ...] = ()
    detail: Growth | Clustering | Peak | Wander | None = None


@dataclass(frozen=True, slots=True)
class Tried:
    """A candidate that did not pass.

    Parameters
    ----------
    look : str
    columns : tuple of str
    p_value : float
    why : str
    """

    look: str
    columns: tuple[str, ...]
    p_value: float
    why: str


@dataclass(frozen=True, eq=False)
class Trace:
    """Everything found, and what was not.

    Parameters
    ----------
    found : list of Found
        In the order of finding.
    tried : list of Tried
        Of the last round.
    consequences : list of Consequence
    unused : mapping of str to str
        Columns that were not looked at, and why.
    start, final : Fitted
        Before and after all.
    """

    coarse: Coarse
    found: list[Found]
    tried: list[Tried]
    consequences: list[Consequence]
    unused: dict[str, str]
    columns: list[Column]
    start: Fitted
    final: Fitted


@dataclass(frozen=True, eq=False)
class _Search:
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


@dataclass(frozen=True, eq=False)
class _Proposal:
    """The best of one look, before it is proven."""

    look: str
    crude: float
    prove: Callable[[], Found | Tried] = field(repr=False)

    @property
    def urgency(self) -> float:
        """Crude probability over what the look may spend."""
        return self.crude / LEVEL[self.look]


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
    search = _search(coarse, columns, seed, progress)
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


def without(trace: Trace, useless: Sequence[Found]) -> Trace:
    """The trace without some of its findings, refitted; they are listed among what was tried."""
    terms = trace.final.terms
    for found in useless:
        terms = _removed(terms, found)
    kept = [found for found in trace.found if found not in useless]
    why = "chance does not explain it, but adding it did not bring the error down on held-out blocks"
    tried = [
        Tried(found.look, found.candidate.columns if found.candidate else (), found.p_value, why) for found in useless
    ]
    final = fit_movement(trace.coarse, terms)
    return replace(trace, found=kept, tried=[*trace.tried, *tried], final=final)


def _without_explained(search: _Search, trace: Trace) -> Trace:
    """Drop findings that later ones explain: where the mean moves by a column not known yet, spread does too."""
    for found in trace.found[:-1]:
        without_it = fit_movement(trace.coarse, _removed(trace.final.terms, found))
        search.progress(f"looking at {found.look} again")
        p_value = _probability_beside(search, found, without_it, trace.final)
        if p_value is not None and p_value > LEVEL[found.look]:
            why = f"the other findings explain it: beside them chance gives as much in {100 * p_value:.2g} % of tables"
            columns = found.candidate.columns if found.candidate else ()
            tried = [*trace.tried, Tried(found.look, columns, p_value, why)]
            kept = [other for other in trace.found if other is not found]
            trace = replace(trace, found=kept, tried=tried, final=without_it)
    return trace


def _probability_beside(search: _Search, found: Found, without_it: Fitted, final: Fitted) -> float | None:
    """Probability of a finding on the movement's size beside all others; None for what acts on the mean."""
    coarse = search.coarse
    if found.look == "growth":
        return min(find_growth(coarse, without_it).p_value, find_slow_growth(coarse, without_it).p_value)
    if found.look == "regime":
        return find_clustering(coarse, without_it, search.rng(3)).p_value
    if found.candidate is None or found.look == Look.LOCATION.value:
        return None
    look, answer = Look(found.look), coarse.answer(found.candidate.effect)
    answer = answer / answer[coarse.valid].std(axis=0)
    costs, at_once = np.array([found.candidate.cost]), np.zeros(1, dtype=np.intp)
    rows = look_rows(look, coarse, without_it)
    statistic = scan(rows, [answer], transform_answers([answer]), costs, search.shifts, at_once).statistic[0]
    usable = _usable(search, look, without_it)
    return tail_probability(float(statistic), search.scan(look, final).null[usable].max(axis=0))


def _removed(terms: Terms, found: Found) -> Terms:
    if found.candidate is None:
        neutral: dict[str, Terms] = {
            "growth": replace(terms, growth=False, slow_growth=False),
            "regime": replace(terms, regime_scale=None),
            "periodic": replace(terms, weave=None),
            "wander": replace(terms, drift=False, step_at=None),
        }
        return neutral[found.look]
    columns = found.candidate.columns

    def kept(effects: tuple[ColumnEffect, ...]) -> tuple[ColumnEffect, ...]:
        return tuple(effect for effect in effects if effect.columns != columns)

    by_look: dict[str, Terms] = {
        "location": replace(terms, location=kept(terms.location)),
        "scale": replace(terms, spread=kept(terms.spread)),
        "dynamics": replace(terms, pace=kept(terms.pace)),
        "fine": replace(terms, fine=kept(terms.fine)),
        "slow": replace(terms, slow=kept(terms.slow)),
    }
    return by_look[found.look]


def _search(
    coarse: Coarse, columns: list[Column], seed: np.random.SeedSequence, progress: Callable[[str], None]
) -> _Search:
    seen = coarse.timeline.valid
    context = {name: values[seen] for name, values in coarse.context.items()}
    everything = with_responses(single_candidates(columns, context) + product_candidates(columns, context))
    kept, answers, supports = [], [], []
    for candidate in everything:
        answer = coarse.answer(candidate.effect)
        deviation = answer[coarse.valid].std(axis=0)
        if not np.all(deviation > 1e-9 * (1e-9 + np.abs(answer).max(axis=0))):
            continue
        support = _support(answer[coarse.valid])
        if support >= MIN_SUPPORT:
            kept.append(candidate)
            supports.append(support)
            answers.append(answer / deviation)
    shifts = draw_shifts(len(coarse), np.random.default_rng(np.random.SeedSequence(seed.entropy, spawn_key=(0,))))
    costs = np.array([candidate.cost for candidate in kept])
    return _Search(
        coarse, kept, answers, transform_answers(answers), np.asarray(supports), costs, shifts, seed, columns, progress
    )


def _support(answer: FloatArray) -> float:
    """Seconds on which an answer's variance rests, for its scarcest component: (sum x^2)^2 / sum x^4."""
    squares = np.square(answer - answer.mean(axis=0))
    return float((squares.sum(axis=0) ** 2 / np.maximum(np.square(squares).sum(axis=0), 1e-300)).min())


def _one_round(search: _Search, fitted: Fitted, number: int) -> tuple[Found | None, list[Tried]]:
    """The most urgent proposal that passes, and what did not."""
    proposals = [*_column_proposals(search, fitted), *_hidden_proposals(search, fitted, number)]
    tried: list[Tried] = []
    # regimes explain whatever comes in clusters: they are asked last, when nothing that can be named explains it
    for proposal in sorted(proposals, key=lambda proposal: (proposal.look == "regime", proposal.urgency)):
        search.progress(f"round {number + 1}: proving {proposal.look}")
        outcome = proposal.prove()
        if isinstance(outcome, Found):
            return _better_explained(outcome, proposals), tried
        tried.append(outcome)
    return None, tried


def _better_explained(found: Found, proposals: Sequence[_Proposal]) -> Found:
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


def _column_proposals(search: _Search, fitted: Fitted) -> Iterable[_Proposal]:
    from scipy.stats import chi2

    scans: dict[Look, Scan] = {}
    if not search.candidates:
        return
    for look in Look:
        search.progress(f"columns that act on the {look.value}")
        result = scans[look] = search.scan(look, fitted)
        usable = _usable(search, look, fitted) & ~_shadows(search, look, fitted, result)
        if not usable.any():
            continue
        best, statistic = _exact_best(search, look, fitted, result, usable)
        crude = float(min(1.0, 100.0 * chi2.sf(max(statistic, 0.0), 1)))
        spread = scans.get(Look.SPREAD)

        def prove(
            look: Look = look,
            result: Scan = result,
            best: int = best,
            spread: Scan | None = spread,
            crude: float = crude,
        ) -> Found | Tried:
            """Refine the best candidate and compare it with the null."""
            if crude > WORTH_PROVING:
                return Tried(look.value, search.candidates[best].columns, crude, "no stronger than what chance gives")
            if look is Look.FINE and spread is not None and float(spread.chi_square[best]) > 9.0:
                return _proven(search, Look.SPREAD, fitted, result, best)
            return _proven(search, look, fitted, result, best)

        yield _Proposal(look.value, crude, prove)


def _exact_best(
    search: _Search, look: Look, fitted: Fitted, result: Scan, usable: NDArray[np.bool_]
) -> tuple[int, float]:
    """Best candidate by the exact score: near cut-out stretches the scan's power is only approximate."""
    target = target_of(look, search.coarse, fitted)
    best, reached = -1, -np.inf
    for index in np.argsort(-np.where(usable, result.statistic, -np.inf))[:RECHECKED]:
        gain = target.gain(_at_lag(search, int(index), result))
        degrees = search.answers[index].shape[1]
        score = float(result.calibrations[index].without(gain).apply(gain, degrees)) - float(search.costs[index])
        if score > reached and usable[index]:
            best, reached = int(index), score
    return best, reached


def _usable(search: _Search, look: Look, fitted: Fitted) -> NDArray[np.bool_]:
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
    if look is Look.FINE and entangled:
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


def _shadows(search: _Search, look: Look, fitted: Fitted, result: Scan) -> NDArray[np.bool_]:
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


def _proven(search: _Search, look: Look, fitted: Fitted, result: Scan, best: int) -> Found | Tried:
    """Refine, refit with it, and take the null from what is left then."""
    usable = _usable(search, look, fitted) & ~_shadows(search, look, fitted, result)
    chosen = refine(search.coarse, look, fitted, search.candidates, result, usable, best)
    candidate = chosen.candidate
    after = fit_movement(search.coarse, with_effect(fitted.terms, look, candidate))
    null_scan = search.scan(look, after)
    null = null_scan.null[usable].max(axis=0)
    degrees = search.answers[best].shape[1]
    exact = target_of(look, search.coarse, fitted).gain(_at_lag(search, best, result))
    if look in LEAST_FACTOR and (factor := _factor(search.coarse, look, after, candidate)) < LEAST_FACTOR[look]:
        return Tried(look.value, candidate.columns, 1.0, f"a factor of {factor:.2f} is too little to matter")
    calibration = null_scan.calibrations[best].without(0.0)
    observed = float(calibration.apply(exact, degrees)) - search.costs[best]
    p_value = tail_probability(observed, null)
    if p_value > LEVEL[look.value]:
        return _not_enough(look.value, p_value, candidate.columns)
    return Found(look.value, p_value, fitted, after, candidate, chosen.rivals)


def _factor(coarse: Coarse, look: Look, after: Fitted, candidate: Candidate) -> float:
    """Factor between the 5 % and 95 % quantile of an effect's strength, at least 1."""
    answer = coarse.answer(candidate.effect)
    if look is Look.SPREAD:
        last = len(after.scale_sizes) - (1 if after.terms.growth else 0)
        strength = answer @ after.scale_sizes[last - answer.shape[1] : last]
    else:
        seconds = slow_rows(coarse, after) if look is Look.SLOW else fine_rows(coarse, after, raw=True)
        strength = answer @ log_sizes(seconds.squares, seconds.valid, answer)[0]
    low, high = np.quantile(strength[coarse.valid], [0.05, 0.95])
    if high <= low:
        low, high = strength[coarse.valid].min(), strength[coarse.valid].max()
    return float(np.exp(high - low))


def _at_lag(search: _Search, index: int, result: Scan) -> FloatArray:
    effect = search.candidates[index].effect
    return search.coarse.answer(replace(effect, lag_s=float(result.lag[index])))


def with_effect(terms: Terms, look: Look, candidate: Candidate) -> Terms:
    """Terms with one more column effect."""
    if look is Look.LOCATION:
        return replace(terms, location=(*terms.location, candidate.effect))
    if look is Look.SPREAD:
        return replace(terms, spread=(*terms.spread, replace(candidate.effect, acts=Acts.SPREAD)))
    if look is Look.PACE:
        return replace(terms, pace=(*terms.pace, replace(candidate.effect, acts=Acts.RATE)))
    if look is Look.SLOW:
        return replace(terms, slow=(*terms.slow, replace(candidate.effect, acts=Acts.SPREAD)))
    return replace(terms, fine=(*terms.fine, replace(candidate.effect, acts=Acts.FINE)))


def _prove_regimes(search: _Search, fitted: Fitted, clustering: Clustering) -> Found | Tried:
    """Clusters of loud seconds count as regimes if they last."""
    if clustering.p_value > LEVEL["regime"]:
        return _not_enough("regime", clustering.p_value)
    regimes = fit_regimes(fitted.rows, search.coarse.valid)
    if min(regimes.on_s, regimes.off_s) < MIN_REGIME_S:
        why = f"loud stretches last {regimes.on_s:.0f} s only: that is how people correct, and no regime"
        return Tried("regime", (), clustering.p_value, why)
    terms = replace(fitted.terms, regime_scale=regime_log_scale(search.coarse, fitted))
    return Found("regime", clustering.p_value, fitted, fit_movement(search.coarse, terms), detail=clustering)


def _not_enough(look: str, p_value: float, columns: tuple[str, ...] = ()) -> Tried:
    why = f"chance gives as much in {100 * p_value:.3g} % of tables; {100 * LEVEL[look]:g} % is allowed"
    return Tried(look, columns, p_value, why)


def _hidden_proposals(search: _Search, fitted: Fitted, number: int) -> Sequence[_Proposal]:
    coarse, terms = search.coarse, fitted.terms
    proposals = []

    def add(
        look: str, p_value: float, detail: Growth | Clustering | Peak | Wander, change: Callable[[], Terms]
    ) -> None:
        def prove() -> Found | Tried:
            if p_value > LEVEL[look]:
                return _not_enough(look, p_value)
            return Found(look, p_value, fitted, fit_movement(coarse, change()), detail=detail)

        proposals.append(_Proposal(look, p_value, prove))

    search.progress("changes with time")
    if not (terms.growth or terms.slow_growth):
        growth, slow_growth = find_growth(coarse, fitted), find_slow_growth(coarse, fitted)
        add("growth", growth.p_value, growth, lambda: replace(terms, growth=True))
        add("growth", slow_growth.p_value, slow_growth, lambda: replace(terms, slow_growth=True))
    if terms.regime_scale is None:
        clustering = find_clustering(coarse, fitted, search.rng(1, number))
        proposals.append(_Proposal("regime", clustering.p_value, lambda: _prove_regimes(search, fitted, clustering)))
    if terms.weave is None and (peak := find_peak(coarse, fitted)) is not None:
        add("periodic", peak.p_value, peak, lambda: replace(terms, weave=peak.frequency, weave_width=peak.width))
    search.progress("slow drift and steps")
    if (wander := find_wander(coarse, fitted, search.rng(2, number))) is not None:
        change = replace(terms, step_at=wander.at) if wander.is_step else replace(terms, drift=True)
        add("wander", wander.p_value, wander, lambda: change)
    return proposals
