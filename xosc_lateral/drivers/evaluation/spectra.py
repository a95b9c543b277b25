"""What the ten metrics don't see: spectrum, autocorrelation, and movement below a frequency alone.

Below 0.5 Hz, or what a recording is valid to, nothing faster is left to see. A logarithm of power sees a tenth of a
millimetre as well as a metre, so that a filter which is still closing there shows a classifier what lies above.

References
----------
P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE Trans. Audio and
Electroacoustics 15, 1967, pp. 70-73. J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window
function", Proc. IEEE ISCAS 1974.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.drives.filters import filtered, low_pass_between, tapered_powers

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
    """Correlation of the offset with itself some steps later, about the mean of all runs; 0 where no run reaches.

    Differences between drivers count: they don't decay.
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


STOP_FREQUENCY = (
    0.5  # Where the stop band begins. Drivers steer against what they see below it; beyond it cameras show. [Hz]
)
PASS_FREQUENCY = 0.4  # Where the pass band ends: the filter sees 11 s to each side, a quarter of most runs. [Hz]
# Of the stop band: noise of 1 cm becomes 0.1 mm, far less than a difference between two models. [dB]
ATTENUATION = 40.0


def comparison_band(runs: Sequence[Run]) -> float:
    """Frequency below which movement is compared: half a hertz, or what the recording is valid to. [Hz]"""
    return min([STOP_FREQUENCY, *(run.valid_below for run in runs if run.valid_below is not None)])


def slow_movement(path: FloatArray, step: float, stop: float = STOP_FREQUENCY) -> FloatArray:
    """A path, shape (n,) [m], without its movement above a frequency [Hz].

    It is continued beyond its ends by its mirror image through the end point; where its `step` [s] shows nothing above
    the frequency it stays as it is.
    """
    if len(path) < 2 or 0.5 / step <= stop:
        return np.array(path)
    return filtered(path, low_pass_between(PASS_FREQUENCY / STOP_FREQUENCY * stop, stop, step, ATTENUATION))


def thinned(paths: FloatArray, step: float, stop: float = STOP_FREQUENCY) -> FloatArray:
    """Filtered paths, shape (n, m) [m], at the rate whose half is the beginning of the stop band."""
    return paths[:, :: max(1, round(0.5 / stop / step))]


def dithered(paths: Sequence[FloatArray], resolution: float, seed: int) -> list[FloatArray]:
    """Paths with even noise as wide as a recording's resolution [m]: what is finer can't be told from rounding."""
    if resolution <= 0.0:
        return list(paths)
    root = np.random.SeedSequence(seed).spawn(len(paths))
    return [
        path + resolution * (np.random.default_rng(own).random(len(path)) - 0.5)
        for path, own in zip(paths, root, strict=True)
    ]


def resolution_of(runs: Sequence[Run]) -> float:
    """The coarsest that runs state; 0 where none does. [m]"""
    return max((run.resolution for run in runs if run.resolution is not None), default=0.0)
