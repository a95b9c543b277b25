"""Tracks that bend abruptly at even times: what a provider's smoothing piece by piece adds to them.

A track that was put together from smooth pieces of one length is continuous, but its slope jumps where two of them
meet. Between the kinks such an error is a straight line, and its second derivative a train of impulses, one every
`every` seconds. Therefore its power density at any frequency is that of the jumps over the fourth power of the
frequency (derived here): with zeros at all multiples of 1 / `every`, and images of what is slow between them. No
vehicle moves like that. Below half a kink a period, an error is as smooth as driving, and is left to the driver; above,
all is the sensor's. Where tracks are to be as they were recorded, both must be of the same kinks, which are louder at
one place than at another: a sampled path then gives up as much of its power as the error has in it, and gets the error
of the kinks drawn.
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

SLOWEST = (0.1, 0.2)
"""Up to the first the error is too small a part of the movement to ask for (less than a tenth in the recording that
kinks were found in), from the second on it is drawn. [Hz]"""

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
        What the kinks' error has in the power of all that is seen at those frequencies, driver included. [-]
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
        return np.asarray(jumps * _gain(frequency, self._crossing) ** 2)

    def sample(self, path: FloatArray, step: float, rng: np.random.Generator) -> FloatArray:
        """What to add to a sampled path so that it is one of pieces, shape (n,), at this step. [m]

        The error of the kinks drawn, at all frequencies that it shows at, less what the path has of it already.
        """
        return np.asarray(self._error(len(path), step, rng) + _scaled(path, step, self._left) - path)

    def _error(self, n: int, step: float, rng: np.random.Generator) -> FloatArray:
        """Of kinks at even times, from `SLOWEST` on, shape (n,). [m]"""
        count = round(n * step / self.every) + 2 * MARGIN + 2
        first = rng.random()
        times: FloatArray = self.every * (np.arange(count, dtype=np.float64) - MARGIN - first)
        jumps = self._drawn(count, rng) * self._level(count, rng)
        fine = step / FINER
        place = (times - times[0]) / fine
        before = place.astype(np.int64)
        impulses = np.zeros(int(before[-1]) + 2)
        np.add.at(impulses, before, jumps * (1.0 - place + before) / fine)
        np.add.at(impulses, before + 1, jumps * (place - before) / fine)
        frequency: FloatArray = np.asarray(np.fft.rfftfreq(len(impulses), fine), dtype=np.float64)
        error = scale_frequencies(impulses, -_gain(frequency, SLOWEST))
        return np.asarray(np.interp(np.arange(n) * step, times[0] + fine * np.arange(len(error)), error))

    @property
    def _frequencies(self) -> FloatArray:
        return np.linspace(0.0, self.highest, len(self.densities))

    def _left(self, frequency: FloatArray) -> FloatArray:
        """Factor on a path's amplitude, so that there is room for the kinks. Shape as `frequency` [Hz]. [-]"""
        share = np.interp(frequency, self._frequencies, self.shares) * _rising(frequency, SLOWEST) ** 2
        of_path = 1.0 - _rising(frequency, self._crossing) ** 2
        return np.asarray(np.sqrt(1.0 - share * of_path) * passed(frequency))

    @property
    def _crossing(self) -> tuple[float, float]:
        return CROSSING[0] * self.highest, CROSSING[1] * self.highest

    def _drawn(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Jumps of one level, shape (count,). [m/s]"""
        frequency = np.fft.rfftfreq(count, self.every)
        gain = np.sqrt(np.interp(frequency, self._frequencies, self.densities) / (2.0 * self.every))
        return scale_frequencies(rng.normal(size=count), gain)

    def _level(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Factor on the jumps, its square 1 in the mean, shape (count,). [-]"""
        keep = float(np.exp(-self.every / self.level_duration))
        spread = float(np.sqrt(self.level_variance))
        kicks = spread * np.sqrt(1.0 - keep**2) * rng.normal(size=count - 1)
        level = recur(np.array([spread * rng.normal()]), kicks, np.array([keep]))
        return np.asarray(np.exp(0.5 * (level - 0.5 * self.level_variance)))


def _gain(frequency: FloatArray, edge: tuple[float, float]) -> FloatArray:
    """From impulses of acceleration to what they add to the offset above an edge [Hz], in runs at 5 Hz. [s2]"""
    bend = np.maximum(2.0 * np.pi * frequency, 2.0 * np.pi * edge[0]) ** 2
    return np.asarray(_rising(frequency, edge) * passed(frequency) / bend)


def _rising(frequency: FloatArray, edge: tuple[float, float]) -> FloatArray:
    """From 0 at an edge's lower end to 1 at its upper one [Hz], in amplitude; shape as `frequency`. [-]"""
    low, high = edge
    return np.asarray(np.sin(0.5 * np.pi * np.clip((frequency - low) / (high - low), 0.0, 1.0)))


def _scaled(path: FloatArray, step: float, gain: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """With every frequency [Hz] scaled about the straight line between the ends, which stay where they are."""
    if len(path) < 3:
        return path
    line = np.linspace(path[0], path[-1], len(path))
    about = path - line
    odd = np.concatenate([about, -about[-2:0:-1]])
    frequency: FloatArray = np.asarray(np.fft.rfftfreq(len(odd), step), dtype=np.float64)
    return np.asarray(line + scale_frequencies(odd, gain(frequency))[: len(path)])
