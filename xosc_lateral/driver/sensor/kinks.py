"""Tracks that bend abruptly at even times: what a provider's smoothing piece by piece adds to them.

A track that was put together from smooth pieces of one length is continuous, but its slope jumps where two of them
meet. Between the kinks such an error is a straight line, and its second derivative a train of impulses, one every
`every` seconds. Therefore its power density at any frequency is that of the jumps over the fourth power of the
frequency (derived here): with zeros at all multiples of 1 / `every`, and images of what is slow between them. No
vehicle moves like that. Below half a kink a period, an error is as smooth as driving, and is left to the driver; above,
all is the sensor's. What is above depends on what is below, so that part of the jumps is told by the path that was
sampled, as much as the error has in the power there, and the rest is drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.records import Record
from xosc_lateral.driver.recursion import recur
from xosc_lateral.drives.filters import scale_frequencies
from xosc_lateral.drives.resampling import passed
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]

CROSSING = (1.0, 1.2)
"""Between these multiples of half a kink a period, what is left to the driver passes into what is the sensor's: all
below, as far as the filter by which movement below 0.5 Hz is judged can see, is the driver's. [-]"""

MARGIN = 30
"""Kinks drawn before the first row and after the last: slow errors must not come round to their own beginning. [-]"""

TAPER = 10.0
"""Of what a path is continued by at its ends. [s]"""

FINER = 4
"""Points per row of the grid that kinks are put on, between two of them in proportion. [-]"""


class Kinks(Record, frozen=True):
    """Jumps of the slope at even times.

    Parameters
    ----------
    every : float
        Time from one to the next. [s]
    densities : tuple of float
        One-sided power density of the jumps, at even frequencies from 0 to half a kink a period. [m2/s2/Hz]
    shares : tuple of float
        What the kinks' error has in all that is seen at those frequencies, driver included. [-]
    level_variance, level_duration : float
        Variance of the logarithm of their squares' level [-], and how long a level lasts [s].

    Raises
    ------
    DriverProfileError
        If a number is out of its range.
    """

    every: float
    densities: tuple[float, ...]
    shares: tuple[float, ...]
    level_variance: float
    level_duration: float

    def __post_init__(self) -> None:
        """Check."""
        numbers = (*self.densities, *self.shares, self.level_variance)
        if not all(map(isfinite, numbers)) or min(numbers) < 0.0 or max(self.shares) > 1.0 or len(self.densities) < 2:
            raise DriverProfileError(f"kinks: {self}")
        if len(self.densities) != len(self.shares) or not min(self.every, self.level_duration) > 0.0:
            raise DriverProfileError(f"kinks: {self}")

    @property
    def highest(self) -> float:
        """Half a kink a period: images begin there. [Hz]"""
        return 0.5 / self.every

    def density(self, frequency: FloatArray) -> FloatArray:
        """One-sided power density of what the kinks add in runs at 5 Hz. [m2/Hz] Shape as `frequency` [Hz]."""
        folded = np.abs((frequency + self.highest) % (2.0 * self.highest) - self.highest)
        jumps = np.interp(folded, self._frequencies, self.densities) / self.every**2
        return np.asarray(jumps * self._gain(frequency) ** 2)

    def sample(self, path: FloatArray, step: float, rng: np.random.Generator) -> FloatArray:
        """What the kinks add to a sampled path, shape (n,), at this step. [m]"""
        count = round(len(path) * step / self.every) + 2 * MARGIN + 2
        first = rng.random()
        times: FloatArray = self.every * (np.arange(count, dtype=np.float64) - MARGIN - first)
        told = self.every * _bend(path, step, times, self._share)
        jumps = told + self._drawn(count, rng) * self._level(count, rng)
        fine = step / FINER
        place = (times - times[0]) / fine
        before = place.astype(np.int64)
        impulses = np.zeros(int(before[-1]) + 2)
        np.add.at(impulses, before, jumps * (1.0 - place + before) / fine)
        np.add.at(impulses, before + 1, jumps * (place - before) / fine)
        frequency: FloatArray = np.asarray(np.fft.rfftfreq(len(impulses), fine), dtype=np.float64)
        error = scale_frequencies(impulses, -self._gain(frequency))
        return np.asarray(np.interp(np.arange(len(path)) * step, times[0] + fine * np.arange(len(error)), error))

    @property
    def _frequencies(self) -> FloatArray:
        return np.linspace(0.0, self.highest, len(self.densities))

    def _share(self, frequency: FloatArray) -> FloatArray:
        known = np.interp(frequency, self._frequencies, self.shares)
        return np.asarray(np.where(frequency < self.highest, known, 0.0))

    def _gain(self, frequency: FloatArray) -> FloatArray:
        """From impulses of acceleration to the sensor's part of the offset, in runs at 5 Hz. [s2]"""
        low, high = (self.highest * share for share in CROSSING)
        rise = np.sin(0.5 * np.pi * np.clip((frequency - low) / (high - low), 0.0, 1.0))
        return np.asarray(rise * passed(frequency) / np.maximum(2.0 * np.pi * frequency, 2.0 * np.pi * low) ** 2)

    def _drawn(self, count: int, rng: np.random.Generator) -> FloatArray:
        """The jumps' part that no path tells, shape (count,). [m/s]"""
        left = np.array(self.densities) * (1.0 - np.array(self.shares))
        frequency = np.fft.rfftfreq(count, self.every)
        gain = np.sqrt(np.interp(frequency, self._frequencies, left) / (2.0 * self.every))
        return scale_frequencies(rng.normal(size=count), gain)

    def _level(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Factor on the jumps, its square 1 in the mean, shape (count,). [-]"""
        keep = float(np.exp(-self.every / self.level_duration))
        spread = float(np.sqrt(self.level_variance))
        kicks = spread * np.sqrt(1.0 - keep**2) * rng.normal(size=count - 1)
        level = recur(np.array([spread * rng.normal()]), kicks, np.array([keep]))
        return np.asarray(np.exp(0.5 * (level - 0.5 * self.level_variance)))


def _bend(path: FloatArray, step: float, times: FloatArray, share: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """Second derivative of a part of the path at these times [s], 0 far outside of it. [m/s2]"""
    about = path - path.mean()
    reach = min(len(path) - 1, round(MARGIN / step))
    if reach < 2:
        return np.zeros(len(times))
    longer = np.concatenate([2.0 * about[0] - about[reach:0:-1], about, 2.0 * about[-1] - about[-2 : -reach - 2 : -1]])
    edge = np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, min(reach, round(TAPER / step)))) ** 2
    longer[: len(edge)] *= edge
    longer[-len(edge) :] *= edge[::-1]
    frequency: FloatArray = np.asarray(np.fft.rfftfreq(len(longer), step), dtype=np.float64)
    bend = scale_frequencies(longer, -share(frequency) * (2.0 * np.pi * frequency) ** 2)
    return np.asarray(np.interp(times, step * (np.arange(len(longer)) - reach), bend, left=0.0, right=0.0))
