"""Least squares with errors that are robust against what rows of a cluster share.

References
----------
.. [1] K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986.
"""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray


def clustered_least_squares(
    design: FloatArray, observed: FloatArray, cluster: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Slopes, shape (k,), and a sandwich for their covariance, shape (k, k), not corrected for small samples.

    `design`, shape (n, k), and `observed`, shape (n,): white but for what a cluster shares; `cluster`, shape (n,): of
    each row, 0, 1, 2 ...
    """
    inverse = np.linalg.pinv(design.T @ design)
    slopes = inverse @ (design.T @ observed)
    scores = cluster_sums(design * (observed - design @ slopes)[:, None], cluster)
    return slopes, np.asarray(inverse @ (scores.T @ scores) @ inverse)


def cluster_sums(rows: FloatArray, cluster: IntArray) -> FloatArray:
    """Sums of rows, shape (n, k), over each cluster 0, 1, 2 ..., shape (clusters, k)."""
    if rows.shape[1] == 0:
        return np.zeros((int(cluster.max(initial=-1)) + 1, 0))
    return np.column_stack([np.bincount(cluster, column) for column in rows.T])


def small_sample_factor(clusters: int, rows: int, parameters: int) -> float:
    """By which the sandwich of so many clusters and rows is too small, as Stata and statsmodels correct it. [-]"""
    return clusters / max(1, clusters - 1) * (rows - 1) / max(1, rows - parameters)
