"""What a sensor adds to the offset: white noise, low-passed noise, rounding, as a profile keeps it.

References
----------
.. [1] M. Shinozuka, G. Deodatis, "Simulation of stochastic processes by spectral representation", Applied Mechanics
       Reviews 44, 1991.
"""

from __future__ import annotations

from math import isfinite

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.drives.filters import scale_frequencies
from xosc_lateral.drivers.model.records import Record

PASS_FREQUENCY = 1.5
"""Runs are low-passed here on being resampled to 5 Hz, and so is what is sampled. [Hz]"""


def butterworth(frequency: FloatArray, order: int, corner: float) -> FloatArray:
    """Power of a low-pass over that at frequency 0. [-] Shape as `frequency`, in the unit of its corner."""
    return np.asarray(1.0 / (1.0 + (frequency / corner) ** (2 * order)))


class SensorModel(Record, frozen=True):
    """The sensor's part of what was measured. Raises `DriverProfileError` if a number is negative or no number."""

    later = ("second_view",)

    white: float  # One-sided power density of the white part. [m2/Hz]
    coloured: float = 0.0  # That of the low-passed part at frequency 0. [m2/Hz]
    corner: float = 1.0  # Of the low-passed part. [Hz]
    order: int = 0  # Of its Butterworth shape; 0 where there is none.
    rounding: float = 0.0  # Step that values come in; 0 where none was found. [m]
    driver_variance: float = 0.0  # Of the measured rows, as `sensor_variance`; their sum is the measured variance. [m2]
    sensor_variance: float = 0.0
    driver_share: tuple[float, float] = (0.0, 1.0)  # Share of the driver: 95 % interval. [-]
    # Power of the error over that of half the lane width, where it was estimated so (`second_view`); else 0. [-]
    second_view: float = 0.0

    def __post_init__(self) -> None:
        levels = (self.white, self.coloured, self.rounding, self.second_view)
        parts = (*levels, self.driver_variance, self.sensor_variance)
        if not all(map(isfinite, parts)) or min(parts) < 0 or self.order < 0 or not self.corner > 0:
            raise DriverProfileError(f"sensor: {self}")

    @property
    def share(self) -> float:
        """Of the driver in the measured variance. [-]"""
        total = self.driver_variance + self.sensor_variance
        return self.driver_variance / total if total > 0 else 1.0

    @property
    def is_told_apart(self) -> bool:
        """Whether the measured rows show at all which part is the sensor's."""
        return self.driver_share != (0.0, 1.0)

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
            total = total + self.coloured * butterworth(frequency, self.order, self.corner)
        return total

    def sample(self, n: int, step: float, rng: np.random.Generator) -> FloatArray:
        """Noise as it is in measured runs at this step, shape (n,). [m]

        What rounding adds is left out: runs are low-passed, and lie on its lattice no more.
        """
        if not n:
            return np.empty(0)
        padded = n + round(30.0 / step)  # a low-passed part must not come round to its own beginning
        frequency: FloatArray = np.asarray(np.fft.rfftfreq(padded, step), dtype=np.float64)
        gain = np.sqrt(self.in_runs(frequency) / (2.0 * step))
        return scale_frequencies(rng.normal(size=padded), gain)[:n]

    def in_runs(self, frequency: FloatArray) -> FloatArray:
        """One-sided power density of the noise in runs at 5 Hz. [m2/Hz] Shape as `frequency` [Hz]."""
        return np.asarray(self.density(frequency) * (frequency <= PASS_FREQUENCY))
