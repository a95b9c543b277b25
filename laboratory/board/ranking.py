"""Score, its interval over resampled vehicles, and how stable the ranking is.

Rankings are compared by Kendall's tau [1]_; intervals are those of the bootstrap [2]_.

References
----------
.. [1] M. G. Kendall, "A new measure of rank correlation", Biometrika 30, 1938.
.. [2] B. Efron, "Bootstrap methods: another look at the jackknife", Annals of Statistics 7, 1979.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from laboratory.board.half import DRAWS, Half, floors
from laboratory.board.ranked import SHORT, ranked_numbers
from laboratory.board.sampled_half import SampledHalf
from xosc_lateral.drivers.evaluation.snippets import SnippetCondition, differences

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

RESAMPLES = 200

QUANTILES = (0.025, 0.975)


def score_rows(
    half: Half, sampled: SampledHalf, base: Mapping[tuple[SnippetCondition, str], float], rows: Rows, draw: int = 0
) -> float:
    """Geometric mean of value over floor for a choice of windows and one draw of the model's. [-]"""
    logs, found = [], {}
    for condition, family in ranked_numbers(half.windows):
        if condition not in found:
            chosen = rows[condition.seconds]
            real, other = half.features[condition.seconds], sampled.features[condition][draw]
            found[condition] = differences(real, other, chosen, chosen)
        logs.append(np.log(max(found[condition][family], 1e-6) / base[condition, family]))
    return float(np.exp(np.mean(logs)))


Rows = Mapping[float, IntArray]


def floor_of(half: Half) -> dict[tuple[SnippetCondition, str], float]:
    """Floors of what counts."""
    by_condition = {condition: floors(half, condition) for condition, _ in ranked_numbers(half.windows)}
    return {(condition, family): by_condition[condition][family] for condition, family in ranked_numbers(half.windows)}


def all_rows(half: Half) -> Rows:
    """Every window once."""
    return {seconds: np.arange(len(windows)) for seconds, windows in half.windows.items()}


def resampled_rows(half: Half, rng: np.random.Generator) -> Rows:
    """Windows of as many vehicles as there are, drawn with replacement."""
    units = np.unique(half.windows[SHORT].group)
    drawn = rng.choice(units, len(units))
    return {seconds: _rows_of(windows.group, drawn) for seconds, windows in half.windows.items()}


def _rows_of(unit: NDArray[np.str_], drawn: NDArray[np.str_]) -> IntArray:
    order = np.argsort(unit, kind="stable")
    names = unit[order]
    first, last = np.searchsorted(names, drawn, "left"), np.searchsorted(names, drawn, "right")
    rows = [order[a:b] for a, b in zip(first, last, strict=True)]
    found: IntArray = np.concatenate(rows) if rows else np.zeros(0, dtype=np.int64)
    return found if found.size > 1 else order


def half_score(half: Half, sampled: SampledHalf) -> float:
    """Score on all windows of a half, geometric mean over the draws. [-]"""
    base, rows = floor_of(half), all_rows(half)
    return float(np.exp(np.mean([np.log(score_rows(half, sampled, base, rows, draw)) for draw in range(DRAWS)])))


def bootstrap(
    parts: Sequence[tuple[Half, Mapping[str, SampledHalf]]], rng: np.random.Generator, resamples: int
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Scores of all models on the halves as they are, and on resampled vehicles.

    Returns
    -------
    by_half : dict of str to array, shape (halves,)
        Geometric mean over the draws.
    drawn : dict of str to array, shape (resamples,)
        Geometric mean over the halves, of one draw, another each time; every model sees the same vehicles in a
        resample.
    """
    keys = list(parts[0][1])
    logs = {key: np.zeros(resamples) for key in keys}
    for half, sampled in parts:
        base = floor_of(half)
        for number in range(resamples):
            rows = resampled_rows(half, rng)
            for key in keys:
                score = score_rows(half, sampled[key], base, rows, number % DRAWS)
                logs[key][number] += np.log(score) / len(parts)
    by_half = {key: np.array([half_score(half, sampled[key]) for half, sampled in parts]) for key in keys}
    return by_half, {key: np.exp(row) for key, row in logs.items()}


def ranks(scores: Mapping[str, FloatArray]) -> dict[str, IntArray]:
    """Place of each model in each resample, 1 the best. Shape (resamples,) each. [-]"""
    table = np.array(list(scores.values()))
    places = table.argsort(axis=0).argsort(axis=0) + 1
    return dict(zip(scores, places, strict=True))


def differing_pairs(score: Mapping[str, float], drawn: Mapping[str, FloatArray]) -> dict[tuple[str, str], bool]:
    """Whether a model's score is better than another's beyond what resampled vehicles change, by (better, worse).

    The 95 % interval of the ratio of their scores, both seeing the same vehicles, lies below 1. As in the intervals of
    single scores, the resamples' spread is laid about the score itself.
    """
    order = sorted(score, key=lambda key: score[key])
    logs = {key: np.log(drawn[key]) - np.log(drawn[key]).mean() + np.log(score[key]) for key in order}
    return {
        (better, worse): bool(np.quantile(logs[better] - logs[worse], QUANTILES[1]) < 0.0)
        for k, better in enumerate(order)
        for worse in order[k + 1 :]
    }


def rank_groups(score: Mapping[str, float], differ: Mapping[tuple[str, str], bool]) -> dict[str, int]:
    """Group of each model, 1 the best: a new one begins with the first model that is told from the last one's best."""
    groups: dict[str, int] = {}
    best, number = "", 0
    for key in sorted(score, key=lambda key: score[key]):
        if not best or differ[best, key]:
            best, number = key, number + 1
        groups[key] = number
    return groups


def agreeing(differ: Mapping[tuple[str, str], bool], by_half: Mapping[str, FloatArray]) -> tuple[int, int]:
    """Pairs of models that are told apart, and how many of them every half has in that order."""
    pairs = [pair for pair, clear in differ.items() if clear]
    return len(pairs), sum(bool(np.all(by_half[better] < by_half[worse])) for better, worse in pairs)


def kendall_tau(one: Sequence[float], other: Sequence[float]) -> float:
    """Kendall's rank correlation (tau b): 1 for the same order. [-]"""
    from scipy.stats import kendalltau

    return float(kendalltau(one, other).statistic)
