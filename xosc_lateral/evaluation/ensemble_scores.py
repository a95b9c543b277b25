"""Proper scores of whole windows: energy and variogram score of an ensemble beside what was driven."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.errors import NotEnoughDataError

FloatArray = NDArray[np.float64]

PROPER = {"energy_score": "m", "variogram_score": "m"}
"""Proper scores and their units."""

ORDER = 0.5
"""Of the variogram score: the power that its authors found most sensitive to dependence. [-]"""


def energy_score(real: FloatArray, ensemble: FloatArray) -> FloatArray:
    """Energy score of each window: a proper score, lowest on average for the truth.

    Parameters
    ----------
    real : array, shape (n, m)
        What was driven. [m]
    ensemble : array, shape (n, k, m)
        k sampled windows for each, k >= 2. [m]

    Returns
    -------
    array, shape (n,)
        Mean distance to the real window minus half the mean distance among the sampled ones; unbiased for small
        ensembles. [m]

    References
    ----------
    .. [1] T. Gneiting, A. E. Raftery, "Strictly Proper Scoring Rules, Prediction, and Estimation", JASA 102, 2007,
       section 4.3.
    """
    import scoringrules

    _check(ensemble)
    return np.asarray(scoringrules.es_ensemble(real, ensemble, estimator="fair"), dtype=np.float64)


def variogram_score(real: FloatArray, ensemble: FloatArray, *, every: int = 5) -> FloatArray:
    """Variogram score of each window: sees how values depend on one another, where the energy score is dull.

    Parameters
    ----------
    real, ensemble : array, shape (n, m) and (n, k, m)
        As in `energy_score`. [m]
    every : int
        Steps between the values that are paired: all pairs of a window of 51 values would be 2601.

    Returns
    -------
    array, shape (n,)
        Mean over the pairs. [m]

    References
    ----------
    .. [1] M. Scheuerer, T. M. Hamill, "Variogram-Based Proper Scoring Rules for Probabilistic Forecasts of Multivariate
       Quantities", Monthly Weather Review 143, 2015: order 0.5.
    """
    import scoringrules

    _check(ensemble)
    thin, members = real[:, ::every], ensemble[:, :, ::every]
    pairs = thin.shape[1] ** 2
    return np.asarray(scoringrules.vs_ensemble(thin, members, p=ORDER, estimator="fair") / pairs, dtype=np.float64)


def proper_scores(real: FloatArray, ensemble: FloatArray) -> dict[str, float]:
    """Mean of each score in `PROPER` over the windows; empty without the extra `board`. [m]

    `real` of shape (n, m), `ensemble` of shape (n, members, m).
    """
    try:
        scores = energy_score(real, ensemble), variogram_score(real, ensemble)
    except ImportError:
        return {}
    return {name: float(score.mean()) for name, score in zip(PROPER, scores, strict=True)}


def _check(ensemble: FloatArray) -> None:
    if ensemble.shape[1] < 2:
        raise NotEnoughDataError(f"{ensemble.shape[1]} sampled window for each real one; two are needed for a score")
