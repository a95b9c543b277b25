"""Every number of a model beside its floor, mean over the halves."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from laboratory.board.half import Half, floors, pooled
from laboratory.board.ranked import SHORT, ranked_numbers
from laboratory.board.result import ModelScore
from laboratory.board.sampled_half import SampledHalf
from xosc_lateral.drivers.evaluation.classifier import classifier_two_sample_test
from xosc_lateral.drivers.evaluation.metrics import SCORE_UNITS, proper_scores
from xosc_lateral.drivers.evaluation.snippets import UNITS, SnippetCondition, differences, named_distances

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Parts = Sequence[tuple[Half, Mapping[str, SampledHalf]]]


def numbers_of(parts: Parts, key: str, floor: Mapping[str, float], *, classify: bool) -> tuple[ModelScore, ...]:
    """Numbers of one model; see `floors_of` for their names."""
    values = pooled([_of_half(half, sampled[key]) for half, sampled in parts])
    if classify:
        values |= _classified(parts[0][0], parts[0][1][key])
    ranked = {f"{family}, {condition.name}" for condition, family in ranked_numbers(parts[0][0].windows)}
    return tuple(
        ModelScore(name, _unit(name), value, floor[name], name in ranked)
        for name, value in values.items()
        if name in floor
    )


def floors_of(split: Sequence[Half], *, classify: bool) -> dict[str, float]:
    """Real against real, for every number: families by condition, single metrics, proper scores, classifiers."""
    found = pooled([_floors_of_half(half) for half in split])
    if classify:
        found |= _classified_floors(split[0])
    return found


def _of_half(half: Half, sampled: SampledHalf) -> dict[str, float]:
    found: dict[str, float] = {}
    for condition in half.conditions:
        real, drawn = half.features[condition.seconds], sampled.features[condition]
        rows = np.arange(len(real))
        several = pooled([differences(real, other, rows, rows) for other in drawn])
        found |= {f"{family}, {condition.name}": value for family, value in several.items()}
        if condition == SnippetCondition(SHORT, True):
            named = pooled([named_distances(real, other) for other in drawn])
            found |= {f"{name}, {condition.name}": value for name, value in named.items()}
    return found | _proper_scores(half.windows[SHORT].offset, sampled.ensemble)


def _floors_of_half(half: Half) -> dict[str, float]:
    found: dict[str, float] = {}
    for condition in half.conditions:
        found |= {f"{family}, {condition.name}": value for family, value in floors(half, condition).items()}
    stand_ins = half.stand_ins[SHORT]
    named = named_distances(half.features[SHORT], half.donor_features[SHORT].take(stand_ins[:, 0]))
    found |= {f"{name}, {SnippetCondition(SHORT, True).name}": value for name, value in named.items()}
    return found | _proper_scores(half.windows[SHORT].offset, half.donors[SHORT].offset[stand_ins])


def _proper_scores(real: FloatArray, ensemble: FloatArray) -> dict[str, float]:
    return {_proper_name(name): value for name, value in proper_scores(real, ensemble).items()}


def _proper_name(name: str) -> str:
    return f"{name.replace('_', ' ')}, {SHORT:g} s"


def _classified(half: Half, sampled: SampledHalf) -> dict[str, float]:
    found = {}
    for condition in half.conditions:
        own = half.windows[condition.seconds]
        found_area = classifier_two_sample_test(own.offset, sampled.windows[condition], own.group, own.group)
        if found_area is not None:
            found[f"auc, {condition.name}"] = found_area.auc
    return found


def _classified_floors(half: Half) -> dict[str, float]:
    """The vehicles told from those that models were fitted on; both start alike, so one floor does for any start."""
    found = {}
    for condition in half.conditions:
        own, donors = half.windows[condition.seconds], half.donors[condition.seconds]
        area = classifier_two_sample_test(own.offset, donors.offset, own.group, donors.group)
        if area is not None:
            found[f"auc, {condition.name}"] = area.auc
    return found


def _unit(name: str) -> str:
    head = name.split(",")[0]
    return SCORE_UNITS.get(head.replace(" ", "_")) or UNITS.get(head) or ("-" if head == "auc" else "sd")
