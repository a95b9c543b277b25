"""What may lie behind measured runs: colours of sensor noise, each with the driver that is most likely beside it.

A low-passed sensor needs no white noise beside it, and a white level that is there to spare lets a steeper low-pass
imitate a flatter one, whose slow part would then be the driver's. So each order is tried with white noise and without,
and its corner is climbed to: one that is off by a tenth moves a sensor's variance by as much.

References
----------
.. [1] G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6, 1978: the criterion.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.numbers import significant
from xosc_lateral.drivers.fitting.sensor.likelihood import Colour, Measured, Solution, solve
from xosc_lateral.drivers.fitting.sensor.second_view import SecondView

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
    """All that were tried; of a second view, also or only what it shows."""
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
