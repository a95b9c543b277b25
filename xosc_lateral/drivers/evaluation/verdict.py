"""Up to which frequency sampled movement is like that of other real drivers, and what a detector makes of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.rows import true_slices
from xosc_lateral.drivers.drives.drive import Run
from xosc_lateral.drivers.drives.filters import Detrend, periodograms
from xosc_lateral.drivers.drives.resampling import PASS_BAND_EDGES

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
            return f"like other real drivers up to {self.like_up_to:g} Hz, all that is compared"
        side = "below" if unlike.ratio < 1.0 else "above"
        what = f"{side} them from {unlike.low:g} Hz on ({unlike.ratio:.2f} of their power up to {unlike.high:g} Hz)"
        return f"like other real drivers up to {self.like_up_to:g} Hz; {what}" if self.like_up_to else f"{what}"

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
