"""Filters: low-passes of one design, a windowed sinc with a Kaiser window; first-order lags; gains over frequency.

(What `scipy.signal.firwin` gives too, to rounding; importing that takes 0.4 s, which a conversion hasn't got. Lags are
needed where drives are simulated, which has the time.)

References
----------
J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE Int. Symp. Circuits and
Systems, 1974, pp. 20-23: how long a window must be, and of what shape, for an attenuation and a transition width.
"""

from __future__ import annotations

import math
from enum import Enum

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.arrays import filtered as filtered
from xosc_lateral.base.arrays import mirrored as mirrored

LEAST_ATTENUATION, GREAT_ATTENUATION = 21.0, 50.0
"""Of a rectangular window, shape 0, where Kaiser's formulas begin, and where they change. [dB]"""

LENGTH_OFFSET, LENGTH_SLOPE = 7.95, 2.285
"""Attenuation = offset + slope * transition width [rad per sample] * (taps - 1). [dB]"""

SHAPE_POWER_FACTOR, SHAPE_POWER, SHAPE_SLOPE = 0.5842, 0.4, 0.07886
"""Shape between both attenuations: factor * excess ** power + slope * excess, with the excess over the least. [-]"""


def kaiser_design(attenuation: float, width: float) -> tuple[int, float]:
    """Taps to each side of the middle one, and shape of a Kaiser window. [-]

    For an attenuation in the stop band [dB] and a width from the end of the pass band to the beginning of the stop
    band, as a share of half the sampling rate, > 0 [-]. Raises `ValueError` outside 21 to 50 dB, the formula's range.
    """
    if not LEAST_ATTENUATION <= attenuation <= GREAT_ATTENUATION:
        raise ValueError(f"attenuation {attenuation} dB, expected {LEAST_ATTENUATION:g} to {GREAT_ATTENUATION:g}")
    steps = (attenuation - LENGTH_OFFSET) / (LENGTH_SLOPE * math.pi * width)
    excess = attenuation - LEAST_ATTENUATION
    return math.ceil(steps / 2), SHAPE_POWER_FACTOR * excess**SHAPE_POWER + SHAPE_SLOPE * excess


def low_pass(half: int, cutoff: float, beta: float) -> FloatArray:
    """Symmetric kernel of gain 1, shape (2 * half + 1,). [-]

    `cutoff`: where the gain is one half, as a share of half the sampling rate, 0 to 1; `beta` >= 0: shape of the Kaiser
    window. [-]
    """
    kernel = np.sinc(cutoff * np.arange(-half, half + 1)) * np.kaiser(2 * half + 1, beta)
    return np.asarray(kernel / kernel.sum())


def low_pass_between(passed: float, stopped: float, step: float, attenuation: float) -> FloatArray:
    """Symmetric kernel of gain 1 that passes what is slower than one frequency, and stops what is faster than another.

    Both below half the sampling rate [Hz]; `step` of the rows [s]; attenuation in the stop band, 21 to 50 dB.
    """
    nyquist = 0.5 / step
    half, beta = kaiser_design(attenuation, (stopped - passed) / nyquist)
    return low_pass(half, 0.5 * (passed + stopped) / nyquist, beta)


def scale_frequencies(values: FloatArray, gain: FloatArray) -> FloatArray:
    """A series, shape (n,), with every frequency scaled; it goes round: its end runs into its beginning. [any unit]

    `gain` [-] at ``numpy.fft.rfftfreq(n)`` cycles per sample, shape (n // 2 + 1,).
    """
    return np.asarray(np.fft.irfft(np.fft.rfft(values) * gain, len(values)), dtype=np.float64)


# ---- power spectra by Welch's method, window by window ----
# (`scipy.signal.welch` averages them; medians and geometric means over windows are wanted here, over many runs, and
# half a second of import is not.)
# P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Trans. Audio and
# Electroacoustics 15 (1967), pp. 70-73.


class Detrend(Enum):
    """What is taken out of a window before it is transformed.

    Of its ends, the straight line through both: what drifts slowly then leaks into no frequency.
    """

    NOTHING = "nothing"
    MEAN = "mean"
    ENDS = "ends"


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
    pieces = windows.reshape(-1, size)
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
