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

from xosc_lateral.base.arrays import NORMAL_95, FloatArray, true_slices
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.drives.filters import Detrend, filtered, low_pass_between, periodograms, tapered_powers

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


RECORDED_BELOW = 1.5
"""Band in which recordings are compared: above, rows at 5 Hz hold what faster ones lose on being resampled. [Hz]"""


CLASSIFIED_BELOW = 1.25
"""The same of a classifier: rows thinned by two hold nothing above, where a filter's last hundredth tells a sensor's
error that was recorded at 20 Hz from one at 5 Hz. [Hz]"""


def in_band(paths: FloatArray, step: float, stop: float = RECORDED_BELOW) -> FloatArray:
    """Paths, shape (n, m) [m], without what is faster than a frequency [Hz], each by itself."""
    return np.array([slow_movement(path, step, stop) for path in paths]).reshape(paths.shape)


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
BAND_EDGES = (0.04, 0.08, 0.12, 0.16, 0.20, 0.25, 0.32, 0.40, 0.50, 0.70, 1.0, RECORDED_BELOW)
"""In which power is compared: as wide as windows of 25.6 s resolve, or a quarter of their frequency. [Hz]"""

WINDOW = 25.6  # [s]

TOLERANCE = 1.5
"""Factor by which the power of real drivers differs from run to run (six runs with differential GNSS). [-]"""

ALARM_SPEEDS, ALARM_HOLD = (0.10, 0.15, 0.20), 0.4
"""A plain detector's lateral speeds [m/s], and how long they have to last. [s]"""

ALIKE, UNLIKE, NOT_KNOWN = "alike", "unlike", "not known"
BOTH = DRIVER, RECORDING = "driver", "recording"


def judged(low: float, high: float) -> str:
    """What the 95 % interval of a ratio says: alike within `TOLERANCE`, unlike beyond it, else not known."""
    if low >= 1.0 / TOLERANCE and high <= TOLERANCE:
        return ALIKE
    return UNLIKE if low > TOLERANCE or high < 1.0 / TOLERANCE else NOT_KNOWN


@dataclass(frozen=True)
class Ratio:
    """What is sampled over what is measured, of the driver alone or of the recording, his sensor on both sides."""

    name: str
    of: str  # `DRIVER` or `RECORDING`.
    measured: float
    sampled: float
    error: float  # Standard error of the logarithm of the ratio, drives counted as wholes. [-]
    low: float = 0.0  # Band of a power [Hz]; 0 to 0: all that is compared.
    high: float = 0.0
    cause: str = DRIVER  # What most of it is, of the measured: the driver's movement, or the sensor's error.

    @property
    def ratio(self) -> float:
        """Sampled over measured. [-]"""
        return self.sampled / self.measured

    @property
    def interval(self) -> tuple[float, float]:
        """Of 95 %. [-]"""
        wide = float(np.exp(NORMAL_95 * min(self.error, 50.0)))
        return self.ratio / wide, self.ratio * wide

    @property
    def judged(self) -> str:
        """See `judged`."""
        return judged(*self.interval)

    def in_words(self) -> str:
        """With interval, and cause where it is not the driver."""
        cause = "" if self.cause == DRIVER else f", by the {self.cause}"
        return f"{self.name} {self.ratio:.2f} times theirs ({self.interval[0]:.2f} to {self.interval[1]:.2f}{cause})"


NAMED_RATIOS = 1  # That one line names. [-]


@dataclass(frozen=True)
class Verdict:
    """Ratios in the band that the recording is valid in, and alarms an hour by lateral speed [m/s], both sides."""

    ratios: tuple[Ratio, ...]
    alarms: Mapping[float, tuple[float, float]]
    shows_alarms: bool  # Whether the recording is valid to where alarms come from.
    highest: float = RECORDED_BELOW  # Frequency below which both sides are compared. [Hz]

    def judged(self, of: str) -> str:
        """The driver, or the recording: unlike if any ratio is, alike if all are, else not known."""
        mine = [one for one in self.ratios if one.of == of]
        each = {one.judged for one in mine}
        if UNLIKE in each:
            return UNLIKE
        return ALIKE if each == {ALIKE} and any(one.high for one in mine) else NOT_KNOWN

    def like_up_to(self, of: str = RECORDING) -> float:
        """Frequency below which the power in every band is alike; 0 where that in the first is not. [Hz]"""
        powers = [one for one in self.ratios if one.of == of and one.high]
        first = next((k for k, band in enumerate(powers) if band.judged != ALIKE), len(powers))
        return powers[first - 1].high if first else 0.0

    def in_words(self) -> str:
        """One line: the driver, and the recording."""
        return "; ".join(self._words(of) for of in BOTH)

    def _words(self, of: str) -> str:
        mine = [number for number in self.ratios if number.of == of]
        if not mine:
            return f"{of} {NOT_KNOWN}: nothing to compare, runs are too short or the recording shows too little"
        verdict, up_to = self.judged(of), self.like_up_to(of)
        below = f", power alike up to {up_to:g} Hz" if up_to else ""
        if verdict == ALIKE:
            return f"{of} like other real drivers{below}, all that is compared"
        worst = [number for number in mine if number.judged == verdict] or mine
        worst.sort(key=lambda number: -abs(np.log(number.ratio)))
        named = ", ".join(number.in_words() for number in worst[:NAMED_RATIOS])
        more = f" and {len(worst) - NAMED_RATIOS} more" if len(worst) > NAMED_RATIOS else ""
        words = f"{of} unlike other real drivers" if verdict == UNLIKE else f"{of} {NOT_KNOWN}"
        return f"{words}{below}: {named}{more}"

    def alarm_words(self) -> str:
        """What a test engineer asks for, in one line."""
        speeds = ", ".join(f"{speed:.2f}" for speed in self.alarms)
        measured, sampled = (", ".join(f"{pair[k]:.0f}" for pair in self.alarms.values()) for k in range(2))
        real = f"measured {measured}" if self.shows_alarms else "the recording shows too little for any"
        return f"alarms an hour at {speeds} m/s to the side for {ALARM_HOLD:g} s: {real}; sampled {sampled}"


Sampled = Sequence[tuple[Sequence[FloatArray], Sequence[FloatArray]]]
"""Of each time that the runs were sampled: the driver's paths, and the sensor's errors on them. [m]"""


def verdict_of(
    measured: Sequence[FloatArray], sampled: Sampled, groups: Sequence[str], step: float, highest: float = np.inf
) -> Verdict:
    """Measured paths [m] beside sampled ones with the recording's sensor, below the frequency that it is valid to [Hz].

    `groups` says whose each is, drives or blocks of them. The driver is judged where the sensor's error is the smaller
    part of what was recorded, by what is left without it.
    """
    highest = min(highest, RECORDED_BELOW)
    edges = [(low, high) for low, high in pairwise(BAND_EDGES) if high <= highest]
    recorded = [[path + error for path, error in zip(*each, strict=True)] for each in sampled]
    every = [path for each in recorded for path in each]
    of_all = [f"{group} {k}" for k in range(len(sampled)) for group in groups]  # each time by other drivers
    real, made = _powers(measured, groups, edges, step), _powers(every, of_all, edges, step)
    errors = _powers([error for _, parts in sampled for error in parts], of_all, edges, step)
    ratios = [_place(measured, every, groups, of_all)] if groups else []
    for k, (low, high) in enumerate(edges if len(real[0]) else []):
        (density, density_error), (other, other_error) = (_mean(power[:, k], whose) for power, whose in (real, made))
        noise, error = float(errors[0][:, k].mean()) - LEAST_POWER, float(np.hypot(density_error, other_error))
        name, share = f"power at {low:g} to {high:g} Hz", 1.0 - noise / density
        if share > 0.5:
            left = error / share  # what errs by so much of the whole
            ratios.append(Ratio(name, DRIVER, density - noise, max(other - noise, LEAST_POWER), left, low, high))
        cause = DRIVER if share > 0.5 else "sensor"
        ratios.append(Ratio(name, RECORDING, density, other, error, low, high, cause))
    alarms = {
        speed: (alarms_per_hour(measured, step, speed), alarms_per_hour(every, step, speed)) for speed in ALARM_SPEEDS
    }
    return Verdict(tuple(ratios), alarms, highest >= BAND_EDGES[-4], highest)


def _place(
    measured: Sequence[FloatArray], sampled: Sequence[FloatArray], groups: Sequence[str], of_all: Sequence[str]
) -> Ratio:
    """Where in the lane: mean square offset about the measured mean, of which a lasting shift is a part."""
    middle = float(np.concatenate(list(measured)).mean())
    sides = []
    for paths, whose in ((measured, groups), (sampled, of_all)):
        squares = np.concatenate([(path - middle) ** 2 for path in paths])
        sides.append(_mean(squares, np.repeat(np.array(whose, dtype=np.str_), [len(path) for path in paths])))
    (real, error), (made, other) = sides
    return Ratio("mean square about the measured mean", DRIVER, real, made, float(np.hypot(error, other)))


LEAST_POWER = 1e-12  # [m2/Hz]


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
    return np.array(power).reshape(len(power), len(edges)) + LEAST_POWER, np.array(whose, dtype=np.str_)


def _mean(power: FloatArray, whose: NDArray[np.str_]) -> tuple[float, float]:
    """Mean of windows, shape (n,) [m2/Hz], and the standard error of its logarithm, groups counted as wholes [-]."""
    mean = float(power.mean())
    names, number = np.unique(whose, return_inverse=True)
    sums, count = np.bincount(number, power - mean), len(names)
    spread = float(np.sqrt(np.square(sums).sum() * count / (count - 3))) if count > 3 else np.inf  # Student's
    return mean, spread / (len(power) * mean)


def alarms_per_hour(paths: Sequence[FloatArray], step: float, speed: float) -> float:
    """Times an hour that paths move to one side faster than a speed [m/s] for `ALARM_HOLD` at least. [1/h]"""
    rows, count, seconds = round(ALARM_HOLD / step), 0, 0.0
    for path in paths:
        moves = np.diff(path) / step
        fast = (part for faster in (moves > speed, moves < -speed) for part in true_slices(faster))
        count += sum(part.stop - part.start >= rows for part in fast)
        seconds += len(moves) * step
    return 3600.0 * count / seconds if seconds else 0.0
