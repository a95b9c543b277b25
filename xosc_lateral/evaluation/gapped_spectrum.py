"""Power spectra of series with gaps and seams: drives put together from parts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.drives.periodogram import tapered_powers

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

MANY_SEGMENTS = 8
"""With so many segments without a gap, spectra are taken from these only."""


def gapped_spectrum(
    series: FloatArray, valid: BoolArray, seams: NDArray[np.intp], step: float, segment: int
) -> tuple[FloatArray, FloatArray, int]:
    """Power density by Welch's method of series with gaps, over segments that are mostly valid and lie in one part.

    Parameters
    ----------
    series : array, shape (runs, n)
        Gaps are filled with the mean. [m]
    valid : bool array, shape (n,)
    seams : int array, shape (n,)
        Number of the part that a row belongs to: runs are put together from parts, with a jump between them.
    step : float
        [s]
    segment : int
        Samples.

    Returns
    -------
    frequency : array [Hz], density : array [m^2/Hz], number of segments : int
        Without frequency 0; the density is NaN if no segment is long enough.
    """
    centred = np.where(valid, series - series[:, valid].mean(axis=1, keepdims=True), 0.0)
    window = np.hanning(segment)
    sums = np.zeros(segment // 2 + 1)
    starts = np.arange(0, valid.size - segment + 1, segment // 2)
    shares = np.array([float(valid[first : first + segment].mean()) for first in starts])
    usable = (shares > 0.8) & (seams[starts] == seams[starts + segment - 1])
    whole = usable & (shares == 1.0)
    chosen = np.flatnonzero(whole if whole.sum() >= MANY_SEGMENTS else usable)
    number = len(chosen)
    for index in chosen:
        rows = slice(starts[index], starts[index] + segment)
        sums += np.mean(tapered_powers(centred[:, rows], window), axis=0) / shares[index]
    frequency = np.asarray(np.fft.rfftfreq(segment, step), dtype=np.float64)
    density = 2.0 * step * sums / number / float(np.sum(window**2)) if number else np.full(len(frequency), np.nan)
    return frequency[1:], density[1:], number
