"""The movement that no effect explains as an autoregression, and whitening by it, for generalised least squares.

Whitening is exact within each valid stretch (the first rows of a stretch use the lower-order predictors of the same
process, by stepping the Levinson recursion down) and treats stretches as independent. Every drive has an intercept of
its own, fixed or random; it is taken out by the same operator.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

MAX_REFLECTION = 0.999
"""Reflection coefficients are kept inside the unit circle: the process is stationary. [-]"""


@dataclass(frozen=True, eq=False, slots=True)
class Autoregression:
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
        """(1, -a_1, ..., -a_p) / sd: turns the process into white noise of variance 1."""
        return np.asarray(np.concatenate([[1.0], -self.lags[-1]]) / self.deviations[-1], dtype=np.float64)

    def simulate(self, n: int, rng: np.random.Generator, *, runs: int = 1) -> FloatArray:
        """Stationary sample paths, shape (runs, n)."""
        from scipy.signal import lfilter

        warm = 40 * self.order + 200
        noise = rng.normal(size=(runs, n + warm))
        return np.asarray(lfilter([1.0], self.polynomial, noise, axis=1)[:, warm:])

    def spectrum(self, frequency: FloatArray, step: float) -> FloatArray:
        """One-sided power density [unit^2 / Hz]."""
        angle = np.exp(-2j * np.pi * np.outer(frequency * step, np.arange(self.order + 1)))
        return np.asarray(2.0 * step / np.abs(angle @ self.polynomial) ** 2)


def moving_sum(weights: FloatArray, values: FloatArray) -> FloatArray:
    """sum_k weights[k] values[t - k], zeros before the start; shape of `values`, (n,) or (n, k)."""
    result = weights[0] * values
    for lag, weight in enumerate(weights[1:], start=1):
        result[lag:] += weight * values[:-lag]
    return np.asarray(result, dtype=np.float64)


def positions_in_stretch(valid: BoolArray) -> IntArray:
    """How many valid rows in a row came before each row; -1 where invalid."""
    rows = np.arange(len(valid))
    start = np.where(valid & ~np.concatenate([[False], valid[:-1]]), rows, 0)
    return np.where(valid, rows - np.maximum.accumulate(start), -1)


def fit_autoregression(values: FloatArray, valid: BoolArray, order: int) -> Autoregression:
    """Least squares over all rows that have `order` valid rows before them.

    Parameters
    ----------
    values : array, shape (n,)
        Mean about zero.
    valid : bool array, shape (n,)
    order : int
        Lowered when the stretches are too short for it.
    """
    position = positions_in_stretch(valid)
    while order > 1 and (position >= order).sum() < 20 * order:
        order -= 1
    rows = np.flatnonzero(position >= order)
    past = np.stack([values[rows - lag] for lag in range(1, order + 1)], axis=1)
    now = values[rows]
    gram = past.T @ past
    gram[np.diag_indices(order)] *= 1.0 + 1e-9
    lags = np.linalg.solve(gram, past.T @ now)
    variance = float(np.mean((now - past @ lags) ** 2)) * len(rows) / max(1, len(rows) - order)
    return _stepped_down(np.asarray(lags, dtype=np.float64), max(variance, 1e-300))


def _stepped_down(lags: FloatArray, variance: float) -> Autoregression:
    """All lower-order predictors, by the Levinson recursion backwards, then forwards from safe reflections."""
    reflections = []
    current = lags.copy()
    for order in range(len(lags), 0, -1):
        last = float(np.clip(current[order - 1], -MAX_REFLECTION, MAX_REFLECTION))
        reflections.append(last)
        current = (current[: order - 1] + last * current[order - 2 :: -1][: order - 1]) / (1.0 - last**2)
    predictors: list[FloatArray] = [np.zeros(0)]
    shares = [1.0]
    for last in reversed(reflections):
        before = predictors[-1]
        predictors.append(np.concatenate([before - last * before[::-1], [last]]))
        shares.append(shares[-1] * (1.0 - last**2))
    deviations = np.sqrt(variance * np.asarray(shares) / shares[-1])
    return Autoregression(tuple(predictors), deviations)


@dataclass(frozen=True, eq=False, slots=True)
class Whitener:
    """Turns series on the grid into independent rows of variance 1, intercepts taken out.

    Parameters
    ----------
    process : Autoregression
        Of the movement divided by `scale`.
    valid : bool array, shape (n,)
    drive : int array, shape (n,)
        Which intercept a row has.
    scale : array, shape (n,)
        Factor on the movement at each row.
    intercept_variance : float
        Variance of the drives' intercepts; infinite: fixed effects. [unit^2]
    """

    process: Autoregression
    valid: BoolArray
    drive: IntArray
    scale: FloatArray
    intercept_variance: float = np.inf

    def white(self, values: FloatArray) -> FloatArray:
        """Whitened, intercepts still in; 0 at invalid rows; shape of `values`, (n,) or (n, k)."""
        scale = self.scale if values.ndim == 1 else self.scale[:, None]
        scaled = values / scale
        result = moving_sum(self.process.polynomial, scaled)
        position = positions_in_stretch(self.valid)
        for order in range(self.process.order):
            rows = np.flatnonzero(position == order)
            error = scaled[rows].copy()
            for lag, coefficient in enumerate(self.process.lags[order], start=1):
                error -= coefficient * scaled[rows - lag]
            result[rows] = error / self.process.deviations[order]
        result[~self.valid] = 0.0
        return np.asarray(result)

    def adjoint(self, rows: FloatArray) -> FloatArray:
        """Transpose of `white`: rows . white(x) == adjoint(rows) . x; shape (n,)."""
        position = positions_in_stretch(self.valid)
        full = np.where(position >= self.process.order, rows, 0.0)
        result = moving_sum(self.process.polynomial, full[::-1])[::-1].copy()
        for order in range(self.process.order):
            at = np.flatnonzero(position == order)
            weight = rows[at] / self.process.deviations[order]
            result[at] += weight
            for lag, coefficient in enumerate(self.process.lags[order], start=1):
                result[at - lag] -= coefficient * weight
        return np.asarray(result / self.scale)

    def without_intercepts(self, white: FloatArray) -> FloatArray:
        """Take the drives' intercepts out of whitened rows, wholly (fixed) or as far as they are known (random)."""
        ones = self.white(np.ones(len(self.valid)))
        groups = int(self.drive.max()) + 1
        power = np.bincount(self.drive, ones**2, minlength=groups)
        share = (
            np.ones(groups)
            if np.isinf(self.intercept_variance)
            else 1.0 - 1.0 / np.sqrt(1.0 + self.intercept_variance * power)
        )
        columns = white[:, None] if white.ndim == 1 else white
        result = np.empty_like(columns)
        for index in range(columns.shape[1]):
            mean = np.bincount(self.drive, ones * columns[:, index], minlength=groups) / np.maximum(power, 1e-300)
            result[:, index] = columns[:, index] - ones * (share * mean)[self.drive]
        return result[:, 0] if white.ndim == 1 else result

    def rows(self, values: FloatArray) -> FloatArray:
        """Whitened, intercepts out; shape of `values`."""
        return self.without_intercepts(self.white(values))
