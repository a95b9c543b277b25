"""Ordinary least squares of whitened rows, with errors that hold beside what whitening left."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


def clustered_least_squares(
    design: FloatArray, observed: FloatArray, cluster: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Sizes, and a sandwich for their covariance, clustered [1]_.

    Loud seconds come together, and a column may come with them; and what whitening leaves of the memory counts too.

    Parameters
    ----------
    design : array, shape (n, k)
        Whitened columns.
    observed : array, shape (n,)
        Whitened.
    cluster : int array, shape (n,)
        Cluster of each row.

    Returns
    -------
    sizes : array, shape (k,)
    covariance : array, shape (k, k)

    References
    ----------
    .. [1] K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986.
    """
    if design.shape[1] == 0:
        return np.zeros(0), np.zeros((0, 0))
    inverse = np.linalg.pinv(design.T @ design)
    sizes = inverse @ (design.T @ observed)
    scores = design * (observed - design @ sizes)[:, None]
    scores = np.stack([np.bincount(cluster, column) for column in scores.T], axis=1)
    clusters = int(np.count_nonzero(scores.any(axis=1)))
    freedom = clusters / max(1, clusters - 1) * (len(observed) - 1) / max(1, len(observed) - design.shape[1])
    return sizes, np.asarray(inverse @ (scores.T @ scores) @ inverse * freedom, dtype=np.float64)
