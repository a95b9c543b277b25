"""Driver and sensor, separated in measured runs: by Whittle's likelihood of all colours that the noise may have.

References
----------
.. [1] P. Whittle, "Estimation and information in stationary time series", Arkiv för Matematik 2, 1953: the likelihood.
.. [2] G. Schwarz, "Estimating the dimension of a model", Annals of Statistics 6, 1978: the criterion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from dataclasses import replace as replaced
from functools import partial
from itertools import chain

import numpy as np

from xosc_lateral.base.arrays import NORMAL_95, FloatArray, all_significant, significant
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.drives.filters import mirrored, scale_frequencies
from xosc_lateral.drivers.fitting.sensor.likelihood import Colour, Known, SensorData, Solution, density, solve
from xosc_lateral.drivers.fitting.sensor.periodogram import (
    COARSE_STEP_RATIO,
    LEVEL_SD,
    PASSED_FREQUENCY,
    Periodogram,
    SecondView,
    periodogram,
    quantisation_step,
    rounding_density,
    second_view,
    uniform_variance,
    windows_of,
)
from xosc_lateral.drivers.model.sensor import SensorModel

CRITERION_MARGIN = 6.0
"""Explanations whose information criterion is within this of the best count for the interval: e^-3 as likely. [-]"""

BLOCKS = 8
"""Of windows, of which each is left out in turn for the interval. [-]"""

LEAST_LEVELS = 3
"""How often two levels are left is one number, and what lies behind them has two, mean and spread. [-]"""

ROUNDING_ROUNDS = 3

MOST_NOISE = 0.9
"""Share of what is rounded that noise may have: the rest is the driver's. [-]"""


@dataclass(frozen=True, eq=False)
class Separation:
    """Densities of driver and sensor."""

    knots: FloatArray  # Of the driver's density, see `KNOTS`.
    sensor: SensorModel
    # Density of what the sensor's numbers don't hold: of rounding, and of errors seen in a second view. [m2/Hz]
    beside: Callable[[FloatArray], FloatArray]

    def driver_part(self, offset: FloatArray, step: float) -> FloatArray:
        """The offset with every frequency scaled down to the driver's share of the power, about its own mean.

        Keeps the driver's spectrum (Wiener's filter would not: it leaves less than the driver's power), and the path
        itself wherever the sensor is good.
        """
        n = len(offset)
        if n < 2:
            return offset
        frequency: FloatArray = np.asarray(np.fft.rfftfreq(3 * n - 2, step), dtype=np.float64)
        driver, mean = density(self.knots, frequency), float(offset.mean())
        share = driver / (driver + self.sensor.density(frequency) + self.beside(frequency))
        share[0] = 1.0
        filtered = scale_frequencies(mirrored(offset - mean, n - 1), np.sqrt(share))
        return np.asarray(mean + filtered[n - 1 : 2 * n - 1])


def separate(
    runs: Sequence[FloatArray],
    step: float,
    *,
    rows: Sequence[FloatArray] | None = None,
    durations: Sequence[FloatArray] | None = None,
    rate: float | None = None,
    sensor_noise: float | None = None,
    half_widths: Sequence[FloatArray] | None = None,
    one_camera: bool = False,
    highest: float = PASSED_FREQUENCY,
) -> Separation:
    """Separate driver and sensor.

    Raises `NotEnoughDataError` if no run lasts 12.8 s; `DriverProfileError` if the error that is known is more than all
    that was measured.

    Of offsets [m] at an even step [s], up to a `highest` frequency [Hz]. `rows`: the same runs as recorded, in which
    variances are counted and rounding is detected [m]; `durations`: how long each row stands for, where rows are not
    even in time [s]; `rate`: rows per second, without as many as there are in the time of the runs [Hz].
    `sensor_noise`: standard deviation of the sensor's error on the rows, rounding included, where it is known [m].
    `half_widths`: half the lane width in the runs, where a camera measured it, a second view of its errors [m];
    `one_camera`: that is known to have measured the offset, else what the width shows is taken where plausible.
    """
    measured = list(rows) if rows is not None else list(runs)
    variance = _variance(measured, durations)
    frequency, windows = windows_of(runs, step)
    of_windows = partial(periodogram, frequency, highest=highest)
    data = of_windows(windows)
    per_second = rate or sum(map(len, measured)) / (step * sum(map(len, runs)))
    grain = quantisation_step(np.concatenate(measured))
    if sensor_noise is not None and 0.0 < variance <= sensor_noise**2 - uniform_variance(grain):
        raise DriverProfileError(
            f"a sensor error of {sensor_noise:g} m is more than all that was measured: offsets vary by "
            f"{np.sqrt(variance):.2g} m (standard deviation)"
        )
    too_coarse = (
        grain > COARSE_STEP_RATIO * np.sqrt(variance) or len(np.unique(np.concatenate(measured))) < LEAST_LEVELS
    )
    is_rounded = grain > 0.0 and not too_coarse
    rounding: Callable[[FloatArray], FloatArray] = np.zeros_like
    rounded_off = 0.0
    if is_rounded:
        rounding, rounded_off = _rounding(data, grain, variance, per_second), uniform_variance(grain)
    known = None if sensor_noise is None else Known(sensor_noise, per_second, rounded_off)
    asked = SensorData(data, rounding(data.frequency), known)
    view = second_view(half_widths, step) if half_widths else None
    candidates = explanations(asked, view, only_view=one_camera)
    least = _taken(candidates)
    best, colour = least.solution, least.colour
    beside = rounding
    if colour.view is not None:
        beside = lambda frequency: rounding(frequency) + best.coloured(colour, frequency)  # noqa: E731
    result = Separation(best.knots, _sensor(best, colour, grain), beside)
    driver = float(np.concatenate([result.driver_part(run, step) for run in runs]).var())
    error = _in_band(best, colour, data)
    share = min(driver, max(variance - error, 0.0)) / variance if variance > 0.0 else 1.0
    plausible = [(one.solution, one.colour) for one in candidates if one.criterion < least.criterion + CRITERION_MARGIN]
    if colour.view is not None:
        plausible += [(solve(asked, one, best), one) for one in _other_views(colour, colour.view)]
    interval = (0.0, 1.0) if too_coarse else _interval(of_windows, windows, least, asked, plausible, share)
    sensor = _sensor(best, colour, grain, share * variance, (1.0 - share) * variance, interval)
    return Separation(best.knots, sensor, beside)


def _taken(candidates: Sequence[Explanation]) -> Explanation:
    """Of those that are plausible: what another measurement supports, else no low-passed error, else the best one."""
    most = min(each.criterion for each in candidates) + CRITERION_MARGIN
    plausible = [each for each in candidates if each.criterion < most]
    return min(plausible, key=lambda each: (each.colour.view is None, each.colour.order > 0, each.criterion))


def _variance(rows: Sequence[FloatArray], durations: Sequence[FloatArray] | None) -> float:
    """Over time, as runs at an even step have it. [m2]"""
    values = np.concatenate(rows)
    if durations is None:
        return float(values.var())
    weights = np.concatenate(durations)
    return float(np.average((values - np.average(values, weights=weights)) ** 2, weights=weights))


def _other_views(colour: Colour, view: SecondView) -> list[Colour]:
    """The same, if no lane ever widened, and as far as 95 % of what pitch or errors of both markings alike make go."""
    shift = NORMAL_95 * LEVEL_SD
    others = [replaced(view, slowest=0.0), view.scaled(np.exp(-shift)), view.scaled(np.exp(shift))]
    return [replaced(colour, view=other) for other in others]


def _sensor(
    solution: Solution,
    colour: Colour,
    grain: float,
    driver: float = 0.0,
    rest: float = 0.0,
    interval: tuple[float, float] = (0.0, 1.0),
) -> SensorModel:
    level = float(np.exp(solution.colour))
    coloured, seen = (level, 0.0) if colour.view is None else (0.0, level)
    numbers = (np.exp(solution.white), coloured, colour.corner, driver, rest, *interval, seen)
    white, coloured, corner, driver, rest, low, high, seen = all_significant(numbers, DIGITS)
    return SensorModel(white, coloured, corner, colour.order, grain, driver, rest, (low, high), second_view=seen)


DIGITS = 7
"""Significant digits kept of a sensor's numbers: what differs beyond is the processor's rounding. [-]"""


def _rounding(data: Periodogram, grain: float, variance: float, rate: float) -> Callable[[FloatArray], FloatArray]:
    """Density of rounding, which depends on the driver's and the noise's, which depend on it: a few rounds."""
    error = uniform_variance(grain)
    level = 2.0 * error / rate  # white, to begin with
    shape: Callable[[FloatArray], FloatArray] = lambda frequency: np.full(np.shape(frequency), level)  # noqa: E731
    for _ in range(ROUNDING_ROUNDS):
        solution = solve(SensorData(data, shape(data.frequency)), Colour())
        noise = min(0.5 * float(np.exp(solution.white)) * rate, MOST_NOISE * (variance - error))
        spectrum = partial(density, solution.knots)
        shape = rounding_density(grain, spectrum, variance - error - noise, rate=rate, noise=noise)
    return shape


def _chance(solution: Solution, colour: Colour, data: Periodogram) -> float:
    """Standard error of what a second view says of a sensor's power: its errors are not the offset's own. [m2]

    Both are one draw each of the same density, of which a bin of weight w shows its mean to a share of 1 / sqrt(w).
    """
    power = solution.coloured(colour, data.frequency) * np.gradient(data.frequency)
    return float(np.sqrt((2.0 * power**2 / data.weight).sum()))


def _in_band(solution: Solution, colour: Colour, data: Periodogram) -> float:
    """Sensor's power among what was seen. [m2]"""
    from scipy.integrate import trapezoid

    frequency = np.linspace(0.0, float(data.frequency[-1]), 400)
    total = np.full(len(frequency), np.exp(solution.white))
    if colour.is_there:
        total += solution.coloured(colour, frequency)
    return float(trapezoid(total, frequency))


def _interval(
    of_windows: Callable[[FloatArray], Periodogram],
    windows: FloatArray,
    taken: Explanation,
    measured: SensorData,
    plausible: Sequence[tuple[Solution, Colour]],
    share: float,
) -> tuple[float, float]:
    """95 % interval of the driver's share: over what else would explain the data, and over blocks left out."""
    best, colour, data = taken.solution, taken.colour, measured.data
    seen = float((data.density[:-1] * np.diff(data.frequency)).sum())
    levels = np.array([_in_band(one, shape, data) for one, shape in plausible]) - _in_band(best, colour, data)
    blocks = np.array_split(np.arange(len(windows)), min(BLOCKS, len(windows)))
    left_out = []
    for block in blocks:
        others = np.setdiff1d(np.arange(len(windows)), block)
        if len(others):
            part = of_windows(windows[others])
            left_out.append(_in_band(solve(replaced(measured, data=part), colour, best), colour, part))
    error = np.sqrt((len(blocks) - 1) * np.var(left_out)) if len(left_out) > 1 else seen
    if colour.view is not None:
        error = np.hypot(error, _chance(best, colour, data))
    span = share / max(seen, 1e-30)
    low = share - span * (float(levels.max()) + NORMAL_95 * float(error))
    high = share - span * (float(levels.min()) - NORMAL_95 * float(error))
    return float(np.clip(low, 0.0, share)), float(np.clip(high, share, 1.0))


# ---- what may explain the runs ----
ORDERS = (1, 2, 4)
LOWEST_CORNER, HIGHEST_CORNER, CORNER_FACTOR = 0.05, 1.4, 1.3
"""Corners of the sensor's low-passed part from which the climb begins [Hz], and the factor from one to the next [-].
Slower ones lie where a driver's spectrum is free: nothing would separate them from him."""

LEAST_CORNER = {1: 0.0, 2: 0.38, 4: 0.38}
"""By order. A steep fall from a lower corner looks like a driver's own. [Hz]"""

CORNER_DIGITS = 3
"""That the climb resolves: the same on any machine. [-]"""

CLIMB_STEPS = 10
"""Steps of the climb between the best corner's neighbours: a hundredth of the corner. [-]"""


@dataclass(frozen=True, eq=False, slots=True)
class Explanation:
    """A colour, what is most likely with it, and the Bayesian information criterion: the lower, the better. [-]"""

    solution: Solution
    colour: Colour
    criterion: float


def explanations(measured: SensorData, view: SecondView | None = None, *, only_view: bool = False) -> list[Explanation]:
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
    families = (_of_family(measured, order, alone) for order in ORDERS for alone in (False, True))
    return [*candidates, *chain.from_iterable(families)]


def _of_family(measured: SensorData, order: int, alone: bool) -> Iterator[Explanation]:
    """Over a grid of corners, and between the neighbours of the best."""
    from scipy.optimize import minimize_scalar

    count = int(np.ceil(np.log(HIGHEST_CORNER / LOWEST_CORNER) / np.log(CORNER_FACTOR))) + 1
    tried_at = np.geomspace(LOWEST_CORNER, HIGHEST_CORNER, count)
    corners = all_significant(tried_at[tried_at >= LEAST_CORNER[order]], CORNER_DIGITS)
    grid = [_explanation(measured, Colour(order, corner, alone)) for corner in corners]
    yield from grid
    at = int(np.argmin([one.criterion for one in grid]))
    low, high = (float(np.log(corners[k])) for k in (max(at - 1, 0), min(at + 1, len(corners) - 1)))
    tried: list[Explanation] = []

    def lacking(log_corner: float) -> float:
        colour = Colour(order, significant(np.exp(log_corner), CORNER_DIGITS), alone)
        tried.append(_explanation(measured, colour, grid[at].solution))
        return tried[-1].criterion

    minimize_scalar(lacking, bounds=(low, high), method="bounded", options={"maxiter": CLIMB_STEPS, "xatol": 0.01})
    yield from tried


def _explanation(measured: SensorData, colour: Colour, start: Solution | None = None) -> Explanation:
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
