"""The spectrum of series with gaps and seams."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.drives.filters import tapered_powers

MANY_SEGMENTS = 8  # With so many segments without a gap, spectra are taken from these only.


def gapped_spectrum(
    series: FloatArray, valid: BoolArray, seams: NDArray[np.intp], step: float, segment: int
) -> tuple[FloatArray, FloatArray, int]:
    """Frequency [Hz] and power density [m2/Hz] by Welch's method of series with gaps, and the number of segments.

    Segments of so many samples are mostly `valid` and lie in one part: runs, shape (runs, n) [m], are put together from
    parts with a jump between them, whose numbers are `seams`. NaN if no segment is long enough.
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
