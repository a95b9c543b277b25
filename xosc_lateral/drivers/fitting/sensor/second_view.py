"""The lane width as a second view of a camera's errors.

An offset is half the difference of the distances to two lane markings, half the lane width is half their sum. Where the
errors of the two markings are independent, those of offset and half width have one and the same power density: with
e_l and e_r, that of (e_r - e_l) / 2 and that of (e_r + e_l) / 2. The width holds no driving beside them. So its density
says what the offset's error looks like, down to frequencies where nothing else separates it from a driver.

Errors of both markings alike are not in the width, a camera that pitches scales the width and hardly the offset, and
where one marking was misjudged the offset has been corrected (`drives.markings`), as far as that is seen: the level is
a number of its own, about 1 (`LEVEL_SD`). Slower than `LOWEST_FREQUENCY`, lanes themselves widen, and the density is
taken to go on as it is there; that it is the camera's all the way down is the other end of the interval.

References
----------
.. [1] P. Whittle, "Estimation and information in stationary time series", Arkiv för Matematik 2, 1953.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.fitting.sensor.periodogram import Periodogram, climb, periodogram, windows_of

LEVEL_SD = 0.5
"""Of the logarithm of the offset's error's power over the half width's, about 0 (docs/design/markings.md shows how
little hangs on it). [-]"""

LOWEST_FREQUENCY = 0.05
"""[Hz]"""

KNOTS = np.array([0.01, 0.02, 0.035, LOWEST_FREQUENCY, 0.07, 0.1, 0.14, 0.2, 0.27, 0.35, 0.45, 0.6, 0.8, 1.0, 1.2, 1.5])
"""Of the logarithm of the half width's density, over the logarithm of frequency. [Hz]"""

BEND_SD = 1.0
"""Of a change of the slope from one knot to the next, as for a driver's (`vehicle_bound`). [-]"""

FINE = 1000
"""Frequencies of the variance's integral. [-]"""


@dataclass(frozen=True, slots=True)
class SecondView:
    """Power density of half the lane width: logarithms (of m2/Hz) at frequencies [Hz], straight over log frequency.

    Constant outside, and below `slowest` [Hz].
    """

    frequencies: tuple[float, ...]
    knots: tuple[float, ...]
    slowest: float = LOWEST_FREQUENCY

    def density(self, frequency: FloatArray) -> FloatArray:
        """One-sided. [m2/Hz] Shape as `frequency` [Hz]."""
        log = np.log(np.maximum(frequency, max(self.slowest, 1e-9)))
        return np.asarray(np.exp(np.interp(log, np.log(self.frequencies), self.knots)))

    def scaled(self, factor: float) -> SecondView:
        """The same times a factor."""
        return replace(self, knots=tuple(knot + float(np.log(factor)) for knot in self.knots))

    def variance(self, highest: float) -> float:
        """Of what is slower than `highest` [Hz]. [m2]"""
        from scipy.integrate import trapezoid

        frequency = np.linspace(0.0, highest, FINE)
        return float(trapezoid(self.density(frequency), frequency))


def second_view(half_widths: Sequence[FloatArray], step: float) -> SecondView | None:
    """Fitted to the mean periodogram of runs, by Whittle's likelihood [1]_; None of a width that stands still.

    From half the lane width of each run [m], shape (n_i,), at an even step [s].
    """
    if np.ptp(np.concatenate(half_widths)) == 0.0:
        return None
    data = periodogram(*windows_of(half_widths, step))
    frequencies = KNOTS[data.frequency[0] <= KNOTS]
    return SecondView(tuple(frequencies.tolist()), tuple(_fitted(data, frequencies).tolist()))


def _fitted(data: Periodogram, knots: FloatArray) -> FloatArray:
    """Log densities at the knots [Hz]."""
    log, frequency, density, weight = np.log(knots), np.log(data.frequency), data.density, data.weight
    matrix = np.column_stack([np.interp(frequency, log, unit) for unit in np.eye(len(knots))])
    slopes = np.diff(np.eye(len(knots)), axis=0) / np.diff(log)[:, None]
    bends = np.diff(slopes, axis=0) / BEND_SD

    def at(point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Loss, gradient, information."""
        ratio, bend = density / np.exp(matrix @ point), bends @ point
        loss = float((weight * (matrix @ point + ratio)).sum()) + 0.5 * float(bend @ bend)
        gradient = matrix.T @ (weight * (1.0 - ratio)) + bends.T @ bend
        return loss, gradient, (matrix.T * weight) @ matrix + bends.T @ bends

    return climb(at, np.interp(log, frequency, np.log(density)))[0]
