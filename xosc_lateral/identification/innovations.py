"""What is new in each second of the movement as the table shows it, and its squares: how large it is just now.

References
----------
.. [1] A. C. Harvey, "Estimating regression models with multiplicative heteroscedasticity", Econometrica 44, 1976.
.. [2] K.-Y. Liang, S. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986.
"""

from __future__ import annotations

import numpy as np

from xosc_lateral.identification.autocorrelation import Whitener, fit_autoregression, start_factors
from xosc_lateral.identification.timeline import CLUSTER_S, BoolArray, FloatArray, IntArray, means_by_drive

ORDER = 12  # Past seconds that have a coefficient each in the movement's autoregression. [s]
LONGEST = 96  # Past seconds that it sees as means over doubling times: drifts of a minute and a half. [s]
# Shifts of a response that make up its smoothing: two standard deviations, to either side, of a Gaussian that leaves
# 9 % at 0.5 Hz. [s]
SMOOTHING_S = (-2, -1, 1, 2)
CLIP = 9.0  # Squared innovations (variance 1) beyond this count as this: three standard deviations. [-]
# Scale terms together change the movement by at most this factor's logarithm, 20 either way: scoring steps of a factor
# that the movement contradicts grow without end. [-]
MOST_LOG_SCALE = 3.0
OWN_LEVEL_S = 30.0  # A drive's level of the scale is its own as far as it lasts longer than this. [s]


def own_levels(squares: FloatArray, valid: BoolArray, drive: IntArray) -> FloatArray:
    """Mean square of every drive over that of all, shape (drives,); 1 for a single drive, near 1 for short ones."""
    groups = int(drive.max()) + 1
    if groups == 1 or not valid.any():
        return np.ones(groups)
    relative = squares / max(float(squares[valid].mean()), 1e-300)
    seconds = np.bincount(drive, valid.astype(float), minlength=groups)
    sums = np.bincount(drive, np.where(valid, relative, 0.0), minlength=groups)
    return np.asarray((sums + OWN_LEVEL_S) / (seconds + OWN_LEVEL_S))


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
    """Sandwich, clustered [2]_, shape (j, j): squares have heavy tails and come in clusters."""
    if scales.shape[1] == 0:
        return np.zeros((0, 0))
    design = _within_drives(scales, valid, drive)
    bread = np.linalg.pinv(2.0 * design.T @ design)
    squares = clipped_squares(rows, valid)[valid]
    scores = design * (squares / squares.mean() - 1.0)[:, None]
    edges = np.flatnonzero(np.diff(np.flatnonzero(valid) // CLUSTER_S, prepend=-1))
    sums = np.add.reduceat(scores, edges, axis=0)
    return np.asarray(bread @ (sums.T @ sums) @ bread * len(sums) / max(1, len(sums) - 1))


def _whitener(movement: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray) -> Whitener:
    """What turns movement over scale, 0 where invalid, into independent rows as it is seen: without a floor."""
    return Whitener(fit_autoregression(movement, valid, ORDER, longest=LONGEST), valid, drive, scale)


def innovations(
    moved: FloatArray, responses: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray
) -> FloatArray:
    """White rows of variance about 1, shape (n,), young runs by their own size; 0 where invalid.

    `moved`, shape (n,): offset less levels [m]; `responses`, shape (n,): what columns did to it [m].
    """
    if np.any(responses):
        responses = smoothed_as_seen(moved, responses, valid, drive, scale)
    left = np.where(valid, moved - responses, 0.0)
    whitener = _whitener(left / scale, valid, drive, scale)
    rows = whitener.rows(left)
    return np.asarray(rows / whitener.by_position(start_factors(rows, valid, whitener.process.order)))


def smoothed_as_seen(
    moved: FloatArray, responses: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray
) -> FloatArray:
    """Responses, shape (n,), through the filter of five seconds and gain one that leaves least of them. [m]

    Least squares in the innovations of the movement with the responses in: a car and a provider of tracks smooth them,
    and taken out with their edges they would put these *in*, where next to nothing moves.
    """
    whitener = _whitener(np.where(valid, moved / scale, 0.0), valid, drive, scale)
    seconds = np.arange(len(responses))
    shifted = [responses[np.clip(seconds - shift, 0, len(seconds) - 1)] for shift in SMOOTHING_S]
    changes = np.stack(shifted, axis=1) - responses[:, None]
    weights = np.linalg.lstsq(whitener.rows(changes), whitener.rows(moved - responses), rcond=None)[0]
    return np.asarray(responses + changes @ weights)
