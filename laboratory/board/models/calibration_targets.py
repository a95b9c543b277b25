"""What candidates of a calibration are compared with: measured windows, by what the board ranks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.base import LateralModel
from laboratory.board.ranked import LONG, SHORT, ranked_numbers
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.drive import STEP, Run
from xosc_lateral.drivers.evaluation.snippets import (
    Features,
    SnippetCondition,
    Snippets,
    differences,
    features_of,
    snippets_of,
)

FloatArray = NDArray[np.float64]

MOST_WINDOWS = 250
"""Of each length; evenly thinned out."""

DRAWS = 4
"""Sampled windows for each measured one. With one, a fit follows its random numbers: 0.24 where others gave 0.39."""

LEAST = 1e-6
"""Difference below which nothing is gained. [unit of the family]"""


@dataclass(frozen=True, eq=False)
class CalibrationTarget:
    """Measured windows under one condition, their features, and which families of them are ranked."""

    condition: SnippetCondition
    families: tuple[str, ...]
    segments: list[Segment]
    starts: FloatArray
    lane_width: FloatArray
    features: Features


def targets_of(runs: Sequence[Run]) -> list[CalibrationTarget]:
    """Windows that a candidate is compared with."""
    windows = {seconds: snippets_of(runs, seconds, STEP, by_block=False) for seconds in (SHORT, LONG)}
    windows = {seconds: found for seconds, found in windows.items() if len(found) > 1}
    if SHORT not in windows:
        longest = max((len(run) for run in runs), default=0) * STEP
        raise NotEnoughDataError(f"the longest run lasts {longest:.1f} s; several windows of 10 s are needed to fit")
    ranked = ranked_numbers(windows)
    targets = []
    for condition in dict.fromkeys(condition for condition, _ in ranked):
        families = tuple(family for one, family in ranked if one == condition)
        targets.append(_target(windows[condition.seconds], condition, families))
    return targets


def _target(windows: Snippets, condition: SnippetCondition, families: tuple[str, ...]) -> CalibrationTarget:
    every = max(1, -(-len(windows) // MOST_WINDOWS))
    offset, width = windows.offset[::every], windows.lane_width[::every]
    return CalibrationTarget(
        condition, families, list(windows.segments[::every]), offset[:, 0], width, features_of(offset, width, STEP)
    )


def distance_to(targets: Sequence[CalibrationTarget], model: LateralModel, seed: int) -> float:
    """Geometric mean of what is ranked. Floors, being the same for every candidate, change no order. [mixed units]"""
    rng = np.random.default_rng(seed)
    logs = []
    for target in targets:
        starts = np.tile(target.starts, DRAWS) if target.condition.same_start else None
        sampled = np.array(model.sample(target.segments * DRAWS, starts, rng))
        other = features_of(sampled, np.tile(target.lane_width, (DRAWS, 1)), STEP)
        found = differences(target.features, other, np.arange(len(target.features)), np.arange(len(other)))
        logs += [np.log(max(found[family], LEAST)) for family in target.families]
    return float(np.exp(np.mean(logs)))
