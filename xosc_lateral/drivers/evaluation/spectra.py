"""What the ten metrics don't see: spectrum, autocorrelation, time near a marking, excursions.

References
----------
P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Trans. Audio and
Electroacoustics 15, 1967, pp. 70-73.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.drives.filters import tapered_powers

MANY_SEGMENTS = 8  # With so many segments without a gap, spectra are taken from these only.


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


BANDS = np.geomspace(0.01, 1.0, 21)  # Edges of the frequency bands, ten a decade. [Hz]
# Window lengths at 5 Hz, 102 s to 13 s: each band takes the shortest one that holds `PERIODS`.
SEGMENTS = (1024, 512, 256, 128, 64)
PERIODS = 1.0  # Periods of a band's centre that a window must hold. [-]
PADDING = 8  # Windows are padded with zeros to so many times their length: every band then holds a frequency. [-]


@dataclass(frozen=True, eq=False)
class Spectrum:
    """One-sided power density of the offset in logarithmic bands; bands that no run is long enough for are left out."""

    frequency: FloatArray  # shape (n,): Geometric centres. [Hz]
    density: FloatArray  # shape (n,): [m²/Hz]
    windows: NDArray[np.int64]  # shape (n,): How many windows each band rests on.


def spectrum(runs: Sequence[FloatArray], step: float) -> Spectrum:
    """Power density by Welch's method (Hann windows, half overlapping, mean removed), pooled over runs.

    `runs`, shape (n_i,) each: offsets [m] of uninterrupted driving at an even `step` [s].
    """
    by_length = {length: _periodogram(runs, length, step) for length in SEGMENTS}
    centres, densities, windows = [], [], []
    for low, high in pairwise(BANDS):
        centre = float(np.sqrt(low * high))
        for length in reversed(SEGMENTS):
            frequency, density, count = by_length[length]
            inside = (frequency >= low) & (frequency < high)
            if count and length * step * centre >= PERIODS and inside.any():
                centres.append(centre)
                densities.append(float(density[inside].mean()))
                windows.append(count)
                break
    return Spectrum(np.array(centres), np.array(densities), np.array(windows, dtype=np.int64))


def _periodogram(runs: Sequence[FloatArray], length: int, step: float) -> tuple[FloatArray, FloatArray, int]:
    frequency = np.asarray(np.fft.rfftfreq(PADDING * length, step), dtype=np.float64)
    window = np.hanning(length + 1)[:-1]
    parts = [
        np.lib.stride_tricks.sliding_window_view(run, length)[:: length // 2] for run in runs if len(run) >= length
    ]
    if not parts:
        return frequency, np.zeros(len(frequency)), 0
    rows = np.concatenate(parts)
    centred = rows - rows.mean(axis=1, keepdims=True)
    power = tapered_powers(centred, window, size=PADDING * length).mean(axis=0)
    density: FloatArray = 2.0 * step * power / (window**2).sum()
    return frequency, density, len(rows)


def autocorrelation(runs: Sequence[FloatArray], lags: Sequence[int]) -> FloatArray:
    """Correlation of the offset with itself some steps later, about the mean of all runs.

    Differences between drivers count: they don't decay.

    Returns shape (len(lags),): lags that no run reaches get 0.
    """
    everything = np.concatenate(list(runs))
    mean, variance = everything.mean(), everything.var()
    result = np.zeros(len(lags))
    for k, lag in enumerate(lags):
        products = [(run[lag:] - mean) @ (run[: len(run) - lag] - mean) for run in runs if len(run) > lag]
        count = sum(len(run) - lag for run in runs if len(run) > lag)
        if count and variance > 0.0:
            result[k] = sum(products) / count / variance
    return result
