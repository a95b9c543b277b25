"""Least squares with errors that are robust against what rows of a cluster share.

References
----------
.. [1] K.-Y. Liang, S. L. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986.
.. [2] B. H. Baltagi, "Econometric Analysis of Panel Data", sections 2.3 and 2.4.2: random effects by a quasi-demeaned
   regression; errors clustered by individual.
.. [3] D. Cochrane, G. H. Orcutt, "Application of least squares regression to relationships containing auto-correlated
   error terms", J. American Statistical Association 44, 1949.
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


def random_effects_least_squares(
    design: FloatArray, observed: FloatArray, group: IntArray
) -> tuple[FloatArray, FloatArray]:
    """The same with an intercept, which is not given, and a random level of each group 0, 1, 2 ... [2]_."""
    design = np.column_stack([np.ones(len(observed)), design])
    counts = np.bincount(group).astype(np.float64)
    rest = observed - design @ np.linalg.lstsq(design, observed, rcond=None)[0]
    means = np.bincount(group, rest) / counts
    within = float(((rest - means[group]) ** 2).sum() / max(len(rest) - len(counts), 1))
    between = max(float(rest.var()) - within, 0.0)
    theta = (1.0 - np.sqrt(within / (within + counts * between + 1e-30)))[group]
    columns = [column - theta * (np.bincount(group, column) / counts)[group] for column in (*design.T, observed)]
    slopes, covariance = clustered_least_squares(np.column_stack(columns[:-1]), columns[-1], group)
    return slopes[1:], covariance[1:, 1:]


MAXIMUM_AUTOCORRELATION = 0.95
"""Most that one row may say of the next: beyond, next to nothing of a level is left after differencing. [-]"""


def autoregressive_least_squares(table: FloatArray, group: IntArray, block: IntArray) -> tuple[FloatArray, FloatArray]:
    """Slopes of a table's first column by the others, within groups, and their errors, shape (k,) each.

    Generalised least squares of an autoregression from row to row [3]_, errors clustered by block. Rows of shape
    (n, k + 1) lie in the order of time; `block`, shape (n, 2): number of a row's series, and of its block in there. The
    slope of what does not vary is 0, its error infinite.
    """
    follows = np.flatnonzero(block[1:, 0] == block[:-1, 0]) + 1
    groups, plain = len(np.unique(group)), _centred(table, group)
    rest = plain[:, 0] - plain[:, 1:] @ (np.linalg.pinv(plain[:, 1:]) @ plain[:, 0])
    power = float(rest[follows - 1] @ rest[follows - 1])
    keep = min(max(float(rest[follows] @ rest[follows - 1]) / max(power, 1e-12), 0.0), MAXIMUM_AUTOCORRELATION)
    # a slow drift is separated from what the columns do
    table = _centred(table[follows] - keep * table[follows - 1], group[follows])
    observed, design = table[:, 0], table[:, 1:]
    distinct, cluster = np.unique(block[follows], axis=0, return_inverse=True)
    slopes, covariance = clustered_least_squares(design, observed, cluster.ravel())
    blocks, free = len(distinct), max(len(observed) - groups - design.shape[1], 1)
    covariance *= blocks / max(blocks - 1, 1) * len(observed) / free
    known = np.diag(design.T @ design) > 1e-6
    errors = np.where(known & (blocks > 2), np.sqrt(np.maximum(np.diag(covariance), 0.0)), np.inf)
    return np.where(known, slopes, 0.0), errors


def _centred(table: FloatArray, groups: IntArray) -> FloatArray:
    """Columns without their mean within each group."""
    counts = np.maximum(np.bincount(groups), 1)
    return np.stack([column - (np.bincount(groups, column) / counts)[groups] for column in table.T], axis=1)


def cluster_sums(rows: FloatArray, cluster: IntArray) -> FloatArray:
    """Sums of rows, shape (n, k), over each cluster 0, 1, 2 ..., shape (clusters, k)."""
    if rows.shape[1] == 0:
        return np.zeros((int(cluster.max(initial=-1)) + 1, 0))
    return np.column_stack([np.bincount(cluster, column) for column in rows.T])


def small_sample_factor(clusters: int, rows: int, parameters: int) -> float:
    """By which the sandwich of so many clusters and rows is too small, as Stata and statsmodels correct it. [-]"""
    return clusters / max(1, clusters - 1) * (rows - 1) / max(1, rows - parameters)
