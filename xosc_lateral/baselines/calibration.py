"""Free numbers chosen by what is scored: the mean distance of the ten metrics on training runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.baselines.base import LateralModel
from xosc_lateral.driver.snippets import cut_snippets, segment_of
from xosc_lateral.drives.drive import Run
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.errors import NotEnoughDataError
from xosc_lateral.evaluation.distances import metric_distances
from xosc_lateral.evaluation.metrics import snippet_metrics
from xosc_lateral.segment import Segment

FloatArray = NDArray[np.float64]
M = TypeVar("M", bound=LateralModel)

LENGTHS = ((10.0, True), (30.0, False))
"""Windows that are compared: length [s], and whether they share their starts. Those that the board ranks by."""

MOST_WINDOWS = 250
"""Of each length; evenly thinned out."""

FIRST_LOOK, STEPS = 32, 50
"""Points that the box is first looked over at, and evaluations of the descent from the best of them."""


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
        return distance_to(targets, model_at(shares), seed) + outside

    points = qmc.Sobol(len(names), seed=seed).random(FIRST_LOOK if len(names) > 1 else FIRST_LOOK // 2)
    best = min(points, key=cost)
    simplex = np.vstack([best, *(best + 0.12 * row * np.where(best > 0.5, -1, 1) for row in np.eye(len(names)))])
    found = minimize(
        cost, best, method="Nelder-Mead", options={"maxfev": STEPS, "initial_simplex": simplex, "xatol": 0.01}
    )
    return model_at(found.x)


@dataclass(frozen=True, eq=False)
class CalibrationTarget:
    """Measured windows of one length and their metrics."""

    segments: list[Segment]
    starts: FloatArray
    metrics: FloatArray
    same_start: bool


def targets_of(runs: Sequence[Run]) -> list[CalibrationTarget]:
    """Windows that a candidate is compared with; lengths that no run has are left out."""
    targets = []
    for seconds, same_start in LENGTHS:
        if any(len(run) > round(seconds / STEP) for run in runs):
            windows = cut_snippets(runs, seconds, STEP)
            windows = windows[:: max(1, -(-len(windows) // MOST_WINDOWS))]
            if len(windows) > 1:
                rows = np.array([window.offset for window in windows])
                segments = [segment_of(window.run, window.rows) for window in windows]
                targets.append(CalibrationTarget(segments, rows[:, 0], snippet_metrics(rows), same_start))
    if not targets:
        longest = max((len(run) for run in runs), default=0) * STEP
        raise NotEnoughDataError(f"the longest run lasts {longest:.1f} s; several windows of 10 s are needed to fit")
    return targets


def distance_to(targets: Sequence[CalibrationTarget], model: LateralModel, seed: int) -> float:
    """Mean distance over the windows of all lengths, in standard deviations of the real metrics. [-]"""
    rng = np.random.default_rng(seed)
    found = []
    for target in targets:
        sampled = np.array(model.sample(target.segments, target.starts if target.same_start else None, rng))
        found.append(metric_distances(target.metrics, snippet_metrics(sampled)).mean)
    return float(np.mean(found))
