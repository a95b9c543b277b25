"""Whether drivers differ: do the drives' mean offsets, or their spreads, scatter more than each one's halves do?

References
----------
.. [1] S. R. Searle, G. Casella, C. E. McCulloch, "Variance Components", Wiley 1992, chapter 3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.regression import Fitted
from xosc_lateral.identification.significance import LEAST

FloatArray = NDArray[np.float64]

MIN_DRIVES = 8
"""Fewer drives say nothing about a population."""

MIN_SECONDS = 20
"""Of road-following in either half of a drive that is counted. [s]"""

LEVEL = 0.002
"""Probability of a false finding."""


@dataclass(frozen=True, slots=True)
class DriverVariance:
    """Scatter between drives, noise taken out.

    Parameters
    ----------
    drives : int
        That were long enough.
    shift : float
        Standard deviation of the drives' mean offsets. [m]
    log_spread : float
        Standard deviation of the logarithm of the drives' spreads. [-]
    p_value : float
        That all drives are of one driver, by the stronger of both.
    """

    drives: int
    shift: float
    log_spread: float
    p_value: float

    @property
    def found(self) -> bool:
        """Whether drivers differ beyond chance."""
        return self.p_value < LEVEL


def test_population(fitted: Fitted, known: FloatArray) -> DriverVariance | None:
    """Analysis of variance with every drive's halves as the noise; None with too few drives.

    Halves of a drive are as far apart in time as a drive is long: what drifts slowly counts as noise, not as a driver.
    `known`, shape (drives,): where the drives keep by effects between them. [m]
    """
    whitener = fitted.whitener
    offset = fitted.movement * whitener.scale + (fitted.levels - known)[whitener.drive]
    means, spreads = _halves(offset, whitener.valid, whitener.drive, len(fitted.levels))
    if len(means) < MIN_DRIVES:
        return None
    shift, p_shift = _scatter(np.asarray(means))
    log_spread, p_spread = _scatter(np.asarray(spreads))
    return DriverVariance(len(means), shift, log_spread, max(min(1.0, 2.0 * min(p_shift, p_spread)), LEAST))


def _halves(
    offset: FloatArray, valid: NDArray[np.bool_], drive: NDArray[np.intp], drives: int
) -> tuple[list[list[float]], list[list[float]]]:
    """Means [m] and logarithms of the spread of both halves of every drive that lasts."""
    means, spreads = [], []
    for index in range(drives):
        own = offset[valid & (drive == index)]
        if len(own) >= 2 * MIN_SECONDS:
            halves = own[: len(own) // 2], own[len(own) // 2 :]
            means.append([float(half.mean()) for half in halves])
            spreads.append([float(np.log(max(half.std(), 1e-6))) for half in halves])
    return means, spreads


def _scatter(halves: FloatArray) -> tuple[float, float]:
    """Standard deviation between drives without the noise, and the F test's probability; halves: shape (drives, 2)."""
    from scipy.stats import f

    between = float(np.var(halves.mean(axis=1), ddof=1))
    within = float(np.mean((halves[:, 0] - halves[:, 1]) ** 2)) / 4.0
    p_value = float(f.sf(between / max(within, 1e-30), len(halves) - 1, len(halves)))
    return float(np.sqrt(max(between - within, 0.0))), p_value
