"""Offsets between the model's samples: a curve through them with continuous lateral speed and acceleration.

Each piece is the quintic that meets value, slope and second derivative at both of its samples, where slope and second
derivative are the central differences there. It needs one sample before and one behind the piece, no more, so that a
stream can follow it; a spline through all samples would need them all.

Derived here: six conditions (value, slope and second derivative at u = 0 and 1) fix the six coefficients; solved by
hand.
"""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

Number = TypeVar("Number", float, FloatArray)


def piece(before: Number, here: Number, there: Number, behind: Number) -> tuple[Number, ...]:
    """Six coefficients in u, from 0 at `here` to 1 at `there`, lowest power first; of one piece or of many."""
    rise = there - here
    slope, next_slope = 0.5 * (there - before), 0.5 * (behind - here)
    bend, next_bend = there - 2.0 * here + before, behind - 2.0 * there + here
    return (
        here,
        slope,
        0.5 * bend,
        10.0 * rise - 6.0 * slope - 4.0 * next_slope - 1.5 * bend + 0.5 * next_bend,
        -15.0 * rise + 8.0 * slope + 7.0 * next_slope + 1.5 * bend - next_bend,
        6.0 * rise - 3.0 * slope - 3.0 * next_slope - 0.5 * bend + 0.5 * next_bend,
    )


def upsample(offsets: FloatArray, factor: int) -> FloatArray:
    """Offsets `factor` times as dense, from the first sample to the last.

    Parameters
    ----------
    offsets : array, shape (n,)
        At the model's step. [m]
    factor : int
        Steps per model step, >= 1.

    Returns
    -------
    array, shape ((n - 1) * factor + 1,)
        Row ``k * factor`` is sample k, bit by bit. Past both ends the samples are taken to go on in a straight line.
    """
    offsets = np.asarray(offsets, dtype=np.float64)
    if factor < 1:
        raise ValueError(f"{factor} steps per model step, at least 1")
    if factor == 1 or len(offsets) < 2:
        return offsets.copy()
    first, last = extrapolate(offsets[1], offsets[0]), extrapolate(offsets[-2], offsets[-1])
    padded = np.concatenate([[first], offsets, [last]])
    share = np.arange(factor) / factor
    c0, c1, c2, c3, c4, c5 = piece(padded[:-3, None], padded[1:-2, None], padded[2:-1, None], padded[3:, None])
    dense = c0 + share * (c1 + share * (c2 + share * (c3 + share * (c4 + share * c5))))
    return np.append(dense.ravel(), offsets[-1])


def extrapolate(before: Number, last: Number) -> Number:
    """The sample that would follow on a straight line. [unit of the samples]"""
    return 2.0 * last - before
