"""What is new in each second of the movement as the table shows it."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.drivers.loop.autocorrelation import Whitener, fit_autoregression, start_factors

ORDER = 12  # Past seconds that have a coefficient each in the movement's autoregression. [s]
MAXIMUM_ORDER = 96  # Past seconds that it sees as means over doubling times: drifts of a minute and a half. [s]
# Shifts of a response that make up its smoothing: two standard deviations, to either side, of a Gaussian that leaves
# 9 % at 0.5 Hz. [s]
SMOOTHING_S = (-2, -1, 1, 2)
CLIP = 9.0  # Squared innovations (variance 1) beyond this count as this: three standard deviations. [-]
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


def _whitener(movement: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray) -> Whitener:
    """What turns movement over scale, 0 where invalid, into independent rows, without measurement noise."""
    return Whitener(fit_autoregression(movement, valid, ORDER, longest=MAXIMUM_ORDER), valid, drive, scale)


def innovations(
    moved: FloatArray, responses: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray
) -> FloatArray:
    """White rows of variance about 1, shape (n,), young runs by their own size, of offsets less levels and responses
    [m]."""
    if np.any(responses):
        responses = smoothed_as_seen(moved, responses, valid, drive, scale)
    left = np.where(valid, moved - responses, 0.0)
    whitener = _whitener(left / scale, valid, drive, scale)
    rows = whitener.rows(left)
    return np.asarray(rows / whitener.by_position(start_factors(rows, valid, whitener.process.order)))


def smoothed_as_seen(
    moved: FloatArray, responses: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray
) -> FloatArray:
    """Responses through the five-second filter of gain one that leaves least of them: providers smooth them, edges and
    all. [m]"""
    whitener = _whitener(np.where(valid, moved / scale, 0.0), valid, drive, scale)
    seconds = np.arange(len(responses))
    shifted = [responses[np.clip(seconds - shift, 0, len(seconds) - 1)] for shift in SMOOTHING_S]
    changes = np.stack(shifted, axis=1) - responses[:, None]
    weights = np.linalg.lstsq(whitener.rows(changes), whitener.rows(moved - responses), rcond=None)[0]
    return np.asarray(responses + changes @ weights)
