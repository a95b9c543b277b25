"""From the scan's grid to the best lag, response time and shape; and which other columns would do as well."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import ColumnEffect, Linear, Magnitude, Piecewise, Saturating, Threshold
from xosc_lateral.loop.candidates import COST_SHAPE, Candidate
from xosc_lateral.loop.looks import (
    SLOW_S,
    Look,
    fine_rows,
    kernel_terms,
    pull,
    slow_columns,
    slow_rows,
    standardised,
)
from xosc_lateral.loop.movement import CLIP, Coarse, Fitted, squared_innovations
from xosc_lateral.loop.scan import Scan, as_one_degree
from xosc_lateral.loop.sizing import log_sizes

FloatArray = NDArray[np.float64]

LAG_RANGE = (-5.0, 5.0)
"""Lags that are tried. [s]"""

RESPONSES = (0.3, 0.6, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Response times that are tried. [s]"""

USUAL_LAG = (-0.5, 1.5)
"""Middle and standard deviation of the delays that drivers have: from 2 s ahead to 1 s behind, and some beyond. [s]"""

USUAL_RESPONSE = (2.0, 1.0)
"""Middle [s] and standard deviation [factors of two] of the times that they take to answer."""

WITHIN = 25.0
"""Candidates whose score is lower than the best by up to this are refined too. [chi-square]"""

KNOTS = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Quantiles at which a curve may bend. [-]"""

MIN_VALUES = 8
"""A column with fewer different values has no curve."""

COST_BEND = 2.0
"""Of every bend, beside its degree of freedom. [chi-square]"""

CONTENDERS = 6
"""At most so many."""

SAME = 3.0
"""Two columns whose scores differ by less than this can't be told apart. [chi-square]"""


@dataclass(frozen=True, slots=True)
class Choice:
    """The refined winner.

    Parameters
    ----------
    candidate : Candidate
    score : float
        Chi-square as of one degree of freedom, less cost.
    rivals : tuple of str
        Columns of other quantities that explain as much and next to which it adds nothing.
    """

    candidate: Candidate
    score: float
    rivals: tuple[str, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Target:
    """What candidates are regressed on in a look: white rows, and how an answer becomes such rows."""

    rows: FloatArray
    transform: Callable[[FloatArray], FloatArray]
    robust: bool = False
    """Variance from the products of rows and answer themselves, for rows whose size goes with the answer's."""

    def gain(self, answer: FloatArray, beside: FloatArray | None = None) -> float:
        """Chi-square that the answer adds, beside another answer's transformed rows if given."""
        columns = self.transform(answer)
        rows = self.rows
        if beside is not None:
            basis = np.linalg.qr(beside)[0]
            columns, rows = columns - basis @ (basis.T @ columns), rows - basis @ (basis.T @ rows)
        gram = columns.T @ columns
        gram[np.diag_indices(len(gram))] *= 1.0 + 1e-9
        if np.trace(gram) <= 1e-12:
            return 0.0
        projected = columns.T @ rows
        if self.robust:
            products = columns * rows[:, None]
            gram = products.T @ products
        return float(projected @ np.linalg.pinv(gram) @ projected)


def target_of(look: Look, coarse: Coarse, fitted: Fitted) -> Target:
    """White rows of a look, free of everything in the model."""
    ones = np.ones((len(coarse), 1))
    if look is Look.LOCATION:
        whitener = fitted.whitener
        known_terms = np.concatenate([fitted.location_columns, kernel_terms(coarse, fitted)], axis=1)
        return _target(fitted.rows, whitener.rows, whitener.rows(known_terms))
    if look is Look.PACE:
        recent = pull(coarse, fitted)[:, None]
        paces = [ones, *(coarse.answer(effect) for effect in fitted.terms.pace)]
        rows = np.where(coarse.valid, fitted.rows, 0.0)
        plain = _target(rows, lambda answer: answer * recent, np.concatenate(paces, axis=1) * recent)
        return replace(plain, robust=True)
    known = fitted.scale_columns
    if look is Look.SPREAD:
        squares, valid = squared_innovations(fitted.rows, coarse.valid), coarse.valid
    elif look is Look.SLOW:
        slow = slow_rows(coarse, fitted)
        squares, valid = standardised(slow.squares, slow.valid), slow.valid
        known = slow_columns(coarse, fitted)
    else:
        fine = fine_rows(coarse, fitted)
        squares, valid = fine.squares, fine.valid
    known_columns = np.concatenate([ones, known], axis=1) * valid[:, None]
    return _target(squares, lambda answer: answer * valid[:, None], known_columns)


def refine(
    coarse: Coarse,
    look: Look,
    fitted: Fitted,
    candidates: list[Candidate],
    result: Scan,
    usable: NDArray[np.bool_],
    best: int,
) -> Choice:
    """Refine the best candidates of the scan and choose among them."""
    target = target_of(look, coarse, fitted)
    contenders = sorted({best, *_contenders(candidates, result, usable)})
    refined = [_refined(coarse, target, candidates[index], float(result.lag[index])) for index in contenders]
    refined += _bent(coarse, target, max(refined, key=lambda scored: scored[1])[0])
    if look in (Look.SPREAD, Look.SLOW, Look.FINE):
        refined = _by_likelihood(coarse, look, fitted, refined)
    refined.sort(key=lambda scored: -scored[1])
    winner, score = refined[0]
    rivals = _rivals(coarse, target, winner, score, refined[1:])
    return Choice(winner, score, rivals)


def score_of(coarse: Coarse, target: Target, candidate: Candidate) -> float:
    """Chi-square as of one degree of freedom, less cost."""
    answer = coarse.answer(candidate.effect)
    score = float(as_one_degree(np.array([target.gain(answer)]), answer.shape[1])[0])
    return score - candidate.cost - timing_cost(candidate.effect)


def timing_cost(effect: ColumnEffect) -> float:
    """What an unlikely timing costs: a delay and a slow answer make up for one another, and weak data can't tell."""
    lag = (effect.lag_s - USUAL_LAG[0]) / USUAL_LAG[1]
    response = np.log2(effect.response_s / USUAL_RESPONSE[0]) / USUAL_RESPONSE[1]
    return float(lag**2 + response**2)


def _target(rows: FloatArray, transform: Callable[[FloatArray], FloatArray], known: FloatArray) -> Target:
    if known.shape[1] == 0:
        return Target(rows, transform)
    basis, triangle = np.linalg.qr(known)
    size = np.abs(np.diag(triangle))
    basis = basis[:, size > 1e-9 * max(float(size.max()), 1e-12)]

    def free(answer: FloatArray) -> FloatArray:
        columns = transform(answer)
        return np.asarray(columns - basis @ (basis.T @ columns))

    return Target(rows - basis @ (basis.T @ rows), free)


def _contenders(candidates: list[Candidate], result: Scan, usable: NDArray[np.bool_]) -> list[int]:
    """Best candidate of each set of columns and each shape, while it is near the best of all."""
    order = np.argsort(-np.where(usable, result.statistic, -np.inf))
    best = result.statistic[order[0]]
    limit = best - max(WITHIN, 0.25 * best)
    chosen: list[int] = []
    seen: set[tuple[tuple[str, ...], str]] = set()
    for index in order:
        if len(chosen) >= CONTENDERS or not usable[index] or (chosen and result.statistic[index] < limit):
            break
        key = (candidates[index].columns, _family(candidates[index].effect))
        if key not in seen:
            seen.add(key)
            chosen.append(int(index))
    return chosen


def _family(effect: ColumnEffect) -> str:
    if isinstance(effect, Threshold):
        return f"threshold {effect.jump} {effect.above}"
    return f"{effect.kind} {getattr(effect, 'factors', '')} {getattr(effect, 'presence', '')}"


def _refined(coarse: Coarse, target: Target, candidate: Candidate, lag_s: float) -> tuple[Candidate, float]:
    effect = replace(candidate.effect, lag_s=lag_s)
    best, score = effect, score_of(coarse, target, replace(candidate, effect=effect))
    for variants in (_timings(1.0), _shapes, _timings(0.4), _shapes, _timings(0.2)):
        improved = True
        while improved:
            improved = False
            for variant in variants(best, coarse):
                reached = score_of(coarse, target, replace(candidate, effect=variant))
                if reached > score + 1e-6:
                    best, score, improved = variant, reached, True
    return replace(candidate, effect=best), score


def _by_likelihood(
    coarse: Coarse, look: Look, fitted: Fitted, refined: list[tuple[Candidate, float]]
) -> list[tuple[Candidate, float]]:
    """Score again by what a log-linear spread gains in likelihood: a score test prefers what suits the squares."""
    if look is Look.SPREAD:
        squares, valid = np.minimum(fitted.rows**2, CLIP), coarse.valid
    else:
        seconds = slow_rows(coarse, fitted) if look is Look.SLOW else fine_rows(coarse, fitted, raw=True)
        squares, valid = seconds.squares, seconds.valid
    # neighbouring averages of slow rows overlap: they count once in so many
    apart = SLOW_S if look is Look.SLOW else 1
    scored = []
    for candidate, _ in refined:
        answer = coarse.answer(candidate.effect)
        log_scale = (answer @ log_sizes(squares, valid, answer)[0])[valid]
        inside = squares[valid]
        level = float(np.mean(inside / np.exp(2.0 * log_scale)))
        gain = float(np.sum(np.log(inside.mean()) - np.log(level) - 2.0 * log_scale)) / apart
        score = float(as_one_degree(np.array([max(gain, 0.0)]), answer.shape[1])[0])
        scored.append((candidate, score - candidate.cost - timing_cost(candidate.effect)))
    return scored


def _bent(coarse: Coarse, target: Target, winner: Candidate) -> list[tuple[Candidate, float]]:
    """Curves with one and two bends in place of the winner, if it acts by a single number."""
    effect = winner.effect
    if not isinstance(effect, Linear | Magnitude | Threshold | Saturating):
        return []
    seen = coarse.context[effect.column][coarse.timeline.valid]
    seen = seen[np.isfinite(seen)]
    if len(np.unique(seen[:: max(1, len(seen) // 2000)])) < MIN_VALUES:
        return []
    inner = np.unique(np.quantile(seen, KNOTS))
    inner = inner[(inner > seen.min()) & (inner < seen.max())]
    knots = [(float(knot),) for knot in inner] + [(float(low), float(high)) for low, high in combinations(inner, 2)]
    bent = []
    for chosen in knots:
        curve = Piecewise(
            acts=effect.acts, column=effect.column, knots=chosen, lag_s=effect.lag_s, response_s=effect.response_s
        )
        candidate = Candidate(curve, COST_SHAPE + COST_BEND * len(chosen))
        bent.append((candidate, score_of(coarse, target, candidate)))
    return bent


def _timings(step: float) -> Callable[[ColumnEffect, Coarse], Iterator[ColumnEffect]]:
    """Neighbours in lag and response time, also along the ridge where one makes up for the other."""

    def variants(effect: ColumnEffect, _: Coarse) -> Iterator[ColumnEffect]:
        at = int(np.argmin(np.abs(np.asarray(RESPONSES) - effect.response_s)))
        for change in (0, -1, 1):
            response = RESPONSES[min(max(at + change, 0), len(RESPONSES) - 1)]
            ridge = effect.response_s - response
            for lag in (effect.lag_s, effect.lag_s - step, effect.lag_s + step, effect.lag_s + ridge):
                lag = round(lag / 0.2) * 0.2
                if LAG_RANGE[0] <= lag <= LAG_RANGE[1] and (lag, response) != (effect.lag_s, effect.response_s):
                    yield replace(effect, lag_s=round(lag, 1), response_s=response)

    return variants


def _shapes(effect: ColumnEffect, coarse: Coarse) -> Iterator[ColumnEffect]:
    """Neighbours in the shape's own parameters."""
    if isinstance(effect, Threshold):
        seen = coarse.context[effect.column][coarse.timeline.valid]
        seen = seen[np.isfinite(seen)]
        share = float(np.mean(seen <= effect.at))
        for change in (-0.1, -0.03, -0.01, 0.01, 0.03, 0.1):
            if 0.02 <= share + change <= 0.98:
                yield replace(effect, at=float(np.quantile(seen, share + change)))
    elif isinstance(effect, Saturating):
        for factor in (0.5, 0.7, 1.4, 2.0):
            if 0.1 <= effect.scale * factor / max(float(np.nanstd(coarse.context[effect.column])), 1e-12) <= 3.0:
                yield replace(effect, scale=effect.scale * factor)


def _rivals(
    coarse: Coarse, target: Target, winner: Candidate, score: float, others: list[tuple[Candidate, float]]
) -> tuple[str, ...]:
    own = coarse.answer(winner.effect)
    rivals: list[str] = []
    for other, reached in others:
        if set(other.columns) & set(winner.columns) or other.cost > winner.cost + COST_SHAPE:
            continue
        theirs = coarse.answer(other.effect)
        beside_them = target.gain(own, beside=target.transform(theirs))
        beside_us = target.gain(theirs, beside=target.transform(own))
        if score - reached < SAME and beside_them < SAME and beside_us < SAME:
            rivals += [column for column in other.columns if column not in rivals]
    return tuple(rivals)
