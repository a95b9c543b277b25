"""Linear prediction fitted to drivers of unlike size, by least squares."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.models.autoregressive.autoregression import Autoregression, stabilise

FloatArray = NDArray[np.float64]

RIDGE = 1e-7
"""Share of the mean square that is added to the normal equations' diagonal. [-]"""

LEAST_RESIDUAL = 0.1
"""Share of a driver's mean square residual that his mean never takes. [-]"""

WILD = 9.0
"""Mean square residual over the median driver's beyond which a driver is wild: three times as far. Drivers on a
motorway differ by less (standard deviation of the logarithm 0.3, so that 1 in 10 000 is). [-]"""

PASSES = 2
"""The first finds the drivers' sizes, the second is weighted by them. [-]"""


def fit_autoregression(
    runs: Sequence[FloatArray], order: int, *, every: int, drivers: Sequence[str], between: float = 0.0
) -> Autoregression:
    """Fit by least squares, all moments alike but those of wild drivers, who are measured by their own size.

    Weights by how calm a moment is would drop the return of whoever drifts calmly and corrects briskly, and the rest is
    an endless drift.

    Drivers' own means are a random effect of variance `between`: it is taken out of the normal equations, where it adds
    the same to every product. Taking each driver's estimated mean out of his runs instead would take slow movement with
    it, and a run of a minute would then forget twice too fast.

    Parameters
    ----------
    runs : sequence of array, shape (n_i,)
        Series with the mean of all taken out. [any unit]
    order : int
        >= 1.
    every : int
        One step of the model in samples of the runs.
    drivers : sequence of str
        Whose each run is.
    between : float
        Variance of the drivers' own means.

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
    variances = np.ones(len(counts))
    coefficients: FloatArray = np.zeros(order)
    for _ in range(PASSES):
        # Only outliers are weighed: what a calm driver's short run shows of his memory is biased by what made it calm.
        usual = np.median(variances)
        sizes = np.where(variances > WILD * usual, variances, usual)
        normal, right = np.zeros((order, order)), np.zeros(order)
        for past, value, size in zip(pasts, nexts, sizes[whose], strict=True):
            normal += (past.T @ past - len(value) * between) / size
            right += (past.T @ value - len(value) * between) / size
        normal += RIDGE * np.trace(normal) / order * np.eye(order)
        coefficients = np.asarray(np.linalg.solve(normal, right), dtype=np.float64)
        squares = [float(np.sum((y - past @ coefficients) ** 2)) for past, y in zip(pasts, nexts, strict=True)]
        raw = np.bincount(whose, squares) / counts
        own = between * (1.0 - coefficients.sum()) ** 2  # what the drivers' means leave in the residual
        variances = np.maximum(raw - own, LEAST_RESIDUAL * raw) + smallest
    scale = float(np.exp(0.5 * np.average(np.log(variances), weights=counts)))
    return Autoregression(stabilise(coefficients), scale)
