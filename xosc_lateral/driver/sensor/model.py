"""What a sensor adds to the offset: white noise, low-passed noise, rounding, as a profile keeps it.

References
----------
.. [1] M. Shinozuka, G. Deodatis, "Simulation of stochastic processes by spectral representation", Applied Mechanics
       Reviews 44, 1991.
"""

from __future__ import annotations

from itertools import pairwise
from math import inf, isfinite
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.records import Record, plain
from xosc_lateral.driver.sensor.likelihood import Colour
from xosc_lateral.driver.sensor.texture import amplitude_factor
from xosc_lateral.drives.filters import scale_frequencies
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]

FAINTEST = 1e-16
"""Added to measured densities, so that none at all has a logarithm. [m2/Hz]"""

WIDE = 0.6
"""Steps of more standard deviations of the movement are wide; narrower ones do no harm as noise
(docs/design/sensor.md). [-]"""

HIGHEST = 1.5
"""Runs are low-passed here on being resampled to 5 Hz, and so is what is sampled. [Hz]"""


class SensorModel(Record, frozen=True):
    """The sensor's part of what was measured.

    Raises `DriverProfileError` if a number is negative or no number.

    Parameters
    ----------
    white : float
        One-sided power density of the white part. [m2/Hz]
    coloured : float
        That of the low-passed part at frequency 0. [m2/Hz]
    corner : float
        Of the low-passed part. [Hz]
    order : int
        Of its Butterworth shape; 0 where there is none.
    rounding : float
        Step that values come in; 0 where none was found. [m]
    driver_variance, sensor_variance : float
        Of the measured rows, whose sum is the measured variance; where values come in wide steps, which hang on the
        driver, the latter is the rows' mean square error. [m2]
    driver_share : tuple of float
        Share of the driver: 95 % interval. [-]

    frequencies, densities : tuple of float
        Density of the error as it was measured in runs, see `texture`; empty: as the parts above have it. [Hz], [m2/Hz]
    level_variance, level_duration : float
        Variance of the log of the density over time [-], and how long a level lasts [s]; in files `wanders`, `lasts`.
    second_view : float
        Power of the error over that of half the lane width, beside the white part, where it was estimated so
        (`second_view`); else 0. [-]
    """

    white: float
    coloured: float = 0.0
    corner: float = 1.0
    order: int = 0
    rounding: float = 0.0
    driver_variance: float = 0.0
    sensor_variance: float = 0.0
    driver_share: tuple[float, float] = (0.0, 1.0)
    frequencies: tuple[float, ...] = ()
    densities: tuple[float, ...] = ()
    level_variance: float = msgspec.field(default=0.0, name="wanders")
    level_duration: float = msgspec.field(default=60.0, name="lasts")
    second_view: float = 0.0

    def __post_init__(self) -> None:
        """Check."""
        levels = (self.white, self.coloured, self.rounding, self.second_view)
        parts = (*levels, self.driver_variance, self.sensor_variance)
        numbers = (*parts, self.level_variance, *self.frequencies, *self.densities)
        if not all(map(isfinite, numbers)) or min(numbers) < 0 or self.order < 0 or not self.corner > 0:
            raise DriverProfileError(f"sensor: {self}")
        rising = all(low < high for low, high in pairwise(self.frequencies))
        if len(self.frequencies) != len(self.densities) or not rising or not 0.0 < self.level_duration < inf:
            raise DriverProfileError(f"sensor: {self}")

    @property
    def share(self) -> float:
        """Of the driver in the measured variance. [-]"""
        total = self.driver_variance + self.sensor_variance
        return self.driver_variance / total if total > 0 else 1.0

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, as a profile's file holds them."""
        values: dict[str, Any] = plain(self)
        if not self.second_view:
            del values["second_view"]  # as files had it before there were second views
        return values

    def in_words(self) -> str:
        """How the measured variance is split, and what is known of the error, in a sentence."""
        low, high = self.driver_share
        words = (
            f"{100 * self.share:.1f} % of the measured variance is the driver's (95 % interval: {100 * low:.1f} to "
            f"{100 * high:.1f} %), the rest is sensor error ({np.sqrt(self.sensor_variance):.3f} m rms)"
        )
        if self.second_view:
            words = f"{words}, estimated by the lane width, which the same camera measured"
        return words

    def density(self, frequency: FloatArray) -> FloatArray:
        """One-sided power density without rounding. [m2/Hz] Shape as `frequency` [Hz]."""
        total: FloatArray = np.full(np.shape(frequency), self.white)
        if self.order:
            total = total + self.coloured * Colour(self.order, self.corner).shape(frequency)
        return total

    def sample(self, n: int, step: float, rng: np.random.Generator) -> FloatArray:
        """Noise as it is in measured runs at this step, shape (n,). [m]

        Without a measured density, what rounding adds is left out: runs are low-passed, and lie on its lattice no more.
        """
        if not n:
            return np.empty(0)
        padded = n + round(30.0 / step)  # a low-passed part must not come round to its own beginning
        frequency: FloatArray = np.asarray(np.fft.rfftfreq(padded, step), dtype=np.float64)
        gain = np.sqrt(self.in_runs(frequency) / (2.0 * step))
        error = scale_frequencies(rng.normal(size=padded), gain)[:n]
        if self.level_variance:
            error = error * amplitude_factor(self.level_variance, self.level_duration, n, step, rng)
        return error

    def in_runs(self, frequency: FloatArray) -> FloatArray:
        """One-sided power density of the noise in runs at 5 Hz. [m2/Hz] Shape as `frequency` [Hz]."""
        if not self.frequencies:
            return np.asarray(self.density(frequency) * (frequency <= HIGHEST))
        table = np.log(np.array(self.densities) + FAINTEST)
        log = np.interp(np.log(np.maximum(frequency, 1e-9)), np.log(self.frequencies), table)
        return np.asarray(np.exp(log))
