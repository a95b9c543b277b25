"""Whittle's likelihood [1]_ of driver plus sensor, and the colours of noise that may lie behind measured runs.

References
----------
.. [1] P. Whittle, "Estimation and information in stationary time series", Arkiv för Matematik 2, 1953.
.. [2] G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6, 1978: the criterion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.numbers import significant
from xosc_lateral.drivers.fitting.sensor.periodogram import LEVEL_SD, Periodogram, SecondView, climb
from xosc_lateral.drivers.fitting.sensor.vehicle_bound import KNOTS, N_KNOTS, N_STATE, interpolation, prior

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
        return np.asarray(1.0 / (1.0 + (frequency / self.corner) ** (2 * self.order)))

    def integral(self, highest: float) -> float:
        """Of the shape over all frequencies; of a second view, up to `highest`, that of the rows [Hz]."""
        if self.view is not None:
            return self.view.variance(highest)
        part = np.pi / (2 * self.order)
        return float(self.corner * part / np.sin(part))


@dataclass(frozen=True, slots=True)
class Known:
    """A sensor whose error is known."""

    deviation: float
    """Standard deviation on the table's rows. [m]"""
    rate: float
    """Rows per second. [Hz]"""
    rounding: float = 0.0
    """What rounding has of its square, which is known from the rows. [m2]"""


@dataclass(frozen=True, eq=False, slots=True)
class Solution:
    """The maximum."""

    state: FloatArray
    """The driver, shape (N_STATE,): log density at the knots, and the corner of corrections, see `vehicle_bound`."""
    white: float
    """Log densities of the sensor's two parts, of `colour` over its shape; -inf where there is none."""
    colour: float
    loss: float
    """Minus log posterior."""

    @property
    def knots(self) -> FloatArray:
        """Log density of the driver, shape (N_KNOTS,)."""
        return self.state[:N_KNOTS]

    def coloured(self, colour: Colour, frequency: FloatArray) -> FloatArray:
        """Density of the coloured part, which there is. [m2/Hz] Shape as `frequency` [Hz]."""
        return np.asarray(np.exp(self.colour) * colour.shape(frequency))


@dataclass(frozen=True, eq=False, slots=True)
class Measured:
    """What driver and sensor are to explain."""

    data: Periodogram
    base: FloatArray
    """Density of the sensor's that is known already, at the data's frequencies, shape (n,). [m2/Hz]"""
    known: Known | None = None


class _Problem:
    """Loss, gradient and Fisher information at a point (state, white, colour)."""

    def __init__(self, measured: Measured, colour: Colour) -> None:
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


def solve(measured: Measured, colour: Colour, start: Solution | None = None) -> Solution:
    """Most likely driver and sensor for a given colour of the sensor, climbed to from one of the same colour."""
    problem = _Problem(measured, colour)
    point = problem.start() if start is None else np.array([*start.state, start.white, start.colour])[: problem.size]
    point, loss = climb(problem.at, point)
    coloured = float(point[N_STATE + 1]) if colour.is_there else -np.inf
    return Solution(point[:N_STATE], float(point[N_STATE]), coloured, loss)


ORDERS = (1, 2, 4)
LOWEST_CORNER, HIGHEST_CORNER, GRID = 0.05, 1.4, 1.3
"""Corners of the sensor's low-passed part from which the climb begins [Hz], and the factor from one to the next [-].
Slower ones lie where a driver's spectrum is free: nothing would separate them from him."""

LEAST_CORNER = {1: 0.0, 2: 0.38, 4: 0.38}
"""By order. A steep fall from a lower corner looks like a driver's own. [Hz]"""

CLIMB = 10
"""Steps of the climb between the best corner's neighbours: a hundredth of the corner. [-]"""


@dataclass(frozen=True, eq=False, slots=True)
class Explanation:
    """A colour, what is most likely with it, and the Bayesian information criterion: the lower, the better. [-]"""

    solution: Solution
    colour: Colour
    criterion: float


def explanations(measured: Measured, view: SecondView | None = None, *, only_view: bool = False) -> list[Explanation]:
    """All that were tried; of a second view, also or only what it shows.

    A low-passed sensor needs no white noise beside it, and a white level that is there to spare lets a steeper low-pass
    imitate a flatter one, whose slow part would then be the driver's. So each order is tried with white noise and
    without, and its corner is climbed to: one that is off by a tenth moves a sensor's variance by as much.
    """
    seen = [] if view is None else [Colour(alone=alone, view=view) for alone in (False, True)]
    candidates = [_explanation(measured, colour) for colour in seen]
    if candidates and only_view:
        return candidates
    candidates.append(_explanation(measured, Colour()))
    for order in ORDERS:
        for alone in (False, True):
            candidates += _of_family(measured, order, alone)
    return candidates


def _of_family(measured: Measured, order: int, alone: bool) -> Iterator[Explanation]:
    """Over a grid of corners, and between the neighbours of the best."""
    from scipy.optimize import minimize_scalar

    count = int(np.ceil(np.log(HIGHEST_CORNER / LOWEST_CORNER) / np.log(GRID))) + 1
    corners = [_in_digits(c) for c in np.geomspace(LOWEST_CORNER, HIGHEST_CORNER, count) if c >= LEAST_CORNER[order]]
    grid = [_explanation(measured, Colour(order, corner, alone)) for corner in corners]
    yield from grid
    at = int(np.argmin([one.criterion for one in grid]))
    low, high = (float(np.log(corners[k])) for k in (max(at - 1, 0), min(at + 1, len(corners) - 1)))
    tried: list[Explanation] = []

    def lacking(log_corner: float) -> float:
        colour = Colour(order, _in_digits(np.exp(log_corner)), alone)
        tried.append(_explanation(measured, colour, grid[at].solution))
        return tried[-1].criterion

    minimize_scalar(lacking, bounds=(low, high), method="bounded", options={"maxiter": CLIMB, "xatol": 0.01})
    yield from tried


def _in_digits(corner: float) -> float:
    """To the digits that the climb resolves: the same on any machine. [Hz]"""
    return significant(corner, 3)


def _explanation(measured: Measured, colour: Colour, start: Solution | None = None) -> Explanation:
    """White noise has a level, a low-passed part a level and a corner: so many numbers are paid for.

    A second view has a level, too, and a shape that is known from as many windows as the data: its own chance costs a
    likelihood as much as fitting its knots would gain, half for each, which is given back.
    """
    solution = solve(measured, colour, start)
    numbers = 2 * bool(colour.order) + (colour.view is not None) + (not colour.alone)
    own_chance = 0 if colour.view is None else len(colour.view.knots)
    return Explanation(
        solution, colour, 2.0 * solution.loss + numbers * float(np.log(measured.data.count)) - own_chance
    )
