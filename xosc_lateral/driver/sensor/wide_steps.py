"""Driver and rounding, separated where steps are wide: the driver's spectrum seen through the staircase.

Where a step is about as wide as the driver's own movement, what rounding adds hangs on the driver, and the rounded path
stands still between steps. So nothing is taken off: the power density of the rounded rows is computed from the driver's
(`rounded_gaussian`), by the same Whittle likelihood and prior as without steps, and the path is drawn from all those
that would have been rounded to these rows (`hidden_path`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import replace as replaced

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.sensor.ascent import climb
from xosc_lateral.driver.sensor.hidden_path import HiddenPath
from xosc_lateral.driver.sensor.likelihood import Colour, solve
from xosc_lateral.driver.sensor.model import WIDE
from xosc_lateral.driver.sensor.periodogram import PASSED, Periodogram
from xosc_lateral.driver.sensor.quantisation import uniform_variance
from xosc_lateral.driver.sensor.rounded_gaussian import RoundedGaussian, gaussian_behind
from xosc_lateral.driver.sensor.vehicle_bound import N_KNOTS, N_STATE, density, expected_state, prior
from xosc_lateral.normal import NORMAL_95

FloatArray = NDArray[np.float64]

DITHER = 0.25
"""Noise of more steps makes rounding linear: what is left of its dependence on the signal is exp(-2 pi^2 DITHER^2), a
quarter of a quarter turn's (Widrow, Kollar 2008, chapter 19). [-]"""

MOST_NOISE = 0.9
"""Share of the variance before rounding that noise may have: some of it is the driver's. [-]"""

BLOCKS, PIECE = 8, 20.0
"""Pieces of rows [s] are dealt out to so many blocks [-], of which each is left out in turn for the error of the
variance: how seldom a step is crossed counts, not that the driver himself changes from minute to minute."""

KURTOSIS = 0.5
"""Excess kurtosis that a driver may have: of eleven simulated drives, half have less than 0.24 and nine less than 0.73.
What is beyond the outermost step crossed follows from the distribution's shape alone. [-]"""

UNSURE = 0.2
"""Standard error of the logarithm of the driver's variance beyond which it counts as unknown. [-]"""

TIED = (0.01, 1.0)
"""Standard errors of the logarithm of the variance, least and most, by which the spectrum is tied to it. [-]"""

LONGEST = 400.0
"""Lags up to half of this are looked at. [s]"""

NUDGE = 1e-3
"""Of a knot, for slopes. [-]"""


@dataclass(frozen=True, eq=False)
class WideSteps:
    """What was found.

    Parameters
    ----------
    knots : array
        Of the driver's density, see `vehicle_bound`.
    gaussian : RoundedGaussian
        Driver and noise before rounding, counted from the lattice.
    noise : float
        Variance of the noise before rounding, on the rows. [m2]
    unsure : float
        Standard error of the logarithm of the variance; infinite where nothing determines it. [-]
    frequency, rest : array, shape (m,)
        What rounding adds to the density of driver and noise, where it does. [Hz], [m2/Hz]
    path : HiddenPath
    """

    knots: FloatArray
    gaussian: RoundedGaussian
    noise: float
    unsure: float
    frequency: FloatArray
    rest: FloatArray
    path: HiddenPath

    def rounding(self, frequency: FloatArray) -> FloatArray:
        """Power density of what rounding adds. Shape as `frequency` [Hz]. [m2/Hz]"""
        return np.interp(frequency, self.frequency, self.rest)

    def interval(self) -> tuple[float, float]:
        """Of the driver's share in his variance and the rows' mean square error: 95 %; 0 to 1 where it is unknown."""
        if self.unsure > UNSURE:
            return 0.0, 1.0
        factors = np.exp(NORMAL_95 * self.unsure * np.linspace(-1.0, 1.0, 5))
        shares = [driver / (driver + error) for driver, error in map(self.variances, factors.tolist())]
        return max(min(shares), 0.0), max(shares)

    def variances(self, factor: float = 1.0) -> tuple[float, float]:
        """Of the driver, and mean square error of the rows, if the variance were `factor` times as large. [m2]"""
        one = replaced(self.gaussian, deviation=self.gaussian.deviation * float(np.sqrt(factor)))
        follows = one.covariance_with_cause / one.deviation  # how much of a small movement before rounding is left
        return one.deviation**2 - self.noise, one.error + self.noise * (2.0 * follows - 1.0)


def split_wide_steps(
    data: Periodogram,
    windows: FloatArray,
    rows: Sequence[FloatArray],
    grain: float,
    rate: float,
    sensor_noise: float | None = None,
) -> WideSteps | None:
    """Driver and rounding; None where steps are narrow, or noise before rounding makes them harmless.

    Parameters
    ----------
    data : Periodogram
        Of the runs.
    windows : array, shape (k, m)
        Their periodograms one by one. [m2/Hz]
    rows : sequence of array
        On a lattice of three levels at least. [m]
    grain : float
        Its step. [m]
    rate : float
        Rows per second. [Hz]
    sensor_noise : float, optional
        Standard deviation of the sensor's error, rounding included, where it is known. [m]
    """
    everything = np.concatenate(rows)
    phase = float(everything[0] - grain * np.round(everything[0] / grain))
    gaussian = gaussian_behind(everything - phase, grain)
    if grain <= WIDE * gaussian.deviation:
        return None
    noise = _noise_before(rows, gaussian) if sensor_noise is None else _beyond_rounding(sensor_noise, gaussian)
    noise = min(noise, MOST_NOISE * gaussian.deviation**2)
    if np.sqrt(noise) > DITHER * grain:
        return None
    unsure = _error_of_variance(rows, rate, phase, gaussian)
    problem = _Problem(
        data, _overdispersion(windows, data.window), gaussian, noise, rate, float(np.clip(unsure, *TIED))
    )
    starts = problem.starts()
    state = starts[-1]  # of the prior, which is all there is where hardly a step is crossed
    if unsure <= UNSURE:
        state = min((climb(problem.at, start) for start in starts), key=lambda one: one[1])[0]
    knots = state[:N_KNOTS]
    knots = knots + np.log((gaussian.deviation**2 - noise) / problem.power(knots))
    white = 2.0 * noise / rate
    rest = np.maximum(problem.expected(knots)[0] - density(knots, problem.frequency) - white, 0.0)
    path = HiddenPath(knots, gaussian.mean, phase, grain, noise, gaussian.deviation)
    return WideSteps(knots, gaussian, noise, unsure, problem.frequency, rest, path)


def _noise_before(rows: Sequence[FloatArray], gaussian: RoundedGaussian) -> float:
    """Variance of white noise before rounding: smooth paths change level half as often from row to row as over two."""
    one = float(np.concatenate([np.diff(path) ** 2 for path in rows]).mean())
    two = float(np.concatenate([(path[2:] - path[:-2]) ** 2 for path in rows]).mean())
    at_once = max(2.0 * one - two, 0.0)
    full = float(gaussian.covariance(np.ones(1))[0])
    return (1.0 - gaussian.correlation(full - 0.5 * at_once)) * gaussian.deviation**2


def _beyond_rounding(deviation: float, gaussian: RoundedGaussian) -> float:
    """Variance of noise before rounding by which an error that is known exceeds rounding's. [m2]

    Whoever knows the error of a coarse sensor may know what it does to this movement, or that of a uniform one: what
    neither explains is noise.
    """
    return max(deviation**2 - max(gaussian.error, uniform_variance(gaussian.step)), 0.0)


def _error_of_variance(rows: Sequence[FloatArray], rate: float, phase: float, gaussian: RoundedGaussian) -> float:
    """Standard error of the logarithm of the variance: blocks left out, and a distribution that is not normal. [-]"""
    everything = np.concatenate(rows) - phase
    block = np.arange(len(everything)) // round(PIECE * rate) % BLOCKS
    logs = []
    for left_out in range(BLOCKS):
        others = everything[block != left_out]
        if len(np.unique(np.round(others / gaussian.step))) < 3:
            return float("inf")
        logs.append(2.0 * np.log(gaussian_behind(others, gaussian.step).deviation))
    return float(np.hypot(np.sqrt((BLOCKS - 1) * np.var(logs)), KURTOSIS * gaussian.variance_per_kurtosis))


def _overdispersion(windows: FloatArray, seconds: float) -> float:
    """How much more single periodograms vary than those of a Gaussian process: steps that are crossed seldom. [-]"""
    if len(windows) < 2:
        return 1.0
    seen = windows[:, 2 : int(PASSED * seconds) + 1]
    return max(float((seen.var(axis=0, ddof=1) / seen.mean(axis=0) ** 2).mean()), 1.0)


class _Problem:
    """Loss, gradient and Fisher information at a state, see `vehicle_bound`."""

    def __init__(
        self, data: Periodogram, dispersion: float, gaussian: RoundedGaussian, noise: float, rate: float, unsure: float
    ) -> None:
        self.data, self.gaussian, self.noise, self.unsure = data, gaussian, noise, unsure
        self.weight = data.weight / dispersion
        self.step, self.size = 1.0 / rate, 1 << int(np.ceil(np.log2(LONGEST * rate)))
        self.frequency: FloatArray = np.asarray(np.fft.rfftfreq(self.size, self.step), dtype=np.float64)

    def starts(self) -> list[FloatArray]:
        """The spectrum of the rows as if nothing were rounded, and that of the prior, both with the known variance."""
        found = [
            solve(self.data, Colour(), np.zeros(len(self.data.frequency))).state,
            expected_state(),
        ]
        for state in found:
            state[:N_KNOTS] += 2.0 * np.log(self.gaussian.deviation) - np.log(self.power(state[:N_KNOTS]))
        return found

    def power(self, knots: FloatArray) -> float:
        """Variance of a driver with these knots. [m2]"""
        return float(density(knots, self.frequency).sum() * self.frequency[1])

    def expected(self, knots: FloatArray) -> tuple[FloatArray, float]:
        """Density of the rounded rows [m2/Hz], and variance before rounding [m2]."""
        covariance = np.fft.irfft(density(knots, self.frequency), self.size) / (2.0 * self.step)
        variance = float(covariance[0]) + self.noise
        correlation = covariance / variance
        correlation[0] = 1.0
        # the levels give the variance; the spectrum has to say how it is spread, so the staircase stays as it is
        rounded = np.fft.rfft(self.gaussian.covariance(correlation)).real * 2.0 * self.step
        return np.maximum(rounded, 1e-12), variance

    def _shown(self, knots: FloatArray) -> FloatArray:
        """Logarithms of the densities at the data's frequencies, and of the variance, shape (n + 1,)."""
        rounded, variance = self.expected(knots)
        return np.asarray(np.log(np.append(np.interp(self.data.frequency, self.frequency, rounded), variance)))

    def at(self, state: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Loss, gradient, information."""
        knots, (residuals, own) = state[:N_KNOTS], prior(state)
        shown = self._shown(knots)
        ratio = self.data.density / np.exp(shown[:-1])
        lacking = (shown[-1] - 2.0 * np.log(self.gaussian.deviation)) / self.unsure
        loss = float((self.weight * (shown[:-1] + ratio)).sum() + 0.5 * lacking**2 + 0.5 * residuals @ residuals)
        jacobian = np.zeros((len(shown), N_STATE))  # the corner shows by the prior alone
        jacobian[:, :N_KNOTS] = (np.array([self._shown(knots + NUDGE * unit) for unit in np.eye(N_KNOTS)]) - shown).T
        jacobian /= NUDGE
        weights = np.append(self.weight, 1.0 / self.unsure**2)
        pull = np.append(self.weight * (1.0 - ratio), lacking / self.unsure)
        gradient = jacobian.T @ pull + own.T @ residuals
        return loss, gradient, (jacobian.T * weights) @ jacobian + own.T @ own
