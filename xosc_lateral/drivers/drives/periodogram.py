"""Power spectra by Welch's method, window by window; how windows are put together is their user's choice.

(`scipy.signal.welch` averages them; medians and geometric means over windows are wanted here, over many runs, and half
a second of import is not.)

References
----------
P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Trans. Audio and
Electroacoustics 15 (1967), pp. 70-73.
"""

from __future__ import annotations

from enum import Enum

import numpy as np

from xosc_lateral.base.arrays import FloatArray


class Detrend(Enum):
    """What is taken out of a window before it is transformed."""

    NOTHING = "nothing"
    MEAN = "mean"
    ENDS = "ends"
    """The straight line through its first and its last value: what drifts slowly then leaks into no frequency."""


def hann(size: int) -> FloatArray:
    """Hann window without its zeros, scaled so that white noise of variance 1 has a power of 1. Shape (size,). [-]"""
    taper = np.hanning(size + 2)[1:-1]
    return np.asarray(taper / np.sqrt((taper**2).sum()))


def periodograms(values: FloatArray, size: int, *, detrend: Detrend = Detrend.NOTHING) -> FloatArray:
    """Power of half-overlapping Hann windows of one run, shape (n,), or of several equally long, shape (runs, n).

    Of shape (k, size // 2 + 1), at `numpy.fft.rfftfreq(size)` cycles per sample, size >= 2; white noise of variance 1
    gives 1 everywhere. No rows where the run is shorter than a window. [square of the values' unit]
    """
    if values.shape[-1] < size:
        return np.empty((0, size // 2 + 1))
    windows = np.lib.stride_tricks.sliding_window_view(values, size, axis=-1)[..., :: max(1, size // 2), :]
    return window_powers(windows.reshape(-1, size), detrend=detrend)


def window_powers(pieces: FloatArray, *, detrend: Detrend = Detrend.NOTHING) -> FloatArray:
    """Power of Hann windows, one per row: shape (k, size) to (k, size // 2 + 1); see `periodograms`."""
    size = pieces.shape[1]
    if detrend is Detrend.MEAN:
        pieces = pieces - pieces.mean(axis=1, keepdims=True)
    elif detrend is Detrend.ENDS:
        slope = np.linspace(0.0, 1.0, size) * (pieces[:, -1:] - pieces[:, :1])
        pieces = pieces - pieces[:, :1] - slope
    return tapered_powers(pieces, hann(size))


def tapered_powers(rows: FloatArray, taper: FloatArray | float, *, size: int | None = None) -> FloatArray:
    """Squared moduli of the transforms of rows, shape (k, n), seen through any window, shape (n,), or 1. [-]

    Padded with zeros to `size`, n unless given; shape (k, size // 2 + 1). [square of the rows' unit]
    """
    return np.asarray(np.abs(np.fft.rfft(rows * taper, n=size, axis=1)) ** 2)


def without_line(rows: FloatArray) -> FloatArray:
    """Rows, shape (k, n), less the straight line through the first and the last value of each. [unit of the rows]"""
    line = np.linspace(0.0, 1.0, rows.shape[1])
    return np.asarray(rows - (rows[:, :1] + line * (rows[:, -1:] - rows[:, :1])))
