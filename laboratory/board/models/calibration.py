"""Free numbers chosen by what the board ranks by, on training runs: other vehicles than those that are scored."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.base import LateralModel
from laboratory.board.models.calibration_targets import distance_to, targets_of
from xosc_lateral.drivers.drives.drive import Run

FloatArray = NDArray[np.float64]
M = TypeVar("M", bound=LateralModel)

FIRST_POINTS, DESCENTS, FIRST_STEPS, STEPS = 64, 3, 40, 80
"""Points at which the box is first looked over; how many of the best of them are gone down from; evaluations of each of
these descents, and of the one that goes on from where the best of them ends. From a single point, two Sobol sequences
ended at distances of 0.39 and 0.52 for the potential field on one half of the vehicles; from three, 0.38 and 0.38."""


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

    A Sobol sequence looks over the box, a simplex goes down from its best points [1]_; every candidate is sampled with
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

    def descent(start: FloatArray, steps: int) -> tuple[float, FloatArray]:
        inwards = np.where(start > 0.5, -1, 1)
        simplex = np.vstack([start, *(start + 0.12 * row * inwards for row in np.eye(len(names)))])
        found = minimize(
            cost, start, method="Nelder-Mead", options={"maxfev": steps, "initial_simplex": simplex, "xatol": 0.01}
        )
        return float(found.fun), np.clip(found.x, 0.0, 1.0)

    points = qmc.Sobol(len(names), seed=seed).random(FIRST_POINTS if len(names) > 1 else FIRST_POINTS // 2)
    nearest = points[np.argsort([cost(point) for point in points], kind="stable")[:DESCENTS]]
    first = min((descent(point, FIRST_STEPS) for point in nearest), key=_value)
    return model_at(min(first, descent(first[1], STEPS), key=_value)[1])


def _value(end: tuple[float, FloatArray]) -> float:
    return end[0]
