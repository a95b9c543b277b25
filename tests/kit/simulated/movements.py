"""Movements that no driver model made: what the loop must stay silent on, whatever moves the car.

Each movement knows nothing of the context columns that its table is given; so whatever a trace names there is chance.
They differ in what a test of significance may wrongly take for granted: short memory, normal innovations, fine
resolution, a linear pull to the middle, a steady loudness.

References
----------
.. [1] G. E. Uhlenbeck, L. S. Ornstein, "On the theory of the Brownian motion", Physical Review 36, 1930.
.. [2] C. W. J. Granger, "Long memory relationships and the aggregation of dynamic models", J. Econometrics 14, 1980.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from examples.driver_simulator.motorway import N_LANES, STEP, draw_motorway, first_order, least_jerk
from examples.driver_simulator.simulator import measure, sample_times

MOVEMENT_STEP = 0.1
"""Step of the movements [s]; the table interpolates between."""

Movement = Callable[..., np.ndarray]
"""Offset from the lane centre [m] at `n` steps of `MOVEMENT_STEP`, from `n` and a generator; and a told column."""


def record_movement(
    movement: Movement, duration: float, seed: int, *, resolution: float | None = None, told_of: str | None = None
) -> pd.DataFrame:
    """Record a movement, with the context of a motorway drive that it has nothing to do with.

    Parameters
    ----------
    movement : callable
    duration : float
        [s]
    seed : int
    resolution : float, optional
        Distances to the lane markings are multiples of it. [m]
    told_of : str, optional
        Column that `movement` is told after all, between 0 and 1, as its third argument.
    """
    streams = np.random.default_rng([20262, seed]).spawn(3)
    context = draw_motorway(duration, streams[0])
    n = len(context["speed"])
    grid = np.arange(0.0, n * STEP + MOVEMENT_STEP, MOVEMENT_STEP)
    told = []
    if told_of is not None:
        column = context[told_of]
        told = [np.interp(grid, STEP * np.arange(n), (column - column.min()) / np.ptp(column))]
    moved = np.interp(STEP * np.arange(n), grid, movement(len(grid), streams[1], *told))
    way, width = context.pop("lane_change"), context["lane_width"].mean()
    place = width * way + moved
    context["lane_index"] = np.clip(np.rint(place / width), 0, N_LANES - 1)
    time = sample_times(n * STEP, None, streams[2])
    table = measure(time, place - width * context["lane_index"], context, streams[2])
    if resolution is not None:
        sides = ["distance_left", "distance_right"]
        table[sides] = (np.rint(table[sides] / resolution) * resolution).round(3)
    return table


def ornstein_uhlenbeck(n: int, rng: np.random.Generator) -> np.ndarray:
    """Ornstein-Uhlenbeck movement of seconds about one of a minute. Shape (n,). [m]"""
    return 0.15 * _smooth(_first_order_noise(n, rng, 4.0)) + 0.12 * _first_order_noise(n, rng, 60.0)


def heavy_tailed(n: int, rng: np.random.Generator) -> np.ndarray:
    """Pushed by Student's t with three degrees of freedom: now and then by a lot. Shape (n,). [m]"""
    return 0.2 * _scaled(_smooth(_filtered(rng.standard_t(3.0, size=n), 5.0)))


def reflected(n: int, rng: np.random.Generator) -> np.ndarray:
    """Diffuses within a tolerance; having left it, the car is brought back to somewhere inside in two seconds.

    Shape (n,). [m]
    """
    tolerance, length = 0.35, round(2.0 / MOVEMENT_STEP)
    ease = least_jerk(length)
    steps = 0.09 * np.sqrt(MOVEMENT_STEP) * rng.normal(size=n)
    out = np.empty(n)
    place, at = 0.0, 0
    while at < n:
        place += steps[at]
        out[at] = place
        at += 1
        if abs(place) > tolerance:
            goal = rng.uniform(-0.6, 0.6) * tolerance
            part = out[at : at + length]
            part[:] = place + (goal - place) * ease[: len(part)]
            at, place = at + length, goal
    return _smooth(out)


def delayed_control(n: int, rng: np.random.Generator) -> np.ndarray:
    """A mass that is pulled to the middle and damped, both 0.4 s late, and pushed by coloured noise. Shape (n,). [m]"""
    late = round(0.4 / MOVEMENT_STEP)
    push = 0.1 * _first_order_noise(n, rng, 1.0)
    place, speed = np.zeros(n), np.zeros(n)
    for t in range(1, n):
        seen = max(t - 1 - late, 0)
        acceleration = -0.22 * place[seen] - 1.0 * speed[seen] + push[t]
        speed[t] = speed[t - 1] + MOVEMENT_STEP * acceleration
        place[t] = place[t - 1] + MOVEMENT_STEP * speed[t]
    return place


def clustered(n: int, rng: np.random.Generator) -> np.ndarray:
    """Loud and quiet by turns of seconds: how people correct, and no regime. Shape (n,). [m]"""
    loudness = np.exp(0.6 * _first_order_noise(n, rng, rng.uniform(2.0, 6.0)))
    return 0.2 * _scaled(_smooth(_filtered(loudness * rng.normal(size=n), 5.0)))


def bursts(n: int, rng: np.random.Generator) -> np.ndarray:
    """Corrections come in bursts: pushed three times as hard for 1 to 5 s, then hardly for 2 to 15. Shape (n,). [m]"""
    loud = np.empty(n)
    start, on = 0, False
    while start < n:
        stop = start + round((rng.uniform(1.0, 5.0) if on else rng.uniform(2.0, 15.0)) / MOVEMENT_STEP)
        loud[start:stop] = 3.0 if on else 1.0
        start, on = stop, not on
    return 0.2 * _scaled(_smooth(_filtered(loud * rng.normal(size=n), 5.0)))


def lopsided(n: int, rng: np.random.Generator) -> np.ndarray:
    """Pushed to one side seldom and far, to the other often and little: gamma with shape 0.7. Shape (n,). [m]"""
    pushes = rng.gamma(0.7, size=n) - 0.7
    return 0.2 * _scaled(_smooth(_filtered(pushes, 4.0)) + 0.4 * _first_order_noise(n, rng, 40.0))


def pursuit(n: int, rng: np.random.Generator) -> np.ndarray:
    """Goes to one place after the other, each by a smooth move of 2 to 8 s, and stays for up to 10 s.

    Shape (n,). [m]
    """
    out = np.empty(n)
    place, at = 0.0, 0
    while at < n:
        goal = 0.15 * rng.normal()
        move, stay = round(rng.uniform(2.0, 8.0) / MOVEMENT_STEP), round(rng.uniform(0.0, 10.0) / MOVEMENT_STEP)
        done = np.arange(1, move + 1) / move
        path = np.concatenate([place + (goal - place) * done**3 * (10.0 - 15.0 * done + 6.0 * done**2), [goal] * stay])
        out[at : at + len(path)] = path[: n - at]
        place, at = goal, at + len(path)
    return out + 0.02 * _smooth(_first_order_noise(n, rng, 1.0))


def oscillating(n: int, rng: np.random.Generator) -> np.ndarray:
    """Oscillates with a period of 14 s, a third of critically damped, kept up by noise. Shape (n,). [m]"""
    turn = 2.0 * np.pi * MOVEMENT_STEP / 14.0
    keep = np.exp(-0.33 * turn)
    cycle = lfilter([1.0], [1.0, -2.0 * keep * np.cos(turn), keep**2], rng.normal(size=n))
    return 0.2 * _scaled(_scaled(cycle) + 0.5 * _first_order_noise(n, rng, 40.0))


def sawtooth(n: int, rng: np.random.Generator) -> np.ndarray:
    """Drifts at a rate of its own for up to 40 s, is brought back within 2 s, and drifts anew. Shape (n,). [m]"""
    out = np.empty(n)
    at, place = 0, 0.0
    while at < n:
        rate, end = 0.03 * rng.normal(), rng.uniform(0.1, 0.5)
        drift = max(1, round(min((end - np.sign(rate) * place) / max(abs(rate), 5e-3), 40.0) / MOVEMENT_STEP))
        back = round(rng.uniform(1.0, 2.0) / MOVEMENT_STEP)
        top = place + rate * MOVEMENT_STEP * drift
        path = np.concatenate([np.linspace(place, top, drift), np.linspace(top, 0.05 * rng.normal(), back)])
        out[at : at + len(path)] = path[: n - at]
        at, place = at + len(path), path[-1]
    return _smooth(out) + 0.03 * _smooth(_first_order_noise(n, rng, 1.0))


def long_memory(n: int, rng: np.random.Generator) -> np.ndarray:
    """Flicker noise: movements of 1 to 200 s in equal parts [2]_, smoothed as a car's mass does. Shape (n,). [m]"""
    parts = (_first_order_noise(n, rng, constant) for constant in (1.0, 3.0, 8.0, 20.0, 60.0, 200.0))
    return 0.25 * _scaled(_smooth(sum(parts, start=np.zeros(n))))


def free_play(n: int, rng: np.random.Generator) -> np.ndarray:
    """A damped mass under coloured pushes, free within a play and held by a spring beyond it. Shape (n,). [m]"""
    play = rng.uniform(0.1, 0.2)
    push = 0.07 * _first_order_noise(n, rng, rng.uniform(1.0, 2.0))
    place, speed = np.zeros(n), np.zeros(n)
    for t in range(1, n):
        beyond = place[t - 1] - np.clip(place[t - 1], -play, play)
        speed[t] = speed[t - 1] + MOVEMENT_STEP * (push[t] - 0.6 * speed[t - 1] - 0.4 * beyond)
        place[t] = place[t - 1] + MOVEMENT_STEP * speed[t]
    return place


def zigzag(n: int, rng: np.random.Generator) -> np.ndarray:
    """Goes to one side at a rate of its own until it turns, the sooner the further out it is. Shape (n,). [m]"""
    velocity, place = np.empty(n), 0.0
    rate, side = 0.07, 1.0
    draws = rng.random(n)
    for t in range(n):
        if draws[t] < 0.2 * MOVEMENT_STEP * np.exp(np.clip(side * place / 0.1, -3.0, 3.0)):
            rate, side = 0.07 * np.exp(0.5 * rng.normal()), -side
        velocity[t] = side * rate
        place += MOVEMENT_STEP * velocity[t]
    return np.cumsum(_smooth(velocity)) * MOVEMENT_STEP + 0.02 * _smooth(_first_order_noise(n, rng, 1.0))


def rate_limited(n: int, rng: np.random.Generator) -> np.ndarray:
    """Follows a goal that wanders within ten seconds, at no more than 4 cm/s or so. Shape (n,). [m]"""
    goal = 0.25 * _first_order_noise(n, rng, rng.uniform(8.0, 15.0))
    limit = 0.04 * np.exp(0.3 * rng.normal())
    place = np.zeros(n)
    for t in range(1, n):
        speed = 0.5 * (goal[t] - place[t - 1])
        place[t] = place[t - 1] + MOVEMENT_STEP * np.clip(speed, -limit, limit)
    return _smooth(place) + 0.02 * _smooth(_first_order_noise(n, rng, 1.0))


def in_regimes(n: int, rng: np.random.Generator) -> np.ndarray:
    """For a minute at a time, pushed 2.5 times as hard; and then quiet for two. Shape (n,). [m]"""
    loud = np.ones(n)
    start, on = 0, False
    while start < n:
        stop = start + max(1, round(rng.exponential(60.0 if on else 120.0) / MOVEMENT_STEP))
        loud[start:stop] = 2.5 if on else 1.0
        start, on = stop, not on
    return 0.2 * _scaled(_smooth(_filtered(loud * rng.normal(size=n), 5.0)))


def held(n: int, rng: np.random.Generator, strength: np.ndarray) -> np.ndarray:
    """Drawn back to the middle the faster the more of `strength` there is, shape (n,), 0..1; the pushes stay the same.

    The rate is 0.05 1/s where there is none, and thirty times that where there is all of it.
    """
    rate = 0.05 * 30.0**strength
    pushes = 0.12 * np.sqrt(MOVEMENT_STEP) * rng.normal(size=n)
    place = np.zeros(n)
    for t in range(1, n):
        place[t] = place[t - 1] * (1.0 - MOVEMENT_STEP * rate[t]) + pushes[t]
    return _smooth(place)


def _first_order_noise(n: int, rng: np.random.Generator, time_constant: float) -> np.ndarray:
    return _scaled(_filtered(rng.normal(size=n), time_constant))


def _filtered(values: np.ndarray, time_constant: float) -> np.ndarray:
    return first_order(values, np.exp(-MOVEMENT_STEP / time_constant))


def _smooth(values: np.ndarray) -> np.ndarray:
    """Through two lags of 0.4 s: cars have mass."""
    keep = np.exp(-MOVEMENT_STEP / 0.4)
    return np.asarray(lfilter([(1.0 - keep) ** 2], np.convolve([1.0, -keep], [1.0, -keep]), values))


def _scaled(values: np.ndarray) -> np.ndarray:
    return np.asarray((values - values.mean()) / values.std())
