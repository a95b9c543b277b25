"""The world that the simulated driver meets: a motorway with curves, traffic and weather, as time series."""

from __future__ import annotations

import numpy as np


def first_order(
    values: np.ndarray, keep: float, *, gain: float = 1.0, before: float | None = None, axis: int = -1
) -> np.ndarray:
    """``y[k] = keep * y[k - 1] + gain * values[k]``: a first-order lag, or the noise of an autoregression.

    Parameters
    ----------
    values : array
        Even in time along `axis`. [any unit]
    keep, gain : float
        exp(-step / time constant), 0 to 1; the gain is ``1 - keep`` for a lag that comes to rest at its input. [-]
    before : float, optional
        y before the first row, of a single series; 0 unless given. [unit of the values]

    Returns
    -------
    array, shape of `values`
        In the same unit.
    """
    from scipy.signal import lfilter

    if before is None:
        return np.asarray(lfilter([gain], [1.0, -keep], values, axis=axis), dtype=np.float64)
    return np.asarray(lfilter([gain], [1.0, -keep], values, axis=axis, zi=[keep * before])[0], dtype=np.float64)


def least_jerk(length: int) -> np.ndarray:
    """Share of the way that is done after each of so many steps, shape (length,): 10 u^3 - 15 u^4 + 6 u^5 [1]_. [-]

    How people move from one place of rest to another.

    References
    ----------
    .. [1] T. Flash, N. Hogan, "The coordination of arm movements: an experimentally confirmed mathematical model", J.
           Neuroscience 5, 1985, pp. 1688-1703.
    """
    done = np.arange(1, length + 1) / length
    return np.asarray(done**3 * (10.0 - 15.0 * done + 6.0 * done**2))


STEP = 0.02
"""Time between two simulated states. [s]"""

N_LANES = 3


def draw_motorway(duration: float, rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Every context column of a drive on the simulator's time grid, shape (n,) each, in the drive table's units.

    Nothing here knows the driver: columns that follow from steering are added by the simulator.
    """
    n = round(duration / STEP)
    speed = _speed(n, rng)
    curvature, crossfall = _curves(np.cumsum(speed) * STEP, rng)
    lane_index, lane_change = _lanes(n, rng)
    truck = _events(n, rng, gap=26.0, length=9.0) & (lane_index > 0)
    car = _events(n, rng, gap=45.0, length=5.0) & (lane_index < N_LANES - 1)
    daylight = _levels(n, rng, [400.0, 400.0, 400.0, 900.0, 6000.0, 20000.0], mean_length=420.0)
    return {
        "speed": speed,
        "curvature": curvature,
        "lane_index": lane_index.astype(float),
        "lane_change": lane_change,
        "lane_width": 3.5 + _ramped(_levels(n, rng, [-0.25, 0.0, 0.0, 0.25], mean_length=240.0), 8.0),
        "truck_right": truck.astype(float),
        "car_left": car.astype(float),
        "lead_distance": _leader(n, rng),
        "wind_speed": np.abs(6.0 + 4.5 * _first_order_noise(n, rng, 25.0)),
        "wind_direction": np.mod(180.0 + 110.0 * _first_order_noise(n, rng, 200.0), 360.0),
        "crossfall": crossfall,
        "rain": _ramped(_levels(n, rng, [0.0, 0.0, 2.0, 6.0], mean_length=300.0), 20.0),
        "air_temperature": 17.0 + 3.0 * _first_order_noise(n, rng, 900.0),
        "grade": 3.0 * _first_order_noise(n, rng, 40.0),
        "illuminance": _ramped(daylight, 5.0),
    }


def _first_order_noise(n: int, rng: np.random.Generator, time_constant: float) -> np.ndarray:
    """Stationary noise of unit variance with the given correlation time [s]."""
    keep = np.exp(-STEP / time_constant)
    noise = rng.normal(size=n) * np.sqrt(1.0 - keep**2)
    noise[0] = rng.normal()
    return first_order(noise, keep)


def _levels(n: int, rng: np.random.Generator, values: list[float], mean_length: float) -> np.ndarray:
    """A step function over `values`, each held for an exponential time, no shorter than a tenth of the mean [s]."""
    out = np.empty(n)
    start = 0
    while start < n:
        length = round((0.1 * mean_length + rng.exponential(0.9 * mean_length)) / STEP)
        out[start : start + length] = rng.choice(values)
        start += length
    return out


def _ramped(values: np.ndarray, length: float) -> np.ndarray:
    """Moving average over `length` [s]: steps become ramps."""
    half = round(0.5 * length / STEP)
    padded = np.concatenate([np.full(half + 1, values[0]), values, np.full(half, values[-1])])
    total = np.cumsum(padded)
    width = 2 * half
    return np.asarray((total[width:] - total[:-width])[: len(values)] / width)


def _speed(n: int, rng: np.random.Generator) -> np.ndarray:
    cruise = _ramped(_levels(n, rng, [24.0, 27.0, 30.0, 33.0, 36.0, 39.0], mean_length=150.0), 12.0)
    return cruise + 0.35 * _first_order_noise(n, rng, 12.0)


def _curves(distance: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Curvature [1/m] and crossfall [%] along the way: straights and arcs, joined by clothoids."""
    knots, curvature, bank = [0.0], [0.0], [-2.5]
    while knots[-1] < distance[-1]:
        straight = rng.uniform(50.0, 500.0)
        knots.append(knots[-1] + straight)
        curvature.append(0.0)
        bank.append(-2.5)
        bend = rng.choice([-1.0, 1.0]) / np.exp(rng.uniform(np.log(560.0), np.log(2000.0)))
        clothoid, arc = rng.uniform(80.0, 200.0), rng.uniform(150.0, 900.0)
        for length in (clothoid, arc):
            knots.append(knots[-1] + length)
            curvature.append(bend)
            bank.append(2.5 if bend < -1.0 / 1500.0 else -2.5)
        knots.append(knots[-1] + clothoid)
        curvature.append(0.0)
        bank.append(-2.5)
    return np.interp(distance, knots, curvature), np.interp(distance, knots, bank)


def _lanes(n: int, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Lane held at each step, and where the car is on its way from lane to lane (0..1 lanes to the left of `lane`).

    Returns
    -------
    lane_index : int array, shape (n,)
        The lane whose centre the driver's way is nearest to; 0 is the rightmost.
    way : array, shape (n,)
        Place of the driver's way in lanes from the centre of lane 0; whole numbers outside of lane changes. [-]
    """
    way = np.empty(n)
    lane, start = int(rng.integers(N_LANES)), 0
    while start < n:
        hold = round((25.0 + rng.exponential(115.0)) / STEP)
        way[start : start + hold] = lane
        start += hold
        target = lane + 1 if lane == 0 else lane - 1 if lane == N_LANES - 1 else lane + int(rng.choice([-1, 1]))
        length = round(rng.uniform(5.0, 8.0) / STEP)
        ease = least_jerk(length)
        part = way[start : start + length]
        part[:] = lane + (target - lane) * ease[: len(part)]
        start += length
        lane = target
    return np.rint(way).astype(np.int64), way


def _events(n: int, rng: np.random.Generator, gap: float, length: float) -> np.ndarray:
    """On and off: a neighbour alongside, again and again; mean gap and mean length in s."""
    out = np.zeros(n, dtype=bool)
    start = round(rng.exponential(gap) / STEP)
    while start < n:
        stop = start + round((0.3 * length + rng.exponential(0.7 * length)) / STEP)
        out[start:stop] = True
        start = stop + round((2.0 + rng.exponential(gap)) / STEP)
    return out


def _leader(n: int, rng: np.random.Generator) -> np.ndarray:
    """Distance to the car ahead [m]; NaN where there is none."""
    present = _events(n, rng, gap=28.0, length=32.0)
    distance = 62.0 + 16.0 * _first_order_noise(n, rng, 25.0)
    began = np.maximum.accumulate(np.where(np.diff(present, prepend=False) & present, np.arange(n), 0))
    other = rng.normal(scale=14.0, size=n)[began]  # every leader has a distance of his own
    return np.where(present, np.maximum(distance + other, 8.0), np.nan)
