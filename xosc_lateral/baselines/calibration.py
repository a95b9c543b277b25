"""Free numbers chosen by what the board ranks by, on training runs: other vehicles than those that are scored."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.baselines.base import LateralModel
from xosc_lateral.baselines.calibration_targets import distance_to, targets_of
from xosc_lateral.drives.drive import Run

FloatArray = NDArray[np.float64]
M = TypeVar("M", bound=LateralModel)

FIRST_LOOK, STEPS = 64, 100
"""Points at which the box is first looked over, and evaluations of the descent from the best of them."""


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
