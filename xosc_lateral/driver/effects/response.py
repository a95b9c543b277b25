"""How a driver answers to a quantity: when, and how slowly."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def respond(values: FloatArray, step: float, lag_s: float, response_s: float) -> FloatArray:
    """Shift a quantity in time, then pass it through a first-order lag of gain 1.

    Parameters
    ----------
    values : array, shape (n,) or (n, k)
        Finite, on a uniform time grid.
    step : float
        Of the grid. [s]
    lag_s : float
        Delay; negative: the driver looks ahead. Beyond either border the outermost value holds. [s]
    response_s : float
        Time constant of the first-order lag; 0 for none. It starts settled. [s]

    Returns
    -------
    array, shape of `values`
    """
    from scipy.signal import lfilter

    shifted = _shifted(values, lag_s / step)
    if response_s <= 0 or len(shifted) == 0:
        return shifted
    keep = float(np.exp(-step / response_s))
    settled = keep * shifted[:1]
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], shifted, axis=0, zi=settled)[0])


def _shifted(values: FloatArray, steps: float) -> FloatArray:
    """`values[i - steps]`, linear between samples."""
    n = len(values)
    if steps == 0 or n == 0:
        return np.array(values, dtype=np.float64)
    where = np.clip(np.arange(n) - steps, 0, n - 1)
    low = np.minimum(where.astype(np.intp), max(n - 2, 0))
    share = where - low
    share = share if values.ndim == 1 else share[:, None]
    high = np.minimum(low + 1, n - 1)
    return np.asarray((1.0 - share) * values[low] + share * values[high])
