"""A Gaussian process with the measured autocovariance: all that second moments can say.

References
----------
.. [1] C. E. Rasmussen, C. K. I. Williams, "Gaussian Processes for Machine Learning", 2006, eqs. 2.19, 4.9 and 4.17.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from laboratory.board.models.batch import SegmentBatch
from laboratory.board.models.calibration import Bounds, calibrate
from laboratory.board.models.calibration_targets import distance_to, targets_of
from laboratory.board.models.simulated import SimulatedModel
from xosc_lateral.drivers.drives.drive import STEP, Run

FloatArray = NDArray[np.float64]

SCALES = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Length scales of the kernels that the covariance is put together from. [s]"""
LONGEST_LAG = 30.0
"""Up to which the variogram is compared. [s]"""
JITTER = 1e-8
"""Added to the variance so that the factorisation holds: 0.1 mm. [m2]"""


@dataclass(frozen=True, eq=False, kw_only=True)
class GaussianProcess(SimulatedModel):
    """Stationary Gaussian offsets: a driver's own constant plus squared exponential and Matérn 3/2 kernels.

    Parameters
    ----------
    mean : float
        [m]
    constant : float
        Variance of the constants. [m2]
    variances : array, shape (16,)
        Of the squared exponential kernels with the length scales `SCALES`, then of the Matérn ones. [m2]
    """

    mean: float
    constant: float
    variances: FloatArray

    title: ClassVar[str] = "Gaussian process"
    source: ClassVar[str] = (
        "C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, "
        "eq. 2.19, 4.9 and 4.17, gaussianprocess.org/gpml"
    )
    departures: ClassVar[str] = (
        "the kernels' shares by least squares on the pooled variogram, not by likelihood; then the level of all, of "
        "the constants and of the rough kernels, and how the shares lean to long scales, as every model's free numbers"
    )

    @classmethod
    def fit(cls, runs: Sequence[Run]) -> Self:
        """Moments, then what is ranked (`calibrate`); moments alone where that is no nearer."""
        moments = cls.of_moments(runs)
        bounds = {
            "level": Bounds(0.3, 3.0),
            "constants": Bounds(0.1, 3.0),
            "rough": Bounds(1e-4, 3.0),
            "lean": Bounds(0.5, 2.0),
        }
        found = calibrate(lambda values: moments.moved(**values), bounds, runs)
        targets = targets_of(runs)
        return min((moments, found), key=lambda model: distance_to(targets, model, 1))

    @classmethod
    def of_moments(cls, runs: Sequence[Run]) -> Self:
        """Non-negative least squares on the pooled variogram, in relative terms: short lags count like long ones."""
        from scipy.optimize import nnls

        everything = np.concatenate([run.offset for run in runs])
        lags, variogram = pooled_variogram(runs)
        # One column a kernel, the last one for the constant, which no change over a lag can see.
        columns = np.pad(1.0 - np.column_stack(_kernels(lags)), ((0, 0), (0, 1))) / variogram[:, None]
        whole = np.full((1, columns.shape[1]), 1.0 / everything.var())  # all parts together are the offset's variance
        weight = float(len(lags))
        found, _ = nnls(np.vstack([columns, weight * whole]), np.append(np.ones(len(lags)), weight))
        return cls(mean=float(everything.mean()), constant=float(found[-1]), variances=found[:-1])

    def moved(self, *, level: float, constants: float, rough: float, lean: float) -> Self:
        """With factors on all variances, on the constants', on the Matérn ones, and for each doubling of scale."""
        leaning = lean ** np.log2(np.array(SCALES) / SCALES[len(SCALES) // 2])
        factors = level * np.concatenate([leaning, rough * leaning])
        return replace(self, constant=level * constants * self.constant, variances=factors * self.variances)

    def covariance(self, lags: FloatArray) -> FloatArray:
        """At time differences. [s] -> [m2] Shape as `lags`."""
        return np.asarray(self.constant + np.column_stack(_kernels(lags)) @ self.variances)

    def free_starts(self, n: int, rng: np.random.Generator) -> FloatArray:
        """As the process has them. Shape (n,). [m]"""
        spread = float(np.sqrt(self.covariance(np.zeros(1))[0]))
        return self.mean + spread * rng.standard_normal(n)

    def simulate(self, batch: SegmentBatch, rng: np.random.Generator) -> FloatArray:
        """Free paths, then moved onto their start by Matheron's rule: exact conditional samples. Shape (n, m). [m]"""
        from scipy.linalg import toeplitz

        n, m = batch.shape
        line = self.covariance(batch.step * np.arange(m, dtype=np.float64))
        factor = np.linalg.cholesky(toeplitz(line) + JITTER * np.eye(m))
        paths = self.mean + rng.standard_normal((n, m)) @ factor.T
        return np.asarray(paths + (batch.start - paths[:, 0])[:, None] * (line / line[0])[None])

    @property
    def settings(self) -> Mapping[str, float]:
        """Fitted numbers: total standard deviation [m], and the constants' share of the variance [-]."""
        total = float(self.constant + self.variances.sum())
        return {"spread_m": float(np.sqrt(total)), "constant_share": self.constant / total if total else 0.0}


def _kernels(lags: FloatArray) -> list[FloatArray]:
    smooth = [np.exp(-0.5 * (lags / scale) ** 2) for scale in SCALES]
    return [*smooth, *(matern(lags, scale) for scale in SCALES)]


def matern(lags: FloatArray, scale: float) -> FloatArray:
    """Matérn correlation of order 3/2. Shape as `lags` [s]. [-]"""
    r = np.sqrt(3.0) * np.abs(lags) / scale
    return np.asarray((1.0 + r) * np.exp(-r))


def pooled_variogram(runs: Sequence[Run]) -> tuple[FloatArray, FloatArray]:
    """Lags [s] and half the mean squared change over each [m2], over all runs; blind to every driver's own mean.

    Shape (lags,) each.
    """
    steps = range(1, round(LONGEST_LAG / STEP) + 1)
    squares, pairs = np.zeros(len(steps)), np.zeros(len(steps))
    for run in runs:
        for k in steps[: len(run) - 1]:
            change = run.offset[k:] - run.offset[:-k]
            squares[k - 1] += change @ change
            pairs[k - 1] += len(change)
    known = (pairs > 0) & (squares > 0)
    lags: FloatArray = STEP * (1.0 + np.flatnonzero(known).astype(np.float64))
    return lags, 0.5 * squares[known] / pairs[known]
