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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.rows import true_slices
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.drives.filters import Detrend, filtered, low_pass_between, periodograms, tapered_powers
from xosc_lateral.drivers.drives.resampling import PASS_BAND_EDGES

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


# Where the stop band begins. Drivers steer against what they see below it; beyond it cameras show. [Hz]
STOP_FREQUENCY = 0.5
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


# ---- up to which frequency sampled movement is like that of other real drivers ----
BAND_EDGES = (0.04, 0.08, 0.12, 0.16, 0.20, 0.25, 0.32, 0.40, 0.50, 0.70, 1.0, PASS_BAND_EDGES)
"""In which power is compared: as wide as windows of 25.6 s resolve, or a quarter of their frequency. [Hz]"""

WINDOW = 25.6  # [s]

TOLERANCE = 1.5
"""Factor by which the power of real drivers differs from run to run (six runs with differential GNSS). [-]"""

ERROR_FACTOR = 2.0  # Standard errors within which a difference may be chance. [-]

ALARM_SPEEDS, ALARM_HOLD = (0.10, 0.15, 0.20), 0.4
"""A plain detector's lateral speeds [m/s], and how long they have to last. [s]"""


@dataclass(frozen=True)
class BandPower:
    """Power of measured and sampled movement in a band."""

    low: float  # [Hz]
    high: float  # [Hz]
    measured: float  # [m2/Hz]
    sampled: float  # [m2/Hz]
    error: float  # Standard error of the logarithm of their ratio, drives counted as wholes. [-]

    @property
    def ratio(self) -> float:
        """Sampled over measured. [-]"""
        return self.sampled / self.measured

    @property
    def is_like(self) -> bool:
        """Whether real drivers differ by as much, or chance does."""
        return bool(abs(np.log(self.ratio)) <= max(np.log(TOLERANCE), ERROR_FACTOR * self.error))


@dataclass(frozen=True)
class Verdict:
    """Bands up to what the recording is valid to, and alarms an hour by lateral speed [m/s], measured and sampled."""

    bands: tuple[BandPower, ...]
    alarms: Mapping[float, tuple[float, float]]
    shows_alarms: bool  # Whether the recording is valid to where alarms come from.

    @property
    def like_up_to(self) -> float:
        """Frequency below which every band is like other real drivers'; 0 where the first is not. [Hz]"""
        first = next((k for k, band in enumerate(self.bands) if not band.is_like), len(self.bands))
        return self.bands[first - 1].high if first else 0.0

    def in_words(self) -> str:
        """One line."""
        if not self.bands:
            return "no band to compare: runs are too short, or the recording is valid to too little"
        unlike = next((band for band in self.bands if not band.is_like), None)
        if unlike is None:
            return f"power like other real drivers' up to {self.like_up_to:g} Hz, all that is compared"
        side = "below" if unlike.ratio < 1.0 else "above"
        what = f"{side} theirs from {unlike.low:g} Hz on ({unlike.ratio:.2f} of it up to {unlike.high:g} Hz)"
        if self.like_up_to:
            return f"power like other real drivers' up to {self.like_up_to:g} Hz, {what}"
        return f"power unlike other real drivers': {what}"

    def alarm_words(self) -> str:
        """What a test engineer asks for, in one line."""
        speeds = ", ".join(f"{speed:.2f}" for speed in self.alarms)
        measured, sampled = (", ".join(f"{pair[k]:.0f}" for pair in self.alarms.values()) for k in range(2))
        real = f"measured {measured}" if self.shows_alarms else "the recording shows too little for any"
        return f"alarms an hour at {speeds} m/s to the side for {ALARM_HOLD:g} s: {real}; sampled {sampled}"


def verdict_of(runs: Sequence[Run], sampled: Sequence[FloatArray], groups: Sequence[str], step: float) -> Verdict:
    """Measured runs beside sampled ones, as recorded; `groups` says whose each is, drives or blocks of them. [m]"""
    limits = [run.valid_below for run in runs if run.valid_below is not None]
    highest = min([*limits, PASS_BAND_EDGES])
    measured = [run.offset for run in runs]
    edges = [(low, high) for low, high in pairwise(BAND_EDGES) if high <= highest]
    real, made = (_powers(paths, groups, edges, step) for paths in (measured, sampled))
    bands = []
    for k, (low, high) in enumerate(edges if len(real[0]) else []):
        (density, density_error), (other, other_error) = (_mean(power[:, k], whose) for power, whose in (real, made))
        bands.append(BandPower(low, high, density, other, float(np.hypot(density_error, other_error))))
    alarms = {
        speed: (alarms_per_hour(measured, step, speed), alarms_per_hour(sampled, step, speed)) for speed in ALARM_SPEEDS
    }
    return Verdict(tuple(bands), alarms, highest >= BAND_EDGES[-4])


def _powers(
    paths: Sequence[FloatArray], groups: Sequence[str], edges: Sequence[tuple[float, float]], step: float
) -> tuple[FloatArray, NDArray[np.str_]]:
    """Power in bands of windows, shape (windows, bands) [m2/Hz], and whose each is, shape (windows,)."""
    size = round(WINDOW / step)
    frequency = np.fft.rfftfreq(size, step)
    power, whose = [], []
    for path, group in zip(paths, groups, strict=True):
        if len(path) >= size:
            density = 2.0 * step * periodograms(path, size, detrend=Detrend.ENDS)
            power += [[row[(frequency >= low) & (frequency < high)].mean() for low, high in edges] for row in density]
            whose += [group] * len(density)
    return np.array(power).reshape(len(power), len(edges)) + 1e-12, np.array(whose, dtype=np.str_)


def _mean(power: FloatArray, whose: NDArray[np.str_]) -> tuple[float, float]:
    """Mean of windows, shape (n,) [m2/Hz], and the standard error of its logarithm, groups counted as wholes [-]."""
    mean = float(power.mean())
    sums = [float((power[whose == group] - mean).sum()) for group in np.unique(whose)]
    count = len(sums)
    spread = float(np.sqrt(np.square(sums).sum() * count / (count - 1))) if count > 1 else np.inf
    return mean, spread / (len(power) * mean)


def alarms_per_hour(paths: Sequence[FloatArray], step: float, speed: float) -> float:
    """Times an hour that paths move to one side faster than a speed [m/s] for `ALARM_HOLD` at least. [1/h]"""
    rows, count, seconds = round(ALARM_HOLD / step), 0, 0.0
    for path in paths:
        moves = np.diff(path) / step
        for fast in (moves > speed, moves < -speed):
            count += sum(part.stop - part.start >= rows for part in true_slices(fast))
        seconds += len(moves) * step
    return 3600.0 * count / seconds if seconds else 0.0
