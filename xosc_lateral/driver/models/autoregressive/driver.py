"""Drivers drawn from the population that a model stands for.

References
----------
.. [1] D. B. Rubin, "Using the SIR algorithm to simulate posterior distributions", Bayesian Statistics 3, 1988.
"""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.parameters import AutoregressiveParameters
from xosc_lateral.driver.models.base import Start

FloatArray = NDArray[np.float64]

CANDIDATES = 64
"""Drivers that one is chosen from, by how likely each is at the offset to start at. [-]"""


class DriverState(msgspec.Struct):
    """What drivers keep for a whole drive, each of shape (drivers,).

    Parameters
    ----------
    mean : array
        What the coarse movement is about. [lane widths]
    coarse, fine : array
        Factors on the coarse and on the fine movement. [-]
    """

    mean: FloatArray
    coarse: FloatArray
    fine: FloatArray


def draw_drivers(model: AutoregressiveParameters, start: Start | None, rng: np.random.Generator, n: int) -> DriverState:
    """Draw n drivers from the population; given a start, each from those found there."""
    coarse_normal, fine_normal = rng.standard_normal((2, n, CANDIDATES))
    coarse = _factor(model.coarse_volatility.between, coarse_normal)
    mixed = model.correlation * coarse_normal + np.sqrt(1.0 - model.correlation**2) * fine_normal
    fine = _factor(model.fine_volatility.between, mixed)
    mean_normal, choice = rng.standard_normal(n), rng.random(n)
    if start is None:
        return DriverState(model.mean + model.between_drivers * mean_normal, coarse[:, 0].copy(), fine[:, 0].copy())
    between = model.between_drivers**2
    coarse_variance = (start.spread * coarse) ** 2 * model.coarse_covariance[0]
    moving = coarse_variance + (start.fine * fine) ** 2 * model.fine_covariance[0]
    away = np.broadcast_to(np.asarray(start.rel_offset) - model.mean, n)
    weight = np.cumsum(_likelihood(away[:, None], between + moving), axis=1)
    k = np.sum(weight < weight[:, -1:] * choice[:, None], axis=1)
    rows = np.arange(n)
    share = between / (between + moving[rows, k]) if between > 0.0 else np.zeros(n)
    mean = model.mean + share * away + np.sqrt(between * (1.0 - share)) * mean_normal
    return DriverState(mean, coarse[rows, k], fine[rows, k])


def _likelihood(away: FloatArray, variance: FloatArray) -> FloatArray:
    """Of a normal variable, relative to the likeliest candidate's; shape of `variance`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        log_weight = -0.5 * np.log(variance) - 0.5 * away**2 / variance
        relative = np.nan_to_num(log_weight - log_weight.max(axis=1, keepdims=True), nan=0.0)
    return np.asarray(np.exp(relative))


def _factor(variance: float, normal: FloatArray) -> FloatArray:
    """Log-normal factors of mean square 1."""
    return np.asarray(np.exp(np.sqrt(variance) * normal - variance))
