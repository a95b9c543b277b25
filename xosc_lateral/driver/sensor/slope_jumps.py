"""Tracks that bend abruptly at even times: what a provider's smoothing piece by piece adds to them.

A track that was put together from smooth pieces of one length is continuous, but its slope jumps where two of them
meet. Between the slope jumps such an error is a straight line, and its second derivative a train of impulses, one every
`every` seconds. Therefore its power density at any frequency is that of the jumps over the fourth power of the
frequency (derived here): with zeros at all multiples of 1 / `every`, and images of what is slow between them. No
vehicle moves like that. Below half a jump a period, an error is as smooth as driving, and is left to the driver; above,
all is the sensor's, and its density is what is seen there. Where tracks are to be as they were recorded, both must be
of the same jumps: a sampled path then gives up as much of its power as the error has in it, and gets the error of the
jumps drawn. They are louder for one vehicle than for another, at one place than at another, and where the path bends:
a smoothing that makes pieces straighter than they were leaves the rest to the slope jumps between them.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.records import Record
from xosc_lateral.driver.recursion import recur
from xosc_lateral.driver.sensor.by_zone import ByZone
from xosc_lateral.drives.filters import scale_frequencies
from xosc_lateral.drives.resampling import passed
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]

CROSSING = (1.0, 1.2)
"""Between these multiples of half a jump a period, what is left to the driver passes into what is the sensor's: all
below, as far as the filter by which movement below 0.5 Hz is judged can see, is the driver's. [-]"""

MARGIN = 30
"""Jumps drawn before the first row and after the last: slow errors must not come round to their own beginning. [-]"""

SLOWEST = (0.1, 0.2)
"""Up to the first the error is too small a part of the movement to ask for (less than a tenth in the recording that
slope jumps were found in), from the second on it is drawn. [Hz]"""

SHAPE = 5
"""Points of the shape in half a jump a period: a spectrum of snippets of 10 s sees no finer. [-]"""

FINER = 4
"""Points per row of the grid that slope jumps are put on, between two of them in proportion. [-]"""


class SlopeJumps(Record, frozen=True):
    """Jumps of the slope at even times.

    Raises `DriverProfileError` if a number is out of its range.

    Parameters
    ----------
    every : float
        Time from one to the next. [s]
    densities : tuple of float
        One-sided power density of the jumps, at even frequencies from 0 to half a jump a period. [m2/s2/Hz]
    shares : tuple of float
        What the slope jumps' error has in the power of all that is seen at those frequencies, driver included. [-]
    level_variance, level_duration : float
        Variance of the logarithm of their squares' level [-], and how long a level lasts [s].
    track_variance : float
        Variance from track to track of what of that level lasts all along. [-]
    with_movement : float
        Share of their squares that goes with the square of the path's acceleration. [-]
    acceleration : float
        Root mean square of the latter. [m/s2]
    by_zone : ByZone or None
        Level of their squares in each zone, where the recording has zones.
    shape : tuple of float
        Factors on their density above half a jump a period, from there on evenly, `SHAPE` in half a jump a period;
        empty: 1. [-]
    """

    every: float
    densities: tuple[float, ...]
    shares: tuple[float, ...]
    level_variance: float
    level_duration: float
    track_variance: float = 0.0
    with_movement: float = 0.0
    acceleration: float = 1.0
    shape: tuple[float, ...] = ()
    by_zone: ByZone | None = None

    def __post_init__(self) -> None:
        """Check."""
        shares, scales = (*self.shares, self.with_movement), (self.every, self.level_duration, self.acceleration)
        numbers = (*self.densities, *shares, self.level_variance, self.track_variance, *self.shape, *scales)
        if not all(map(isfinite, numbers)) or min(numbers) < 0.0 or max(shares) > 1.0 or len(self.densities) < 2:
            raise DriverProfileError(f"slope jumps: {self}")
        if len(self.densities) != len(self.shares) or not min(scales) > 0.0:
            raise DriverProfileError(f"slope jumps: {self}")

    @property
    def highest(self) -> float:
        """Half a jump a period: images begin there. [Hz]"""
        return 0.5 / self.every

    def density(self, frequency: FloatArray) -> FloatArray:
        """One-sided power density of what the slope jumps add in runs at 5 Hz. [m2/Hz] Shape as `frequency` [Hz]."""
        return self.of_jumps(frequency) * _rising(frequency, self._crossing) ** 2 * self._shape_at(frequency)

    def of_jumps(self, frequency: FloatArray) -> FloatArray:
        """The same of ideal jumps, straight lines between jumps, with what is left to the driver, from 0.1 Hz on."""
        folded = np.abs((frequency + self.highest) % (2.0 * self.highest) - self.highest)
        jumps = np.interp(folded, self._frequencies, self.densities) / self.every**2
        return np.asarray(jumps * _bent(frequency, SLOWEST[0]) ** 2)

    def sample(
        self, path: FloatArray, step: float, rng: np.random.Generator, zone: FloatArray | None = None
    ) -> FloatArray:
        """What to add to a sampled path so that it is one of pieces, shape (n,), at this step. [m]

        The error of the jumps drawn, at all frequencies that it shows at, less what the path has of it already.
        `zone` has the code of the zone of each row, where they are known.
        """
        driver = _scaled(path, step, self._left)
        return np.asarray(self._error(driver, step, rng, zone) + driver - path)

    def _error(self, driver: FloatArray, step: float, rng: np.random.Generator, zone: FloatArray | None) -> FloatArray:
        """Of slope jumps at even times, from `SLOWEST` on, on the driver's part of a path; both of shape (n,). [m]"""
        n = len(driver)
        count = round(n * step / self.every) + 2 * MARGIN + 2
        first = rng.random()
        times: FloatArray = self.every * (np.arange(count, dtype=np.float64) - MARGIN - first)
        level = self._level(times, step, rng, zone)
        jumps = self._coloured(np.sqrt(level * self._bends(driver, step, times)) * rng.normal(size=count))
        fine = step / FINER
        place = (times - times[0]) / fine
        before = place.astype(np.int64)
        impulses = np.zeros(int(before[-1]) + 2)
        np.add.at(impulses, before, jumps * (1.0 - place + before) / fine)
        np.add.at(impulses, before + 1, jumps * (place - before) / fine)
        frequency: FloatArray = np.asarray(np.fft.rfftfreq(len(impulses), fine), dtype=np.float64)
        gain = _rising(frequency, SLOWEST) * _bent(frequency, SLOWEST[0]) * np.sqrt(self._shape_at(frequency))
        error = scale_frequencies(impulses, -gain)
        return np.asarray(np.interp(np.arange(n) * step, times[0] + fine * np.arange(len(error)), error))

    @property
    def _frequencies(self) -> FloatArray:
        return np.linspace(0.0, self.highest, len(self.densities))

    def _left(self, frequency: FloatArray) -> FloatArray:
        """Factor on a path's amplitude, so that there is room for the slope jumps: all above half a jump a period. [-]

        Shape as `frequency` [Hz].
        """
        share = np.interp(frequency, self._frequencies, self.shares) * _rising(frequency, SLOWEST) ** 2
        return np.asarray(np.sqrt((1.0 - share) * self.left_to_driver(frequency)) * passed(frequency))

    def left_to_driver(self, frequency: FloatArray) -> FloatArray:
        """Share of all power: 1 below half a jump a period, none above it. [-] Shape as `frequency` [Hz]."""
        return np.asarray(1.0 - _rising(frequency, self._crossing) ** 2)

    @property
    def _crossing(self) -> tuple[float, float]:
        return CROSSING[0] * self.highest, CROSSING[1] * self.highest

    def _coloured(self, drawn: FloatArray) -> FloatArray:
        """Jumps from numbers whose squares are 1 in the mean and that know nothing of each other. [m/s]"""
        frequency = np.fft.rfftfreq(len(drawn), self.every)
        gain = np.sqrt(np.interp(frequency, self._frequencies, self.densities) / (2.0 * self.every))
        return scale_frequencies(drawn, gain)

    def _level(self, times: FloatArray, step: float, rng: np.random.Generator, zone: FloatArray | None) -> FloatArray:
        """Factor on the jumps' squares, 1 in the mean, shape as `times` [s]. [-]"""
        known = None if zone is None or not len(zone) else self.by_zone
        varies = known or self
        keep, spread = float(np.exp(-self.every / varies.level_duration)), float(np.sqrt(varies.level_variance))
        kicks = spread * np.sqrt(1.0 - keep**2) * rng.normal(size=len(times) - 1)
        level = recur(np.array([spread * rng.normal()]), kicks, np.array([keep]))
        whose = np.sqrt(varies.track_variance) * rng.normal()
        level = level + whose - 0.5 * (varies.level_variance + varies.track_variance)
        if known is not None and zone is not None:
            level = level + known.at(zone[np.clip(np.rint(times / step).astype(np.int64), 0, len(zone) - 1)])
        return np.asarray(np.exp(level))

    def _bends(self, driver: FloatArray, step: float, times: FloatArray) -> FloatArray:
        """Factor on their squares where the path bends more or less than paths do, shape as `times` [s]. [-]"""
        if len(driver) < 3:
            return np.ones(len(times))
        square = (np.diff(driver, 2) / step**2 / self.acceleration) ** 2
        at = step * np.arange(1, len(driver) - 1)
        return mean_square(self.with_movement, np.interp(times, at, square, left=1.0, right=1.0))

    def _shape_at(self, frequency: FloatArray) -> FloatArray:
        """Factor on the density of ideal jumps. [-] Shape as `frequency` [Hz]."""
        if not self.shape:
            return np.ones(np.shape(frequency))
        return np.interp(frequency, shape_points(self.highest, len(self.shape)), self.shape, left=1.0)


def mean_square(with_movement: float, bend: FloatArray) -> FloatArray:
    """Of jumps where the squared acceleration is `bend` times its mean; 1 in the mean. [-] Shape as `bend` [-]."""
    return 1.0 + with_movement * (bend - 1.0)


def shape_points(highest: float, count: int) -> FloatArray:
    """Where the shape of slope jumps is known, from half a jump a period on, shape (count,). [Hz]"""
    return highest * (1.0 + np.arange(count) / SHAPE)


def _bent(frequency: FloatArray, slowest: float) -> FloatArray:
    """From impulses of acceleration to what they add to the offset, from a frequency on [Hz], in runs at 5 Hz. [s2]"""
    return np.asarray(passed(frequency) / np.maximum(2.0 * np.pi * frequency, 2.0 * np.pi * slowest) ** 2)


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
