"""Every number of a model beside its floor, mean over the halves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.board.half import Condition, Half, Sampled, floors, pooled
from xosc_lateral.board.measures import UNITS, differences, named_distances
from xosc_lateral.board.ranking import SHORT, ranked_numbers
from xosc_lateral.board.result import Number
from xosc_lateral.evaluation.classifier import told_apart
from xosc_lateral.evaluation.ensemble_scores import energy_score, variogram_score

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Parts = Sequence[tuple[Half, Mapping[str, Sampled]]]

JUDGED = 400
"""Windows of either kind that a classifier sees: enough for an error of 0.02, and seconds instead of minutes."""

PROPER = {"energy score, 10 s": "m", "variogram score, 10 s": "m"}


def numbers_of(parts: Parts, key: str, floor: Mapping[str, float], *, classify: bool) -> tuple[Number, ...]:
    """Numbers of one model; see `floors_of` for their names."""
    values = pooled([_of_half(half, sampled[key]) for half, sampled in parts])
    if classify:
        values |= _classified(parts[0][0], parts[0][1][key])
    ranked = {f"{family}, {condition.name}" for condition, family in ranked_numbers(parts[0][0])}
    return tuple(
        Number(name, _unit(name), value, floor[name], name in ranked) for name, value in values.items() if name in floor
    )


def floors_of(split: Sequence[Half], *, classify: bool) -> dict[str, float]:
    """Real against real, for every number: families by condition, single metrics, proper scores, classifiers."""
    found = pooled([_floors_of_half(half) for half in split])
    if classify:
        found |= _classified_floors(split[0])
    return found


def _of_half(half: Half, sampled: Sampled) -> dict[str, float]:
    found: dict[str, float] = {}
    for condition in half.conditions:
        real, other = half.features[condition.seconds], sampled.features[condition]
        rows = np.arange(len(real))
        found |= {f"{family}, {condition.name}": v for family, v in differences(real, other, rows, rows).items()}
        if condition == Condition(SHORT, True):
            found |= {f"{name}, {condition.name}": value for name, value in named_distances(real, other).items()}
    return found | _proper_scores(half.windows[SHORT].offset, sampled.ensemble)


def _floors_of_half(half: Half) -> dict[str, float]:
    found: dict[str, float] = {}
    for condition in half.conditions:
        found |= {f"{family}, {condition.name}": value for family, value in floors(half, condition).items()}
    stand_ins = half.stand_ins[SHORT]
    named = named_distances(half.features[SHORT], half.donor_features[SHORT].take(stand_ins[:, 0]))
    found |= {f"{name}, {Condition(SHORT, True).name}": value for name, value in named.items()}
    return found | _proper_scores(half.windows[SHORT].offset, half.donors[SHORT].offset[stand_ins])


def _proper_scores(real: FloatArray, ensemble: FloatArray) -> dict[str, float]:
    try:
        scores = energy_score(real, ensemble), variogram_score(real, ensemble)
    except ImportError:  # without the extra `board`
        return {}
    return {name: float(score.mean()) for name, score in zip(PROPER, scores, strict=True)}


def _classified(half: Half, sampled: Sampled) -> dict[str, float]:
    found = {}
    for condition in half.conditions:
        own = half.windows[condition.seconds]
        rows = _thinned(len(own))
        area = told_apart(own.offset[rows], sampled.windows[condition][rows], own.unit[rows], own.unit[rows])
        if area is not None:
            found[f"auc, {condition.name}"] = area
    return found


def _classified_floors(half: Half) -> dict[str, float]:
    """Real against real, other vehicles on either side, with the same start where the model's windows have it."""
    found = {}
    for condition in half.conditions:
        own, donors = half.windows[condition.seconds], half.donors[condition.seconds]
        rows = _thinned(len(own))
        others = half.stand_ins[condition.seconds][rows, 0] if condition.same_start else _thinned(len(donors))
        # A stand-in is judged together with the window that it stands in for.
        groups = own.unit[rows] if condition.same_start else donors.unit[others]
        area = told_apart(own.offset[rows], donors.offset[others], own.unit[rows], groups)
        if area is not None:
            found[f"auc, {condition.name}"] = area
    return found


def _thinned(count: int) -> IntArray:
    return np.unique(np.linspace(0, count - 1, min(count, JUDGED)).astype(np.int64))


def _unit(name: str) -> str:
    head = name.split(",")[0]
    return PROPER.get(name) or UNITS.get(head) or ("-" if head == "auc" else "sd")
