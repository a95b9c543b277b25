"""Most likely driver and sensor behind measured runs: Whittle's likelihood [4]_, with what driver and vehicle can do to
the side as a prior on the spectrum of the offset.

The logarithm of the driver's power density is a polygon over the logarithm of frequency. Its slope is free below
0.1 Hz, where a lane is kept as somebody likes. Above, what is expected is, up to its level::

    1 / (f * (1 + (f / corner)^5) * (1 + (f / 1 Hz)^2)^1.5)

- Below the corner of the driver's corrections the power falls with the frequency.
- Beyond it, with its sixth power: a lateral acceleration takes two integrations to become an offset, -4; steering comes
  in corrections that last some tenths of a second and are never undone within them [1]_ [2]_, which a lag of first
  order describes, -2.
- Muscles and vehicle follow the command with lags that add up to a corner of about 1 Hz [1]_ [3]_: up to -3 more where
  the sensor is good enough to see it.

How brisk corrections are differs from driver to driver, so that the corner is fitted with the rest: at
`BRISKEST_CORNER` or below. Where noise hides the driver, his spectrum goes on as the part of it that is seen lets
expect. A corner that were as free upwards would make a driver of every low-passed error; and beside such an error,
whose own corner is estimated, it is `BRISKEST_CORNER`: a slower driver and a slower error are one spectrum.

The prior is a normal one, of standard deviation `SLOPE_SD` on each slope and `BEND_SD` on the change from one to the
next: data with little noise override it.

References
----------
.. [1] D. T. McRuer, R. W. Allen, D. H. Weir, R. H. Klein, "New results in driver steering control models",
   Human Factors 19(4), 1977: cross-over frequencies of lane keeping, neuromuscular lags.
.. [2] G. Markkula et al., "Sustained sensorimotor control as intermittent decisions about prediction errors",
   Biological Cybernetics 112, 2018.
.. [3] ISO 7401:2011, lateral transient response: the yaw response of passenger cars at 80 to 120 km/h falls from
   about 1 Hz on.
.. [4] P. Whittle, "Estimation and information in stationary time series", Arkiv för Matematik 2, 1953.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.fitting.sensor.periodogram import LEVEL_SD, Periodogram, SecondView, climb
from xosc_lateral.drivers.model.sensor import butterworth

KNOTS = np.array([0.01, 0.02, 0.035, 0.05, 0.075, 0.1, 0.14, 0.2, 0.27, 0.35, 0.45, 0.6, 0.8, 1.1, 1.5])
"""[Hz]"""

FREE_BELOW = 0.1
LAG_CORNER = 1.0
"""Corners: of lane keeping at will, of muscles and vehicle. [Hz]"""

BRISKEST_CORNER = 0.27
"""Corner of the briskest corrections: that of drive tables whose sensor is good enough to see it. [Hz]"""

POWER_BELOW, POWER_BEYOND, MOST_LAG = 1.0, 6.0, 3.0
"""Powers of the frequency by which the density falls below the corner, beyond it, and more beyond that of the lags."""

SLOWER_SD, BRISKER_SD = 0.5, 0.05
"""Of the logarithm of the corner over `BRISKEST_CORNER`, below it and above. [-]"""

SLOPE_SD, BEND_SD, FREE_BEND_SD = 0.9, 1.0, 1.5
"""Of log power over log frequency. [-] `docs/design/sensor.md` shows how little the split depends on them."""

STEEPEST_KNOWN = -4.0
"""Beyond the last knot the density falls at least like this. [-]"""

_LOG = np.log(KNOTS)
N_KNOTS = len(KNOTS)

N_STATE = N_KNOTS + 1
"""Knots, then the logarithm of the corner over `BRISKEST_CORNER`: what the prior is on."""


def expected_log_density(frequency: FloatArray, shift: float = 0.0) -> FloatArray:
    """Mean of the prior on log power, up to its level. Shape as `frequency` [Hz]. [-]

    `shift` is the logarithm of the corner over `BRISKEST_CORNER`.
    """
    steps = POWER_BEYOND - POWER_BELOW
    bend = np.logaddexp(0.0, steps * (np.log(frequency / BRISKEST_CORNER) - shift))
    return np.asarray(
        -POWER_BELOW * np.log(frequency) - bend - 0.5 * MOST_LAG * np.log1p((frequency / LAG_CORNER) ** 2)
    )


SLOPES = np.diff(np.eye(N_KNOTS), axis=0) / np.diff(_LOG)[:, None]
"""From knot values to slopes, shape (n - 1, n)."""

_BOUND = np.flatnonzero(0.5 * (_LOG[1:] + _LOG[:-1]) > np.log(FREE_BELOW))
_BENDS = np.diff(SLOPES, axis=0)
_ROWS = np.concatenate([SLOPES[_BOUND] / SLOPE_SD, _BENDS[_BOUND[:-1]] / BEND_SD, _BENDS[: _BOUND[0]] / FREE_BEND_SD])
"""Slopes and their changes in units of the prior, from knot values."""


def _of_slopes(values: FloatArray) -> FloatArray:
    """What slopes between the knots of such values are in units of the prior, shape (len(_ROWS),). [-]"""
    slopes = (SLOPES @ values)[_BOUND]
    return np.concatenate([slopes / SLOPE_SD, np.diff(slopes) / BEND_SD, np.zeros(_BOUND[0])])


def prior(state: FloatArray, *, is_corner_free: bool = True) -> tuple[FloatArray, FloatArray]:
    """Residuals of a state, shape (m,), each standard normal by the prior, and their Jacobian, shape (m, N_STATE).

    Where the corner is not free, the slopes expected are those of `BRISKEST_CORNER`, whatever the state says.
    """
    knots, excess = state[:N_KNOTS], float(state[N_KNOTS])
    shift, deviation = excess if is_corner_free else 0.0, SLOWER_SD if excess < 0.0 else BRISKER_SD
    jacobian = np.zeros((len(_ROWS) + 1, N_STATE))
    jacobian[:-1, :N_KNOTS] = _ROWS
    if is_corner_free:
        steps = POWER_BEYOND - POWER_BELOW
        change = steps / (1.0 + np.exp(-steps * (np.log(KNOTS / BRISKEST_CORNER) - shift)))
        jacobian[:-1, N_KNOTS] = -_of_slopes(change)  # of the expected density, with the shift
    jacobian[-1, N_KNOTS] = 1.0 / deviation
    residuals = _ROWS @ knots - _of_slopes(expected_log_density(KNOTS, shift))
    return np.append(residuals, excess / deviation), jacobian


def interpolation(frequency: FloatArray) -> FloatArray:
    """From knot values to log densities at these frequencies, constant outside the knots, shape (len(frequency), n)."""
    log = np.clip(np.log(np.maximum(frequency, 1e-9)), _LOG[0], _LOG[-1])
    left = np.clip(np.searchsorted(_LOG, log) - 1, 0, N_KNOTS - 2)
    share = (log - _LOG[left]) / (_LOG[left + 1] - _LOG[left])
    matrix = np.zeros((len(log), N_KNOTS))
    rows = np.arange(len(log))
    matrix[rows, left], matrix[rows, left + 1] = 1.0 - share, share
    return matrix


def density(knots: FloatArray, frequency: FloatArray) -> FloatArray:
    """Driver's power density from the logarithms at the knots. [m2/Hz] Shape as `frequency` [Hz]."""
    beyond = np.maximum(np.log(np.maximum(frequency, 1e-9)) - _LOG[-1], 0.0)
    last = min(float((SLOPES @ knots)[-1]), STEEPEST_KNOWN)
    return np.asarray(np.exp(interpolation(frequency) @ knots + last * beyond))


# ---- driver plus sensor ----
NOISE_FREQUENCY = 1.0
"""No driver is seen above this in a sensor worth splitting: where white noise is estimated at first. [Hz]"""

TOP_SHARE = 0.8
"""Of the highest frequency, beyond which it is estimated where a recording counts up to less. [-]"""

WHITE_SD = 3.0
COLOUR_SD = 4.0
"""Of weak priors that keep parts that are not there from running off: of log density. [-]"""

NO_WHITE = np.log(1e-14)
"""Log density of white noise that is not there: a hundredth of what is added to every periodogram. [-]"""

KNOWN_SD = 0.05
"""How closely a noise level that is known is kept to: of its logarithm. [-]"""


@dataclass(frozen=True, slots=True)
class Colour:
    """Coloured part of the sensor: a Butterworth shape of some order and corner [Hz], or what a second view shows.

    Of order 0 and without a view there is none. `alone`: there is no white noise beside it.
    """

    order: int = 0
    corner: float = 1.0
    alone: bool = False
    view: SecondView | None = None

    @property
    def is_there(self) -> bool:
        """Whether there is a coloured part."""
        return self.order > 0 or self.view is not None

    def shape(self, frequency: FloatArray) -> FloatArray:
        """Density over that at frequency 0 [-], or of the second view [m2/Hz]. Shape as `frequency` [Hz]."""
        if self.view is not None:
            return self.view.density(frequency)
        return butterworth(frequency, self.order, self.corner)

    def integral(self, highest: float) -> float:
        """Of the shape over all frequencies; of a second view, up to `highest`, that of the rows [Hz]."""
        if self.view is not None:
            return self.view.variance(highest)
        part = np.pi / (2 * self.order)
        return float(self.corner * part / np.sin(part))


@dataclass(frozen=True, slots=True)
class Known:
    """A sensor whose error is known."""

    deviation: float  # Standard deviation on the table's rows. [m]
    rate: float  # Rows per second. [Hz]
    rounding: float = 0.0  # What rounding has of its square, which is known from the rows. [m2]


@dataclass(frozen=True, eq=False, slots=True)
class Solution:
    """The maximum."""

    # The driver, shape (N_STATE,): log density at the knots, and the corner of corrections, see `KNOTS`.
    state: FloatArray
    white: float  # Log densities of the sensor's two parts, of `colour` over its shape; -inf where there is none.
    colour: float
    loss: float  # Minus log posterior.

    @property
    def knots(self) -> FloatArray:
        """Log density of the driver, shape (N_KNOTS,)."""
        return self.state[:N_KNOTS]

    def coloured(self, colour: Colour, frequency: FloatArray) -> FloatArray:
        """Density of the coloured part, which there is. [m2/Hz] Shape as `frequency` [Hz]."""
        return np.asarray(np.exp(self.colour) * colour.shape(frequency))


@dataclass(frozen=True, eq=False, slots=True)
class SensorData:
    """What driver and sensor are to explain."""

    data: Periodogram
    base: FloatArray  # Density of the sensor's that is known already, at the data's frequencies, shape (n,). [m2/Hz]
    known: Known | None = None


class _Problem:
    """Loss, gradient and Fisher information at a point (state, white, colour)."""

    def __init__(self, measured: SensorData, colour: Colour) -> None:
        data, known = measured.data, measured.known
        self.data, self.base, self.known = data, measured.base, known
        self.matrix = interpolation(data.frequency)
        self.shape = colour.shape(data.frequency) if colour.is_there else None
        self.integral = colour.integral(0.5 * known.rate) if colour.is_there and known else 0.0
        self.size = N_STATE + 1 + colour.is_there
        self.is_seen, self.is_low_passed = colour.view is not None, colour.order > 0
        high = data.frequency > min(NOISE_FREQUENCY, TOP_SHARE * float(data.frequency[-1]))
        self.top = float(np.log(np.average(data.density[high], weights=data.weight[high])))
        self.corner, self.alone = colour.corner, colour.alone

    def start(self) -> FloatArray:
        """The measured density up to 0.3 Hz, going on as f^-6 from there; the sensor's as flat as above 1 Hz."""
        log = np.log(KNOTS)
        measured = np.interp(log, np.log(self.data.frequency), np.log(self.data.density))
        last = int(np.searchsorted(KNOTS, 0.3)) - 1
        measured[last + 1 :] = measured[last] - 6.0 * (log[last + 1 :] - log[last])
        at = int(np.argmin(np.abs(self.data.frequency - 0.7 * self.corner)))
        white = NO_WHITE if self.alone else self.top - 0.3
        rest = [white, 0.0 if self.is_seen else float(np.log(self.data.density[at])) - 0.7]
        return np.concatenate([measured, [0.0], rest[: self.size - N_STATE]])

    def at(self, point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Loss, gradient, information."""
        driver, white = np.exp(self.matrix @ point[:N_KNOTS]), np.exp(point[N_STATE])
        total = driver + white + self.base
        slope = np.zeros((len(total), self.size))
        if self.shape is not None:
            coloured = np.exp(point[N_STATE + 1]) * self.shape
            total = total + coloured
            slope[:, N_STATE + 1] = coloured
        slope[:, :N_KNOTS] = self.matrix * driver[:, None]
        slope[:, N_STATE] = white
        slope /= total[:, None]
        ratio, weight = self.data.density / total, self.data.weight
        loss = float((weight * (np.log(total) + ratio)).sum())
        gradient = slope.T @ (weight * (1.0 - ratio))
        information = (slope.T * weight) @ slope
        loss = self._add_priors(point, loss, gradient, information)
        return loss, gradient, information

    def _add_priors(self, point: FloatArray, loss: float, gradient: FloatArray, information: FloatArray) -> float:
        """Loss with the priors' share; gradient and information are added to in place."""
        for row, value in self._priors(point):
            residual = float(row @ point) - value
            loss += 0.5 * residual**2
            gradient += residual * row
            information += np.outer(row, row)
        residuals, jacobian = prior(point[:N_STATE], is_corner_free=not self.is_low_passed)
        gradient[:N_STATE] += jacobian.T @ residuals
        information[:N_STATE, :N_STATE] += jacobian.T @ jacobian
        return loss + 0.5 * float(residuals @ residuals)

    def _priors(self, point: FloatArray) -> list[tuple[FloatArray, float]]:
        """Weak priors of the sensor's levels, and the level that is known, linearised where it is looked at."""
        white = np.zeros(self.size)
        white[N_STATE] = 1.0 / WHITE_SD
        rows = [(white, (NO_WHITE if self.alone else self.top - 1.0) / WHITE_SD)]
        if self.is_seen:
            level = np.zeros(self.size)
            level[N_STATE + 1] = 1.0 / LEVEL_SD
            rows.append((level, 0.0))
        elif self.shape is not None and not self.alone:
            both = np.zeros(self.size)
            both[N_STATE], both[N_STATE + 1] = -1.0 / COLOUR_SD, 1.0 / COLOUR_SD
            rows.append((both, 0.0))
        if self.known is not None:
            parts = np.zeros(self.size)
            parts[N_STATE] = np.exp(point[N_STATE]) * 0.5 * self.known.rate
            if self.shape is not None:
                parts[N_STATE + 1] = np.exp(point[N_STATE + 1]) * self.integral
            variance = float(parts.sum()) + self.known.rounding
            row = parts / variance / KNOWN_SD
            lacking = (2.0 * np.log(self.known.deviation) - np.log(variance)) / KNOWN_SD
            rows.append((row, float(row @ point) + lacking))
        return rows


def solve(measured: SensorData, colour: Colour, start: Solution | None = None) -> Solution:
    """Most likely driver and sensor for a given colour of the sensor, climbed to from one of the same colour."""
    problem = _Problem(measured, colour)
    point = problem.start() if start is None else np.array([*start.state, start.white, start.colour])[: problem.size]
    point, loss = climb(problem.at, point)
    coloured = float(point[N_STATE + 1]) if colour.is_there else -np.inf
    return Solution(point[:N_STATE], float(point[N_STATE]), coloured, loss)
