"""Free numbers chosen by what the board ranks by, on training runs: other vehicles than those that are scored."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.baselines.base import LateralModel
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.errors import NotEnoughDataError
from xosc_lateral.evaluation.condition import SnippetCondition
from xosc_lateral.evaluation.differences import differences
from xosc_lateral.evaluation.measures import Features, features_of
from xosc_lateral.evaluation.ranked import LONG, SHORT, ranked_numbers
from xosc_lateral.evaluation.snippets import Snippets, snippets_of
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]
M = TypeVar("M", bound=LateralModel)

MOST_WINDOWS = 250
"""Of each length; evenly thinned out."""

FIRST_LOOK, STEPS = 64, 100
"""Points at which the box is first looked over, and evaluations of the descent from the best of them."""

LEAST = 1e-6
"""Difference below which nothing is gained. [unit of the family]"""


@dataclass(frozen=True)
class Bounds:
    """Range that a number is looked for in; `log`: evenly in its logarithm."""

    low: float
    high: float
    log: bool = True

    def at(self, share: float) -> float:
        """Value at a share of the range, 0 to 1 (beyond: the end of the range)."""
        share = min(max(share, 0.0), 1.0)
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + (self.high - self.low) * share


def calibrate(
    build: Callable[[Mapping[str, float]], M], bounds: Mapping[str, Bounds], runs: Sequence[Run], *, seed: int = 1
) -> M:
    """The model whose sampled windows lie nearest to the measured ones.

    A Sobol sequence looks over the box, a simplex goes down from its best point [1]_; every candidate is sampled with
    the same random numbers, so that candidates differ by what they are and not by chance.

    Parameters
    ----------
    build : callable
        Numbers by name -> model.
    bounds : mapping of str to Bounds
    runs : sequence of Run
        Training data.
    seed : int

    References
    ----------
    .. [1] J. A. Nelder, R. Mead, "A simplex method for function minimization", Computer Journal 7, 1965.
    """
    from scipy.optimize import minimize
    from scipy.stats import qmc

    targets = targets_of(runs)
    names = list(bounds)

    def model_at(shares: Sequence[float] | FloatArray) -> M:
        return build({name: bounds[name].at(float(share)) for name, share in zip(names, shares, strict=True)})

    def cost(shares: Sequence[float] | FloatArray) -> float:
        outside = float(np.abs(np.asarray(shares) - np.clip(shares, 0.0, 1.0)).sum())
        return float(np.log(distance_to(targets, model_at(shares), seed))) + outside

    points = qmc.Sobol(len(names), seed=seed).random(FIRST_LOOK if len(names) > 1 else FIRST_LOOK // 2)
    best = min(points, key=cost)
    simplex = np.vstack([best, *(best + 0.12 * row * np.where(best > 0.5, -1, 1) for row in np.eye(len(names)))])
    found = minimize(
        cost, best, method="Nelder-Mead", options={"maxfev": STEPS, "initial_simplex": simplex, "xatol": 0.01}
    )
    return model_at(found.x)


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
        sampled = np.array(model.sample(target.segments, target.starts if target.condition.same_start else None, rng))
        other = features_of(sampled, target.lane_width, STEP)
        rows = np.arange(len(other))
        found = differences(target.features, other, rows, rows)
        logs += [np.log(max(found[family], LEAST)) for family in target.families]
    return float(np.exp(np.mean(logs)))
