"""Score, its interval over resampled vehicles, and how stable the ranking is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.board.half import Half, floors
from xosc_lateral.board.sampled_half import SampledHalf
from xosc_lateral.evaluation.condition import SnippetCondition
from xosc_lateral.evaluation.differences import differences
from xosc_lateral.evaluation.ranked import SHORT, ranked_numbers

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

RESAMPLES = 200


def score_rows(
    half: Half, sampled: SampledHalf, base: Mapping[tuple[SnippetCondition, str], float], rows: Rows
) -> float:
    """Geometric mean of value over floor for a choice of windows. [-]"""
    logs, found = [], {}
    for condition, family in ranked_numbers(half.windows):
        if condition not in found:
            chosen = rows[condition.seconds]
            real, other = half.features[condition.seconds], sampled.features[condition]
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


def bootstrap(
    parts: Sequence[tuple[Half, Mapping[str, SampledHalf]]], rng: np.random.Generator, resamples: int
) -> tuple[dict[str, FloatArray], dict[str, FloatArray]]:
    """Scores of all models on the halves as they are, and on resampled vehicles.

    Returns
    -------
    by_half : dict of str to array, shape (halves,)
    drawn : dict of str to array, shape (resamples,)
        Geometric mean over the halves; every model sees the same vehicles in a resample.
    """
    keys = list(parts[0][1])
    bases = [floor_of(half) for half, _ in parts]
    by_half: dict[str, list[float]] = {key: [] for key in keys}
    logs = {key: np.zeros(resamples) for key in keys}
    for (half, sampled), base in zip(parts, bases, strict=True):
        whole = all_rows(half)
        for key in keys:
            by_half[key].append(score_rows(half, sampled[key], base, whole))
        for number in range(resamples):
            rows = resampled_rows(half, rng)
            for key in keys:
                logs[key][number] += np.log(score_rows(half, sampled[key], base, rows)) / len(parts)
    return {key: np.array(values) for key, values in by_half.items()}, {key: np.exp(row) for key, row in logs.items()}


def ranks(scores: Mapping[str, FloatArray]) -> dict[str, IntArray]:
    """Place of each model in each resample, 1 the best. Shape (resamples,) each. [-]"""
    table = np.array(list(scores.values()))
    places = table.argsort(axis=0).argsort(axis=0) + 1
    return dict(zip(scores, places, strict=True))


def kendall_tau(one: Sequence[float], other: Sequence[float]) -> float:
    """Kendall's rank correlation (tau b): 1 for the same order. [-]"""
    from scipy.stats import kendalltau

    return float(kendalltau(one, other).statistic)
