"""The fit of all terms of the model together.

Mean terms are fitted jointly by generalised least squares, scale terms by iterated regression of squared innovations
[1]_: adding a term corrects the ones found before.

References
----------
.. [1] M. Aitkin, "Modelling variance heterogeneity in normal regression using GLIM", Applied Statistics 36, 1987.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.drivers.fitting.regression import clustered_least_squares, small_sample_factor
from xosc_lateral.drivers.loop.autocorrelation import Whitener, fit_autoregression, start_factors, unbiased
from xosc_lateral.drivers.loop.model import CLIP, MAXIMUM_ORDER, ORDER, Fitted, Term, joined, own_levels
from xosc_lateral.drivers.loop.timeline import CLUSTER_S, Coarse, means_by_drive

# White noise that the model of a drive has beside what it shows: no table knows the lane better (in the motorway
# recording the standard error of a lane's centre is 0.03 m; docs/real_data.md). Providers smooth their tracks,
# responses and all; without this noise an effect is sized where the smoothing left nothing of it. [m]
MEASUREMENT_NOISE = 0.03
# Scale terms together change the movement by at most this factor's logarithm, 20 either way: scoring steps of a factor
# that the movement contradicts grow without end. [-]
MOST_LOG_SCALE = 3.0
ROUNDS = 4  # Turns of sizes, autoregression and scale; they settle in three.


def design_of(coarse: Coarse, terms: Sequence[Term]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Columns of the mean and of the log scale, shape (n, k) and (n, j), and the log scale known as a whole."""
    columns = joined([term.mean_columns(coarse) for term in terms], len(coarse))
    scales = joined([term.scale_columns(coarse) for term in terms], len(coarse))
    known = [scale for term in terms if (scale := term.known_scale(coarse)) is not None]
    return columns, scales, np.sum(known, axis=0) if known else np.zeros(len(coarse))


def fit_model(coarse: Coarse, terms: Sequence[Term]) -> Fitted:
    """Fit all terms jointly: generalised least squares and the autoregression by turns."""
    columns, scales, known = design_of(coarse, terms)
    valid, drive = coarse.valid, coarse.drive
    sizes, log_sizes = np.zeros(columns.shape[1]), np.zeros(scales.shape[1])
    levels, spread = coarse.by_drive(coarse.offset), np.ones(coarse.drives)
    for _ in range(ROUNDS):
        scale = np.exp(scales @ log_sizes + known) * spread[drive]
        movement = np.where(valid, (coarse.offset - columns @ sizes - levels[drive]) / scale, 0.0)
        process = fit_autoregression(movement, valid, ORDER, longest=MAXIMUM_ORDER, noise=MEASUREMENT_NOISE)
        if not coarse.lasts:
            process = unbiased(process, valid, drive, ORDER, longest=MAXIMUM_ORDER)
        whitener = Whitener(process, valid, drive, scale)
        observed, design = whitener.rows(coarse.offset), whitener.rows(columns)
        sizes, covariance = _sizes_of(design, observed, coarse.cluster)
        rows = observed - design @ sizes
        levels = whitener.levels(coarse.offset - columns @ sizes)
        if scales.shape[1]:
            log_sizes = bounded(log_sizes + scoring_step(scales, rows, valid, drive), scales[valid])
        spread = spread * np.sqrt(own_levels(clipped_squares(rows, valid), valid, drive))
    starts = start_factors(rows, valid, process.order)
    factor = whitener.by_position(starts)
    densities = -0.5 * np.square(rows / factor) - np.log(factor * whitener.deviations)
    return Fitted(
        coarse=coarse,
        terms=tuple(terms),
        whitener=whitener,
        columns=columns,
        sizes=sizes,
        covariance=covariance,
        levels=levels,
        log_sizes=log_sizes,
        log_covariance=covariance_of_log_sizes(scales, rows, valid, drive),
        movement=np.where(valid, coarse.offset - columns @ sizes - levels[drive], 0.0) / scale,
        starts=starts,
        log_likelihood=float(np.sum(densities[valid])),
    )


def _sizes_of(design: FloatArray, observed: FloatArray, cluster: IntArray) -> tuple[FloatArray, FloatArray]:
    """Sizes, shape (k,), and their covariance, shape (k, k), clustered: loud seconds come in groups, as columns do."""
    sizes, covariance = clustered_least_squares(design, observed, cluster)
    clusters = len(np.unique(cluster[design.any(axis=1)]))
    return sizes, covariance * small_sample_factor(clusters, *design.shape)


def clipped_squares(rows: FloatArray, valid: BoolArray) -> FloatArray:
    """Squares over their mean where valid, at most `CLIP`, shape (n,). [-]"""
    return np.asarray(np.minimum(np.square(rows) / max(float(np.mean(rows[valid] ** 2)), 1e-300), CLIP))


def _within_drives(scales: FloatArray, valid: BoolArray, drive: IntArray) -> FloatArray:
    """Valid rows of the scale's columns about their drive's mean."""
    means = np.stack([means_by_drive(column, valid, drive) for column in scales.T], axis=1)
    return np.asarray((scales - means[drive])[valid])


def scoring_step(scales: FloatArray, rows: FloatArray, valid: BoolArray, drive: IntArray) -> FloatArray:
    """One Fisher-scoring step [-], shape (j,), for log sd = scales . sizes (variance of a squared normal is 2)."""
    squares, design = clipped_squares(rows, valid)[valid], _within_drives(scales, valid, drive)
    return np.asarray(np.linalg.pinv(2.0 * design.T @ design) @ (design.T @ (squares / squares.mean() - 1.0)))


def bounded(log_sizes: FloatArray, scales: FloatArray) -> FloatArray:
    """Log sizes [-], shape (j,), scaled down as a whole so that no row's log scale is beyond `MOST_LOG_SCALE`."""
    reach = float(np.max(np.abs(scales @ log_sizes), initial=0.0))
    return log_sizes * min(1.0, MOST_LOG_SCALE / max(reach, 1e-300))


def covariance_of_log_sizes(scales: FloatArray, rows: FloatArray, valid: BoolArray, drive: IntArray) -> FloatArray:
    """Sandwich, clustered like that of the mean, shape (j, j): squares have heavy tails and come in clusters."""
    if scales.shape[1] == 0:
        return np.zeros((0, 0))
    design = _within_drives(scales, valid, drive)
    bread = np.linalg.pinv(2.0 * design.T @ design)
    squares = clipped_squares(rows, valid)[valid]
    scores = design * (squares / squares.mean() - 1.0)[:, None]
    edges = np.flatnonzero(np.diff(np.flatnonzero(valid) // CLUSTER_S, prepend=-1))
    sums = np.add.reduceat(scores, edges, axis=0)
    return np.asarray(bread @ (sums.T @ sums) @ bread * len(sums) / max(1, len(sums) - 1))
