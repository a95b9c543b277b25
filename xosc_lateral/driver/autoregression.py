"""Linear prediction of a series from its past: fitted to drivers of unlike size, kept stable, its spectrum known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.compiled import Loop
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]

MAX_ROOT = 0.995
"""Largest modulus of a root: at one step a second a memory of 200 s. [-]"""

RIDGE = 1e-7
"""Share of the mean square that is added to the normal equations' diagonal. [-]"""

ROUNDS = 3
"""Rounds of reweighting. [-]"""

GRID = 8192
"""Points of the spectrum that covariances are taken from: at MAX_ROOT nothing is left after so many steps."""


@dataclass(frozen=True, eq=False, slots=True)
class Autoregression:
    """z[t] = sum over k of coefficients[k] z[t - 1 - k] + scale * noise[t], noise white with variance 1.

    Raises
    ------
    DriverProfileError
        If it is not stable, or the scale is negative.
    """

    coefficients: FloatArray
    scale: float

    def __post_init__(self) -> None:
        """Check, copy and freeze."""
        coefficients = np.array(self.coefficients, dtype=np.float64)
        if coefficients.ndim != 1 or not np.isfinite(coefficients).all() or not 0 <= self.scale < np.inf:
            raise DriverProfileError(f"autoregression: {coefficients.tolist()}, scale {self.scale}")
        root = float(np.abs(_roots(coefficients)).max(initial=0.0))
        if root >= 1.0:
            raise DriverProfileError(f"autoregression: a root of modulus {root:.4f} makes it unstable")
        coefficients.flags.writeable = False
        object.__setattr__(self, "coefficients", coefficients)

    @property
    def order(self) -> int:
        """Steps of memory."""
        return len(self.coefficients)

    def power(self, frequency: FloatArray) -> FloatArray:
        """Spectral density at frequencies in cycles per step; white noise of variance 1 has 1 everywhere."""
        lags = np.arange(1, self.order + 1)
        gain = 1.0 - np.exp(-2j * np.pi * np.outer(frequency, lags)) @ self.coefficients
        return np.asarray(self.scale**2 / np.abs(gain) ** 2)

    def covariance(self, n_lags: int) -> FloatArray:
        """Autocovariance at lags 0 to n_lags - 1 steps."""
        power = self.power(np.arange(GRID // 2 + 1) / GRID)
        return np.asarray(np.fft.irfft(power, GRID)[:n_lags])


def fit_autoregression(runs: Sequence[FloatArray], order: int, *, every: int, drivers: Sequence[str]) -> Autoregression:
    """Fit by least squares, each equation divided by its driver's mean square residual.

    A driver who moves twice as much as the others would count four times, so each is measured by his own size. Within a
    driver all moments count the same: whoever corrects only what is too far off moves calmly while he drifts away and
    briskly while he comes back. Weights by how calm a moment is drop his returns, and the rest is an endless wander.

    Parameters
    ----------
    runs : sequence of array
        Series with the mean taken out.
    order : int
    every : int
        One step of the model in samples of the runs.
    drivers : sequence of str
        Whose each run is.

    Returns
    -------
    Autoregression
        Its scale is the geometric mean of the drivers' residuals.
    """
    long = [(run, driver) for run, driver in zip(runs, drivers, strict=True) if len(run) > every * order + every]
    pasts = [np.stack([run[every * (order - 1 - k) : len(run) - every * (k + 1)] for k in range(order)], axis=1)
             for run, _ in long]  # fmt: skip
    nexts = [run[every * order :] for run, _ in long]
    whose = np.unique([driver for _, driver in long], return_inverse=True)[1]
    counts = np.bincount(whose, [len(y) for y in nexts])
    smallest = 1e-12 * float(np.mean([np.mean(y**2) for y in nexts])) + 1e-300
    coefficients: FloatArray = np.zeros(order)
    variances = np.ones(len(counts))
    for _ in range(ROUNDS + 1):
        normal, right = np.zeros((order, order)), np.zeros(order)
        for past, value, variance in zip(pasts, nexts, variances[whose], strict=True):
            normal += past.T @ past / variance
            right += past.T @ value / variance
        normal += RIDGE * np.trace(normal) / order * np.eye(order)
        coefficients = np.asarray(np.linalg.solve(normal, right), dtype=np.float64)
        squares = [float(np.sum((y - past @ coefficients) ** 2)) for past, y in zip(pasts, nexts, strict=True)]
        variances = np.bincount(whose, squares) / counts + smallest
    scale = float(np.exp(0.5 * np.average(np.log(variances), weights=counts)))
    return Autoregression(stabilise(coefficients), scale)


def stabilise(coefficients: FloatArray, largest: float = MAX_ROOT) -> FloatArray:
    """Coefficients whose roots lie within the given modulus: those beyond are pulled in along their own direction."""
    roots = _roots(coefficients)
    modulus = np.abs(roots)
    if modulus.max(initial=0.0) <= largest:
        return coefficients
    pulled = np.where(modulus > largest, roots * (largest / np.maximum(modulus, 1e-300)), roots)
    return np.asarray(-np.real(np.poly(pulled))[1:])


def _roots(coefficients: FloatArray) -> NDArray[np.complex128]:
    return np.roots(np.concatenate([[1.0], -coefficients])).astype(np.complex128)


def _recur_body(noise, coefficients, order, series):  # type: ignore[no-untyped-def]
    # series: the last `order` values first, then room for one value per noise
    if order == 1:  # the same sum, three times as fast: the last value stays in a register
        value, keep = series[0], coefficients[0]
        for t in range(len(noise)):
            value = noise[t] + keep * value
            series[t + 1] = value
        return
    for t in range(len(noise)):
        value = noise[t]
        for k in range(order):
            value += coefficients[k] * series[t + order - 1 - k]
        series[t + order] = value


_recur = Loop(_recur_body)


def recur(past: FloatArray, noise: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Run on from the past, shape (order,), by one value per noise, shape (n,), its scale included.

    Returns
    -------
    array, shape (order + n,)
        The past and the new values.
    """
    order = len(coefficients)
    series = np.empty(order + len(noise))
    series[:order] = past
    _recur(len(noise) * max(1, order // 4), (noise, coefficients, order), (series,))
    return series
