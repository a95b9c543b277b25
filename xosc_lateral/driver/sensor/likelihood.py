"""Whittle's likelihood of driver plus sensor, climbed by Fisher scoring.

References
----------
.. [1] P. Whittle, "Estimation and information in stationary time series", Arkiv för Matematik 2, 1953.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.sensor.periodogram import Periodogram
from xosc_lateral.driver.sensor.vehicle_bound import KNOTS, N_KNOTS, PRIOR_ROWS, PRIOR_VALUES, interpolation

FloatArray = NDArray[np.float64]

ABOVE = 1.0
"""No driver is seen above this in a sensor worth splitting: where the white floor is looked for at first. [Hz]"""

FLOOR_SD = 3.0
COLOUR_SD = 4.0
"""Of weak priors that keep parts that are not there from running off: of log density. [-]"""

NO_WHITE = np.log(1e-14)
"""Log density of white noise that is not there: a hundredth of what is added to every periodogram. [-]"""

KNOWN_SD = 0.05
"""How closely a noise level that is known is kept to: of its logarithm. [-]"""

ROUNDS = 60
ENOUGH = 1e-3
LONGEST_STEP = 1.5


@dataclass(frozen=True, slots=True)
class Colour:
    """Low-passed part of the sensor: a Butterworth shape; order 0: there is none.

    Parameters
    ----------
    order : int
    corner : float
        [Hz]
    alone : bool
        Whether there is no white noise beside it.
    """

    order: int = 0
    corner: float = 1.0
    alone: bool = False

    def shape(self, frequency: FloatArray) -> FloatArray:
        """Density over that at frequency 0. Shape as `frequency` [Hz]. [-]"""
        return np.asarray(1.0 / (1.0 + (frequency / self.corner) ** (2 * self.order)))

    @property
    def bandwidth(self) -> float:
        """Integral of the shape over all frequencies. [Hz]"""
        part = np.pi / (2 * self.order)
        return float(self.corner * part / np.sin(part))


@dataclass(frozen=True, slots=True)
class Known:
    """A noise level that is known: standard deviation on the table's rows [m], and their rate [Hz]."""

    deviation: float
    rate: float


@dataclass(frozen=True, eq=False, slots=True)
class Solution:
    """The maximum.

    Parameters
    ----------
    knots : array, shape (N_KNOTS,)
        Log density of the driver.
    white, colour : float
        Log densities of the sensor's two parts; `colour` is -inf where there is none.
    loss : float
        Minus log posterior.
    """

    knots: FloatArray
    white: float
    colour: float
    loss: float


class _Problem:
    """Loss, gradient and Fisher information at a point (knots, white, colour)."""

    def __init__(self, data: Periodogram, colour: Colour, base: FloatArray, known: Known | None) -> None:
        self.data, self.base, self.known = data, base, known
        self.matrix = interpolation(data.frequency)
        self.shape = colour.shape(data.frequency) if colour.order else None
        self.bandwidth = colour.bandwidth if colour.order else 0.0
        self.size = N_KNOTS + 1 + bool(colour.order)
        high = data.frequency > ABOVE
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
        rest = [white, float(np.log(self.data.density[at])) - 0.7]
        return np.concatenate([measured, rest[: self.size - N_KNOTS]])

    def at(self, point: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Loss, gradient, information."""
        driver, white = np.exp(self.matrix @ point[:N_KNOTS]), np.exp(point[N_KNOTS])
        total = driver + white + self.base
        slope = np.zeros((len(total), self.size))
        if self.shape is not None:
            coloured = np.exp(point[N_KNOTS + 1]) * self.shape
            total = total + coloured
            slope[:, N_KNOTS + 1] = coloured
        slope[:, :N_KNOTS] = self.matrix * driver[:, None]
        slope[:, N_KNOTS] = white
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
        bend = PRIOR_ROWS @ point[:N_KNOTS] - PRIOR_VALUES
        loss += 0.5 * float(bend @ bend)
        gradient[:N_KNOTS] += PRIOR_ROWS.T @ bend
        information[:N_KNOTS, :N_KNOTS] += PRIOR_ROWS.T @ PRIOR_ROWS
        return loss

    def _priors(self, point: FloatArray) -> list[tuple[FloatArray, float]]:
        """Weak priors of the sensor's levels, and the level that is known, linearised where it is looked at."""
        white = np.zeros(self.size)
        white[N_KNOTS] = 1.0 / FLOOR_SD
        rows = [(white, (NO_WHITE if self.alone else self.top - 1.0) / FLOOR_SD)]
        if self.shape is not None and not self.alone:
            both = np.zeros(self.size)
            both[N_KNOTS], both[N_KNOTS + 1] = -1.0 / COLOUR_SD, 1.0 / COLOUR_SD
            rows.append((both, 0.0))
        if self.known is not None:
            parts = np.zeros(self.size)
            parts[N_KNOTS] = np.exp(point[N_KNOTS]) * 0.5 * self.known.rate
            if self.shape is not None:
                parts[N_KNOTS + 1] = np.exp(point[N_KNOTS + 1]) * self.bandwidth
            variance = float(parts.sum())
            row = parts / variance / KNOWN_SD
            lacking = (2.0 * np.log(self.known.deviation) - np.log(variance)) / KNOWN_SD
            rows.append((row, float(row @ point) + lacking))
        return rows


def solve(
    data: Periodogram,
    colour: Colour,
    base: FloatArray,
    known: Known | None = None,
    start: Solution | None = None,
) -> Solution:
    """Most likely driver and sensor for a given colour of the sensor.

    Parameters
    ----------
    data : Periodogram
    colour : Colour
    base : array, shape (n,)
        Sensor density that is known already, at the data's frequencies. [m2/Hz]
    known : Known, optional
    start : Solution, optional
        To climb from, of the same colour.
    """
    problem = _Problem(data, colour, base, known)
    point = problem.start() if start is None else np.array([*start.knots, start.white, start.colour])[: problem.size]
    point, loss = climb(problem.at, point)
    coloured = float(point[N_KNOTS + 1]) if colour.order else -np.inf
    return Solution(point[:N_KNOTS], float(point[N_KNOTS]), coloured, loss)


def climb(
    at: Callable[[FloatArray], tuple[float, FloatArray, FloatArray]], point: FloatArray
) -> tuple[FloatArray, float]:
    """The least loss and where it is, by Fisher scoring from a point; `at` gives loss, gradient and information."""
    loss, gradient, information = at(point)
    for _ in range(ROUNDS):
        step = np.linalg.solve(information + 1e-6 * np.eye(len(point)), -gradient)
        step = np.clip(step, -LONGEST_STEP, LONGEST_STEP)
        length = 1.0
        tried = at(point + step)
        while tried[0] >= loss and length > 1e-3:
            length *= 0.4
            tried = at(point + length * step)
        if tried[0] >= loss:
            break
        gained = loss - tried[0]
        point = point + length * step
        loss, gradient, information = tried
        if gained < ENOUGH:
            break
    return point, loss
