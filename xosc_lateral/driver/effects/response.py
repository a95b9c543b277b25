"""How a driver answers to a quantity: when, and how slowly."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.autoregression import recur

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
    answer = _shifted(values, lag_s / step)
    if response_s <= 0 or len(answer) == 0:
        return answer
    keep = float(np.exp(-step / response_s))
    for column in answer.reshape(len(answer), -1).T:  # views: answered in place
        column[:] = recur(column[:1], (1.0 - keep) * column, np.array([keep]))[1:]
    return answer


def split_shift(steps: float) -> tuple[int, float]:
    """Row i of a series delayed by `steps` is ``(1 - share) * values[i + whole] + share * values[i + whole + 1]``.

    Returns
    -------
    whole : int
    share : float
        In [0, 1], the same for every row: rounding does not grow along the drive.
    """
    whole = math.floor(-steps)
    return whole, -steps - whole


def _shifted(values: FloatArray, steps: float) -> FloatArray:
    """`values[i - steps]`, linear between samples, as an array of its own."""
    n = len(values)
    whole, share = split_shift(steps)
    if n == 0 or whole == share == 0:
        return np.array(values, dtype=np.float64)
    result = np.empty(values.shape)
    first, last = min(max(-whole, 0), n), max(min(n - 1 - whole, n), 0)
    if first < last:
        result[first:last] = values[first + whole : last + whole]
        if share:
            result[first:last] *= 1.0 - share
            result[first:last] += share * values[first + whole + 1 : last + whole + 1]
    result[:first], result[max(last, first) :] = values[0], values[-1]
    return result
