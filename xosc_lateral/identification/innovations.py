"""What is new in each second of the movement as the table shows it, and its squares: how large it is just now.

References
----------
.. [1] A. C. Harvey, "Estimating regression models with multiplicative heteroscedasticity", Econometrica 44, 1976.
.. [2] K.-Y. Liang, S. Zeger, "Longitudinal data analysis using generalized linear models", Biometrika 73, 1986.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.arrays import BoolArray, FloatArray, IndexArray
from xosc_lateral.identification.autocorrelation import (
    Problem,
    Whitener,
    fit_autoregression,
    moving_sum,
    start_factors,
)
from xosc_lateral.identification.timeline import COARSE, coarse_all, coarse_mean, means_by_drive

if TYPE_CHECKING:
    from xosc_lateral.identification.regression import Coarse, Fitted

ORDER = 12  # Past seconds that have a coefficient each in the movement's autoregression. [s]
LONGEST = 96  # Past seconds that it sees as means over doubling times: drifts of a minute and a half. [s]
# Shifts of a response that make up its smoothing: two standard deviations, to either side, of a Gaussian that leaves
# 9 % at 0.5 Hz. [s]
SMOOTHING_S = (-2, -1, 1, 2)
CLIP = 9.0  # Squared innovations (variance 1) beyond this count as this: three standard deviations. [-]
# Scale terms together change the movement by at most this factor's logarithm, 20 either way: scoring steps of a factor
# that the movement contradicts grow without end. [-]
MOST_LOG_SCALE = 3.0
CLUSTER_S = 60  # Length of one cluster of squares in errors of the log scale. [s]
OWN_LEVEL_S = 30.0  # A drive's level of the scale is its own as far as it lasts longer than this. [s]
FINE_ORDER = 15  # Past samples (3 s) that the fine movement's autoregression sees.
# Past seconds of the squares that whitening sees: two time constants of the clusters of 6 s that are no regime. Beyond
# `ORDER`, as means. [s]
SQUARES_S = 12
SLOW_S = 8  # Whitened seconds that are averaged for the slower movement: below 1/16 Hz. [s]


def own_levels(squares: FloatArray, valid: BoolArray, drive: IndexArray) -> FloatArray:
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


def _within_drives(scales: FloatArray, valid: BoolArray, drive: IndexArray) -> FloatArray:
    """Valid rows of the scale's columns about their drive's mean."""
    means = np.stack([means_by_drive(column, valid, drive) for column in scales.T], axis=1)
    return np.asarray((scales - means[drive])[valid])


def scoring_step(scales: FloatArray, rows: FloatArray, valid: BoolArray, drive: IndexArray) -> FloatArray:
    """One Fisher-scoring step [-], shape (j,), for log sd = scales . sizes (variance of a squared normal is 2)."""
    squares, design = clipped_squares(rows, valid)[valid], _within_drives(scales, valid, drive)
    return np.asarray(np.linalg.pinv(2.0 * design.T @ design) @ (design.T @ (squares / squares.mean() - 1.0)))


def bounded(log_sizes: FloatArray, scales: FloatArray) -> FloatArray:
    """Log sizes [-], shape (j,), scaled down as a whole so that no row's log scale is beyond `MOST_LOG_SCALE`."""
    reach = float(np.max(np.abs(scales @ log_sizes), initial=0.0))
    return log_sizes * min(1.0, MOST_LOG_SCALE / max(reach, 1e-300))


def covariance_of_log_sizes(scales: FloatArray, rows: FloatArray, valid: BoolArray, drive: IndexArray) -> FloatArray:
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


def _whitener(movement: FloatArray, valid: BoolArray, drive: IndexArray, scale: FloatArray) -> Whitener:
    """What turns movement over scale, 0 where invalid, into independent rows as it is seen: without a floor."""
    return Whitener(fit_autoregression(movement, valid, ORDER, longest=LONGEST), valid, drive, scale)


def innovations(
    moved: FloatArray, responses: FloatArray, valid: BoolArray, drive: IndexArray, scale: FloatArray
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
    moved: FloatArray, responses: FloatArray, valid: BoolArray, drive: IndexArray, scale: FloatArray
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


@dataclass(frozen=True, eq=False, slots=True)
class Squares:
    """Mean squares per second, about 1, shape (n,), 0 where invalid; clipped where they are tested and sized."""

    values: FloatArray
    valid: BoolArray

    @property
    def standardised(self) -> FloatArray:
        """Clipped, mean 0 and variance 1 over the valid rows, 0 elsewhere."""
        if not self.valid.any():
            return np.zeros(len(self.values))
        clipped = np.minimum(self.values, CLIP)
        inside = clipped[self.valid]
        return np.where(self.valid, (clipped - inside.mean()) / max(float(inside.std()), 1e-12), 0.0)


def quick_squares(fitted: Fitted) -> Squares:
    """Squared innovations."""
    return Squares(np.square(fitted.innovations), fitted.coarse.valid)


def fine_squares(fitted: Fitted) -> Squares:
    """Squared innovations of the 0.2 s grid, averaged to 1 Hz; drives are each compared with themselves.

    Responses to columns are taken out as far as the innovations show them: where the provider of the tracks smoothed
    them away, they would be put in, and look like noise.
    """
    coarse, timeline = fitted.coarse, fitted.coarse.timeline
    n = len(timeline)
    valid = timeline.valid & np.repeat(coarse.valid, COARSE)[:n] if len(coarse) * COARSE >= n else timeline.valid
    level = fitted.levels[timeline.drive]
    moved = np.where(valid, timeline.offset - level, 0.0)
    responses = np.where(valid, fitted.explained - level, 0.0)
    process = fit_autoregression(moved, valid, FINE_ORDER)
    rows, responses = moving_sum(process.polynomial, moved), moving_sum(process.polynomial, responses)
    settled = moving_sum(np.ones(process.order + 1), valid.astype(np.float64)) > process.order + 0.5
    power = float(responses[settled] @ responses[settled])
    seen = float(np.clip(responses[settled] @ rows[settled] / power, 0.0, 1.0)) if power > 0.0 else 0.0
    squares = coarse_mean(np.where(settled, np.square(rows - seen * responses), 0.0))
    whole = coarse_all(settled)
    return Squares(squares / own_levels(squares, whole, coarse.drive)[coarse.drive], whole)


def slow_squares(fitted: Fitted) -> Squares:
    """Squares of the whitened movement's running sums: more is let pass, but what is done is done as always."""
    valid = fitted.coarse.valid
    sums = moving_sum(np.ones(SLOW_S), fitted.innovations)
    whole = valid & (moving_sum(np.ones(SLOW_S), valid.astype(np.float64)) >= SLOW_S - 0.5)
    deviation = float(sums[whole].std()) if whole.any() else 1.0
    return Squares(np.where(whole, np.square(sums / max(deviation, 1e-12)), 0.0), whole)


def of_squares(coarse: Coarse, squares: Squares, columns: FloatArray) -> Problem:
    """Regression of squares on columns, shape (n, k), that may make them larger.

    Squares come in clusters of seconds, which whitening takes out. Loud and quiet minutes it leaves: they are what a
    slow column does (an autoregression that sees them takes half of the effect of rain for memory), and where no column
    does it, the null keeps them too.
    """
    valid, series = squares.valid, squares.standardised
    left = series
    if columns.shape[1]:
        design = columns - columns[valid].mean(axis=0)
        left = series - design @ np.linalg.lstsq(design[valid], series[valid], rcond=None)[0]
    process = fit_autoregression(np.where(valid, left, 0.0), valid, min(ORDER, SQUARES_S), longest=SQUARES_S)
    return Problem(Whitener(process, valid, coarse.drive, np.ones(len(coarse))), series, columns)


def log_sizes(squares: Squares, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Log-linear regression [1]_ of a standard deviation on columns, shape (n, k), from mean squares per second.

    Returns
    -------
    sizes, errors : array, shape (k,)
        Natural logarithm per unit.
    """
    design = columns[squares.valid] - columns[squares.valid].mean(axis=0)
    inverse = np.linalg.pinv(2.0 * design.T @ design)
    sizes = np.zeros(columns.shape[1])
    relative = seen = squares.values[squares.valid]
    for _ in range(8):
        # clipped about what is expected there: a large effect must not clip itself
        relative = seen / np.exp(np.clip(2.0 * design @ sizes, -6.0, 6.0))
        relative = np.minimum(relative / max(float(relative.mean()), 1e-300), CLIP)
        relative = relative / max(float(relative.mean()), 1e-300)
        sizes = sizes + inverse @ (design.T @ (relative - 1.0))
    return sizes, np.sqrt(np.diag(inverse)) * float(np.std(relative)) / np.sqrt(2.0)
