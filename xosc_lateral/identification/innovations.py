"""What is new in each second of the movement as the table shows it: what tells how large it is just now.

Providers smooth their tracks, responses to columns and all, and columns they leave as they are: a response that is
taken out with its edges puts them *in*, where next to nothing moves, and every passing vehicle looks like a loud
stretch. So responses are smoothed as far as the innovations show them smoothed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.autocorrelation import Whitener, fit_autoregression, start_factors

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

ORDER = 12
"""Past seconds that have a coefficient each in the movement's autoregression. [s]"""

LONGEST = 96
"""Past seconds that it sees as means over doubling times: drifts of a minute and a half. [s]"""

SMOOTHING_S = (-2, -1, 1, 2)
"""Shifts of a response that make up its smoothing: two standard deviations, to either side, of a Gaussian that leaves
9 % at 0.5 Hz. [s]"""


def whitener_as_seen(movement: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray) -> Whitener:
    """What turns the movement as it is seen into independent rows: without a floor.

    Parameters
    ----------
    movement : array, shape (n,)
        Offset less levels and responses, over the scale; 0 where invalid. [m]
    valid : bool array, shape (n,)
    drive : int array, shape (n,)
    scale : array, shape (n,)
        Factor on the movement. [-]
    """
    process = fit_autoregression(movement, valid, ORDER, longest=LONGEST)
    return Whitener(process, valid, drive, scale)


def innovations(
    moved: FloatArray, responses: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray
) -> FloatArray:
    """Innovations without a floor, shape (n,), young runs by their own size; 0 where invalid. [own unit]

    Parameters
    ----------
    moved : array, shape (n,)
        Offset less levels. [m]
    responses : array, shape (n,)
        What columns did to it. [m]
    valid, drive, scale
        See `whitener_as_seen`.
    """
    if np.any(responses):
        responses = smoothed_as_seen(moved, responses, valid, drive, scale)
    left = np.where(valid, moved - responses, 0.0)
    whitener = whitener_as_seen(left / scale, valid, drive, scale)
    rows = whitener.rows(left)
    return np.asarray(rows / whitener.by_position(start_factors(rows, valid, whitener.process.order)))


def smoothed_as_seen(
    moved: FloatArray, responses: FloatArray, valid: BoolArray, drive: IntArray, scale: FloatArray
) -> FloatArray:
    """Responses through the filter of five seconds and gain one that leaves least of them in the innovations.

    Shape (n,). [m] Least squares in the innovations of the movement with the responses in: they are a per cent of its
    variance, and beside their own edges nothing else would be seen.
    """
    whitener = whitener_as_seen(np.where(valid, moved / scale, 0.0), valid, drive, scale)
    seconds = np.arange(len(responses))
    shifted = [responses[np.clip(seconds - shift, 0, len(seconds) - 1)] for shift in SMOOTHING_S]
    changes = np.stack(shifted, axis=1) - responses[:, None]
    weights = np.linalg.lstsq(whitener.rows(changes), whitener.rows(moved - responses), rcond=None)[0]
    return np.asarray(responses + changes @ weights)
