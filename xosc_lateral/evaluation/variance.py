"""Where the variance of the offset lies: between drivers, within them, inside windows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class VarianceParts:
    """Where the variance of the offset lies.

    Parameters
    ----------
    between : float
        Of the drivers' own means. [m²]
    within : float
        Of a driver's windows about that mean. [m²]
    inside : float
        About a window's own mean. [m²]
    """

    between: float
    within: float
    inside: float


def variance_parts(windows: FloatArray, drivers: NDArray[np.generic]) -> VarianceParts:
    """Variance between drivers, within drivers, and inside windows.

    One-way random effects on the windows' means, by the method of moments for unequal counts [1]_. Neighbouring
    windows of a driver are alike, so `between` holds what changes more slowly than a drive is long.

    Parameters
    ----------
    windows : array, shape (n, m)
        [m]
    drivers : array, shape (n,)

    References
    ----------
    .. [1] S. R. Searle, G. Casella, C. E. McCulloch, "Variance Components", Wiley 1992, section 3.6.
    """
    means = windows.mean(axis=1)
    names, member, counts = np.unique(drivers, return_inverse=True, return_counts=True)
    own = np.bincount(member, means) / counts
    inside = float(windows.var(axis=1).mean())
    n, k = len(means), len(names)
    if k < 2 or n == k:
        return VarianceParts(float(means.var()), 0.0, inside)
    within = float(((means - own[member]) ** 2).sum() / (n - k))
    among = float((counts * (own - means.mean()) ** 2).sum() / (k - 1))
    effective = (n - (counts**2).sum() / n) / (k - 1)
    return VarianceParts(max((among - within) / float(effective), 0.0), within, inside)
