"""Proposals of every look, and their proof against chance."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.loop.between import Between, find_between
from xosc_lateral.loop.candidates import Candidate
from xosc_lateral.loop.chance import tail_probability
from xosc_lateral.loop.hidden import (
    Clustering,
    Growth,
    Peak,
    find_clustering,
    find_growth,
    find_peak,
    find_slow_growth,
)
from xosc_lateral.loop.looks import Look, fine_rows, slow_rows
from xosc_lateral.loop.movement import Coarse, Fitted, Terms, fit_movement
from xosc_lateral.loop.refine import refine, target_of
from xosc_lateral.loop.regimes import fit_regimes, regime_log_scale
from xosc_lateral.loop.scan import Scan
from xosc_lateral.loop.search import Search, at_lag, shadows, usable_candidates
from xosc_lateral.loop.sizing import log_sizes
from xosc_lateral.loop.traced import LEVEL, Found, Tried, not_enough, with_effect
from xosc_lateral.loop.wander import Wander, find_wander

FloatArray = NDArray[np.float64]

MIN_REGIME_S = 10.0
"""Shorter regimes are none. [s]"""

MIN_VISITS = 6.0
"""What comes on less often than this is no regime. [-]"""

LEAST_FACTOR = {Look.SPREAD: 1.1, Look.SLOW: 1.1, Look.FINE: 1.25}
"""A change of the spread, or of the fine noise (a centimetre), by less is no finding, however sure. [-]"""

RECHECKED = 40
"""So many of the scan's best are scored exactly."""

WORTH_PROVING = 0.3
"""A look whose best candidate is less likely than this by a crude count is proven against its null."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """The best of one look, before it is proven."""

    look: str
    crude: float
    prove: Callable[[], Found | Tried] = field(repr=False)

    @property
    def urgency(self) -> float:
        """Crude probability over what the look may spend."""
        return self.crude / LEVEL[self.look]


def column_proposals(search: Search, fitted: Fitted) -> Iterable[Proposal]:
    """The best column of every look."""
    from scipy.stats import chi2

    scans: dict[Look, Scan] = {}
    if not search.candidates:
        return
    for look in Look:
        search.progress(f"columns that act on the {look.value}")
        result = scans[look] = search.scan(look, fitted)
        usable = usable_candidates(search, look, fitted) & ~shadows(search, look, fitted, result)
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
                wider = _proven(search, Look.SPREAD, fitted, result, best)
                if isinstance(wider, Found):
                    return wider
            return _proven(search, look, fitted, result, best)

        yield Proposal(look.value, crude, prove)


def _exact_best(
    search: Search, look: Look, fitted: Fitted, result: Scan, usable: NDArray[np.bool_]
) -> tuple[int, float]:
    """Best candidate by the exact score: near cut-out stretches the scan's power is only approximate."""
    target = target_of(look, search.coarse, fitted)
    best, reached = -1, -np.inf
    for index in np.argsort(-np.where(usable, result.statistic, -np.inf))[:RECHECKED]:
        gain = target.gain(at_lag(search, int(index), result))
        degrees = search.answers[index].shape[1]
        score = float(result.calibrations[index].without(gain).apply(gain, degrees)) - float(search.costs[index])
        if score > reached and usable[index]:
            best, reached = int(index), score
    return best, reached


def _proven(search: Search, look: Look, fitted: Fitted, result: Scan, best: int) -> Found | Tried:
    """Refine, refit with it, and take the null from what is left then."""
    usable = usable_candidates(search, look, fitted) & ~shadows(search, look, fitted, result)
    chosen = refine(search.coarse, look, fitted, search.candidates, result, usable, best)
    candidate = chosen.candidate
    after = fit_movement(search.coarse, with_effect(fitted.terms, look, candidate))
    null_scan = search.scan(look, after)
    null = null_scan.null[usable].max(axis=0)
    degrees = search.answers[best].shape[1]
    exact = target_of(look, search.coarse, fitted).gain(at_lag(search, best, result))
    if look in LEAST_FACTOR and (factor := _factor(search.coarse, look, after, candidate)) < LEAST_FACTOR[look]:
        return Tried(look.value, candidate.columns, 1.0, f"a factor of {factor:.2f} is too little to matter")
    calibration = null_scan.calibrations[best].without(0.0)
    observed = float(calibration.apply(exact, degrees)) - search.costs[best]
    p_value = tail_probability(observed, null)
    if p_value > LEVEL[look.value]:
        return not_enough(look.value, p_value, candidate.columns)
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


def _prove_between(search: Search, fitted: Fitted, between: Between) -> Found | Tried:
    candidate = between.candidate
    if between.p_value > LEVEL["between"]:
        return not_enough("between", between.p_value, candidate.columns)
    terms = replace(fitted.terms, between=(*fitted.terms.between, candidate.effect))
    # the drives' own places hold it: nothing is fitted anew
    return Found("between", between.p_value, fitted, replace(fitted, terms=terms), candidate)


def _prove_regimes(search: Search, fitted: Fitted, clustering: Clustering) -> Found | Tried:
    """Clusters of loud seconds count as regimes if they last."""
    if clustering.p_value > LEVEL["regime"]:
        return not_enough("regime", clustering.p_value)
    regimes = fit_regimes(fitted.rows, search.coarse.valid)
    if min(regimes.on_s, regimes.off_s) < MIN_REGIME_S:
        why = f"loud stretches last {regimes.on_s:.0f} s only: that is how people correct, and no regime"
        return Tried("regime", (), clustering.p_value, why)
    visits = float(search.coarse.valid.sum()) / (regimes.on_s + regimes.off_s)
    if visits < MIN_VISITS:
        why = f"it came on about {visits:.0f} times only: odd stretches are no regime, whatever they are"
        return Tried("regime", (), clustering.p_value, why)
    terms = replace(fitted.terms, regime_scale=regime_log_scale(search.coarse, fitted))
    return Found("regime", clustering.p_value, fitted, fit_movement(search.coarse, terms), detail=clustering)


def hidden_proposals(search: Search, fitted: Fitted, number: int) -> Sequence[Proposal]:
    """What no column explains; `number` of the round draws its null."""
    coarse, terms = search.coarse, fitted.terms
    proposals = []

    def add(
        look: str, p_value: float, detail: Growth | Clustering | Peak | Wander, change: Callable[[], Terms]
    ) -> None:
        def prove() -> Found | Tried:
            if p_value > LEVEL[look]:
                return not_enough(look, p_value)
            return Found(look, p_value, fitted, fit_movement(coarse, change()), detail=detail)

        proposals.append(Proposal(look, p_value, prove))

    search.progress("changes with time")
    if coarse.lasts and not (terms.growth or terms.slow_growth):
        growth, slow_growth = find_growth(coarse, fitted), find_slow_growth(coarse, fitted)
        add("growth", growth.p_value, growth, lambda: replace(terms, growth=True))
        add("growth", slow_growth.p_value, slow_growth, lambda: replace(terms, slow_growth=True))
    if terms.regime_scale is None:
        clustering = find_clustering(coarse, fitted, search.rng(1, number))
        proposals.append(Proposal("regime", clustering.p_value, lambda: _prove_regimes(search, fitted, clustering)))
    if terms.weave is None and (peak := find_peak(coarse, fitted)) is not None:
        add("periodic", peak.p_value, peak, lambda: replace(terms, weave=peak.frequency, weave_width=peak.width))
    if (between := find_between(coarse, fitted, search.columns, search.rng(4, number))) is not None:
        proposals.append(Proposal("between", between.p_value, lambda: _prove_between(search, fitted, between)))
    search.progress("slow drift and steps")
    if (wander := find_wander(coarse, fitted, search.rng(2, number))) is not None:
        change = replace(terms, step_at=wander.at) if wander.is_step else replace(terms, drift=True)
        add("wander", wander.p_value, wander, lambda: change)
    return proposals
