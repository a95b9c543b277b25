"""The movement that no effect explains as an autoregression on the last seconds and on means of longer stretches.

A heterogeneous autoregression [1]_ knows the wander of a minute with few parameters; its lower-order predictors, for
the first rows of a run, come from the Levinson recursion stepped down [2]_.

References
----------
.. [1] F. Corsi, "A simple approximate long-memory model of realized volatility", J. Financial Econometrics 7, 2009.
.. [2] P. Brockwell, R. Davis, "Time Series: Theory and Methods", 1991, section 5.2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

MAX_REFLECTION = 0.999
"""Reflection coefficients are kept inside the unit circle: the process is stationary. [-]"""


@dataclass(frozen=True, eq=False)
class MovementProcess:
    """x_t = sum_k a_k x_{t-k} + sd * white.

    Parameters
    ----------
    lags : tuple of array
        Coefficients of the best predictors from 0, 1, ... p past values; the last one is the process itself.
    deviations : array, shape (p + 1,)
        Standard deviation of each predictor's error.
    """

    lags: tuple[FloatArray, ...]
    deviations: FloatArray

    @property
    def order(self) -> int:
        """Number of past values, p."""
        return len(self.lags) - 1

    @property
    def polynomial(self) -> FloatArray:
        """(1, -a_1, ..., -a_p) / sd, shape (p + 1,): turns the process into white noise of variance 1. [1/m]"""
        return np.asarray(np.concatenate([[1.0], -self.lags[-1]]) / self.deviations[-1], dtype=np.float64)

    @cached_property
    def start(self) -> FloatArray:
        """Whitening of the first p rows of a run, lower triangular, shape (p, p). [1/m]"""
        matrix = np.zeros((self.order, self.order))
        for row in range(self.order):
            matrix[row, row] = 1.0
            matrix[row, :row] = -self.lags[row][::-1]
            matrix[row] /= self.deviations[row]
        return matrix

    def simulate(self, n: int, rng: np.random.Generator, *, runs: int = 1) -> FloatArray:
        """Stationary sample paths, shape (runs, n). [m]"""
        from scipy.signal import lfilter

        warm = 20 * self.order + 200
        noise = rng.normal(size=(runs, n + warm))
        return np.asarray(lfilter([1.0], self.polynomial, noise, axis=1)[:, warm:])


def positions_in_run(valid: BoolArray) -> IntArray:
    """How many valid rows in a row came before each row, shape (n,); -1 where invalid. [-]"""
    rows = np.arange(len(valid))
    start = np.where(valid & ~np.concatenate([[False], valid[:-1]]), rows, 0)
    return np.where(valid, rows - np.maximum.accumulate(start), -1)


def moving_sum(weights: FloatArray, values: FloatArray) -> FloatArray:
    """sum_k weights[k] values[t - k], zeros before the start; shape and precision of `values`, (n,) or (n, k)."""
    from scipy.signal import oaconvolve

    weights = weights.astype(values.dtype)
    if values.ndim == 2 and values.shape[1] == 0:
        return np.zeros(values.shape)
    if len(weights) > 16 and len(values) > len(weights):
        series = np.ascontiguousarray(np.atleast_2d(values.T))
        return np.asarray(oaconvolve(series, weights[None], axes=1)[:, : len(values)].T.reshape(values.shape))
    result = weights[0] * values
    for lag, weight in enumerate(weights[1:], start=1):
        result[lag:] += weight * values[:-lag]
    return np.asarray(result)


def reflections(lags: FloatArray) -> FloatArray:
    """Reflection coefficients of a predictor, both of shape (order,), first to last, inside the unit circle. [-]

    The Levinson recursion backwards [2]_.
    """
    found = []
    current = lags.copy()
    for order in range(len(lags), 0, -1):
        last = float(np.clip(current[order - 1], -MAX_REFLECTION, MAX_REFLECTION))
        found.append(last)
        current = (current[: order - 1] + last * current[order - 2 :: -1][: order - 1]) / (1.0 - last**2)
    return np.array(found[::-1])


def stepped_down(lags: FloatArray, variance: float) -> MovementProcess:
    """The process of a predictor [-], shape (order,), with all of lower order: forwards from safe reflections.

    `variance` of what the predictor leaves. [square of the unit]
    """
    predictors: list[FloatArray] = [np.zeros(0)]
    shares = [1.0]
    for last in reflections(lags):
        before = predictors[-1]
        predictors.append(np.concatenate([before - last * before[::-1], [last]]))
        shares.append(shares[-1] * (1.0 - last**2))
    deviations = np.sqrt(variance * np.asarray(shares) / shares[-1])
    return MovementProcess(tuple(predictors), deviations)
