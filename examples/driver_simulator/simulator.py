"""A simulated human at the wheel of a simulated car.

The car: lateral position and heading relative to the lane, yaw rate that follows the steering wheel with a lag [1]_.
The human: sees position and heading late and inexactly, foresees the error some seconds ahead, lets it pass while it
is within a tolerance, and then corrects a part of it in one movement of the hand, with noise that grows with the
movement [2]_ [3]_. Between two corrections the hand only follows the road's curvature. No chains, bins or spectra:
nothing of the package's own model.

References
----------
.. [1] R. Rajamani, "Vehicle Dynamics and Control", 2012, chapter 2: steady-state yaw gain of the bicycle model.
.. [2] G. Markkula et al., "Sustained sensorimotor control as intermittent decisions about prediction errors",
   Biological Cybernetics 112, 2018: threshold on the predicted error, ballistic corrections.
.. [3] C. M. Harris, D. M. Wolpert, "Signal-dependent noise determines motor planning", Nature 394, 1998.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields

import numpy as np
import pandas as pd
from numba import njit

from .motorway import N_LANES, STEP, draw_motorway
from .plants import Context, Intent, Plant

WHEELBASE = 2.8  # [m]
STEERING_RATIO = 15.0  # steering wheel angle over road wheel angle [-]
CHARACTERISTIC_SPEED = 35.0  # understeer: the yaw gain falls beyond it [m/s]
YAW_LAG = 0.14  # yaw rate behind the steering angle [s]
STARTLE = 0.9  # a foreseen error that is noticed from the corner of the eye [m]
LINE_UP = 1.6  # time in which a heading error dies out while nothing else is corrected [s]
EASE = 2.4  # a change of mind about the place in the lane takes so long [s]
HARDEST = 1.5  # lateral acceleration of a lane change [m/s2]
NEUROMUSCULAR_LAG = 0.13  # wheel behind the hand's command, twice in a row [s]
FOLLOWING_LAG = 2 * NEUROMUSCULAR_LAG + YAW_LAG - 3 * STEP
"""How far ahead the hand follows the road: curves alone move nobody. A lag taken in steps is one step shorter. [s]"""


LEVELS = ("lane_index", "truck_right", "car_left")
"""Columns of whole numbers."""

SENSOR_NOISE = {
    "speed": 0.02,
    "curvature": 5e-6,
    "lead_distance": 0.35,
    "wind_speed": 0.3,
    "wind_direction": 2.0,
    "air_temperature": 0.03,
    "grade": 0.02,
    "steering_wheel_angle": 0.35,
    "yaw_rate": 0.0012,
}
"""Standard deviation of the noise by column, in the column's unit; the others are exact."""

DECIMALS = {
    "speed": 2,
    "curvature": 6,
    "lead_distance": 1,
    "wind_speed": 2,
    "wind_direction": 1,
    "crossfall": 2,
    "rain": 2,
} | {
    "air_temperature": 2,
    "grade": 3,
    "illuminance": 1,
    "steering_wheel_angle": 2,
    "yaw_rate": 4,
}


@dataclass(frozen=True)
class Driver:
    """A human, in numbers; the defaults are an ordinary one."""

    bias: float = 0.0
    """Offset held for the middle of the lane. [m]"""
    tolerance: float = 0.24
    """Foreseen error that is let pass. [m]"""
    preview: float = 2.3
    """How far ahead the error is foreseen. [s]"""
    delay: float = 0.15
    """From seeing to moving the hand. [s]"""
    gain: float = 0.8
    """Share of the foreseen error that one correction takes away. [-]"""
    refractory: float = 0.3
    """Time between two corrections, about. [s]"""
    motor_noise: float = 0.25
    """Standard deviation of a correction over its size. [-]"""
    tremor: float = 0.001
    """Movement of the hand within a second: standard deviation of the yaw rate that it would give. [rad/s]"""
    blur: float = 0.05
    """Error of the eye about the place in a second. [m]"""
    target_drift: float = 0.11
    """Drift of what feels like the middle: standard deviation. [m]"""
    target_drift_time: float = 55.0
    """Correlation time of it. [s]"""
    gusts: float = 0.095
    """Sideways velocity that road and air give the car. [m/s]"""


@dataclass(frozen=True, eq=False)
class Truth:
    """What lies behind a simulated drive; the code under test never sees it."""

    driver: Driver
    effects: tuple[Plant, ...]
    time: np.ndarray
    """Time of every row of the table. [s]"""
    offset: np.ndarray
    """Where the car really was, from the lane centre, left positive. [m]"""
    target: np.ndarray
    """Where the driver wanted it. [m]"""
    lane_change: np.ndarray
    """True while a lane change is under way."""
    corrections: int
    """How often the driver corrected."""


@dataclass(frozen=True, eq=False)
class SimulatedDrive:
    """A drive table with the truth behind it."""

    table: pd.DataFrame
    truth: Truth = field(repr=False)


def draw_driver(rng: np.random.Generator, spread: float = 0.25) -> Driver:
    """Draw somebody from the population: every trait differs by about `spread` (relative), the bias by 8 cm."""
    ordinary = Driver()
    traits = {
        f.name: getattr(ordinary, f.name) * math.exp(spread * rng.normal()) for f in fields(Driver) if f.name != "bias"
    }
    traits["preview"] = min(max(traits["preview"], 1.8), 3.0)  # less, and the car can't be held; more, and nobody looks
    traits["gain"] = min(traits["gain"], 1.1)
    return Driver(bias=0.08 * rng.normal(), **traits)


def simulate_drive(
    duration: float = 3000.0,
    seed: int = 0,
    *,
    driver: Driver | None = None,
    effects: Sequence[Plant] = (),
    sensor_rate: float | None = None,
    drop: Sequence[str] = (),
) -> SimulatedDrive:
    """Simulate one drive.

    Parameters
    ----------
    duration : float
        [s]
    seed : int
        Same seed and arguments, same table. The road, the traffic and the driver's noise don't depend on `effects`.
    driver : Driver, optional
        Default: somebody drawn from the population.
    effects : sequence of plants
        What the driver or the camera does beyond the ordinary.
    sensor_rate : float, optional
        Rows per second; default one of 18, 20, 25. [Hz]
    drop : sequence of str
        Columns left out of the table, such as the cause of an effect.

    Returns
    -------
    SimulatedDrive
        `table` with the columns of docs/formats.md, and `truth`.
    """
    streams = np.random.default_rng([20260, seed]).spawn(5)
    context = draw_motorway(duration, streams[0])
    n = len(context["speed"])
    driver = draw_driver(streams[1]) if driver is None else driver
    intent = Intent.neutral(n)
    for plant, stream in zip(effects, streams[2].spawn(max(1, len(effects))), strict=False):
        plant.apply(intent, context, stream)
    way = context.pop("lane_change")
    width = context["lane_width"].mean()
    aim = width * way + driver.bias + intent.target
    place, steering, yaw_rate, corrections = _steer(
        aim, context["curvature"], context["speed"], intent, driver, streams[3]
    )
    context["lane_index"] = np.clip(np.rint(place / width), 0, N_LANES - 1)
    offset = place - width * context["lane_index"]
    context |= {"steering_wheel_angle": np.degrees(steering), "yaw_rate": yaw_rate}
    time = sample_times(n * STEP, sensor_rate, streams[4])
    table = measure(time, offset + intent.camera, context, streams[4])
    rows = np.minimum(np.rint(time / STEP).astype(int), n - 1)
    target, changing = driver.bias + intent.target, way != np.rint(way)
    truth = Truth(driver, tuple(effects), time, offset[rows], target[rows], changing[rows], corrections)
    return SimulatedDrive(table.drop(columns=list(drop)), truth)


def simulate_population(n_drivers: int, duration: float = 1200.0, seed: int = 0, spread: float = 0.25) -> pd.DataFrame:
    """Drives of several people in one table; column `drive` names them."""
    tables = []
    for number in range(n_drivers):
        person = draw_driver(np.random.default_rng([20261, seed, number]), spread)
        table = simulate_drive(duration, seed * 1000 + number, driver=person).table
        tables.append(table.assign(drive=f"driver-{number:02d}"))
    return pd.concat(tables, ignore_index=True)


def _steer(
    aim: np.ndarray, curvature: np.ndarray, speed: np.ndarray, intent: Intent, driver: Driver, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, np.ndarray, int]:
    n = len(aim)
    noise = rng.normal(size=(7, n))
    traits = np.array([getattr(driver, f.name) for f in fields(Driver) if f.name != "bias"])
    aim = _eased(aim)
    rate = np.gradient(aim, STEP)
    sideways = np.gradient(rate, STEP)
    path = curvature + np.clip(sideways, -HARDEST, HARDEST) / speed**2  # the way that the human means to drive
    care = (intent.tolerance, intent.gain, intent.noise, intent.attention)
    position, angle, held, count = _loop(aim, rate, path, curvature, speed, *care, noise, traits)  # type: ignore[no-untyped-call]
    return position, angle, held, int(count)


def _eased(values: np.ndarray) -> np.ndarray:
    """Smoothed over `EASE`, without delay: a human sees a truck or a bend before it is there."""
    window = np.hanning(2 * round(0.5 * EASE / STEP) + 1)
    half = len(window) // 2
    padded = np.concatenate([np.full(half, values[0]), values, np.full(half, values[-1])])
    return np.asarray(np.convolve(padded, window / window.sum(), mode="valid"))


@njit(nogil=True)  # not cached: the cache holds the module's name, which depends on where this is started
def _loop(aim, aim_rate, path, curvature, speed, tolerance, gain, care, attention, noise, traits):  # type: ignore[no-untyped-def]
    """Car and human, step by step: place [m] in the frame of lane 0's centre, wheel angle [rad], yaw rate [rad/s]."""
    base_tolerance, preview, delay, base_gain, refractory, motor, tremor, blur, drift_size, drift_time, gusts = traits
    n = len(aim)
    place, steering, yaw = np.empty(n), np.empty(n), np.empty(n)
    y, heading, rate = aim[0], 0.0, curvature[0] * speed[0]
    # all of these are yaw rates: the command is what the human adds to following the road
    command, first, wheel, shake = 0.0, rate, rate, 0.0
    error_of_eye, drift, gust = 0.0, 0.0, 0.0
    back, ahead, onset = round(delay / STEP), round(preview / STEP), round(FOLLOWING_LAG / STEP)
    wait, limit, count = 0.0, base_tolerance, 0
    for i in range(n):
        v, past = speed[i], max(0, i - back)
        # what the human sees is old and blurred, and what feels like the middle of the lane drifts
        error_of_eye += -STEP * error_of_eye + blur * care[i] * math.sqrt(2.0 * STEP) * noise[0, i]
        drift += -STEP / drift_time * drift + drift_size * care[i] * math.sqrt(2.0 * STEP / drift_time) * noise[5, i]
        seen = place[past] if i > 0 else y
        slope = (y - seen) / (back * STEP) if i > back else 0.0
        foreseen = seen + error_of_eye + slope * preview - aim[min(n - 1, i + ahead)] - drift
        wait -= STEP
        looks = attention[i] > 0.5 or abs(foreseen) > STARTLE
        if wait <= 0.0 and looks and abs(foreseen) > limit * tolerance[i]:
            # a constant yaw rate r moves the car sideways by v r T^2 / 2 within the preview time T
            share = min(base_gain * gain[i], 1.2)
            command = -share * foreseen * 2.0 / (v * preview * preview) * (1.0 + motor * noise[1, i])
            limit = base_tolerance * math.exp(0.5 * noise[2, i])
            wait = refractory * math.exp(0.3 * noise[6, i])
            count += 1
        elif wait <= 0.0:
            # nothing to correct: the hand lets the car line up with its way, wherever in the lane that is
            command += STEP / 0.6 * (gain[i] * (aim_rate[i] - slope) / (v * LINE_UP) - command)
        shake += -STEP / 0.7 * shake + tremor * care[i] * math.sqrt(2.0 * STEP / 0.7) * noise[3, i]
        wanted = command + shake + path[min(n - 1, i + onset)] * v
        first += STEP / NEUROMUSCULAR_LAG * (wanted - first)
        wheel += STEP / NEUROMUSCULAR_LAG * (first - wheel)
        rate += STEP / YAW_LAG * (wheel - rate)
        gust += -STEP / 0.6 * gust + gusts * math.sqrt(2.0 * STEP / 0.6) * noise[4, i]
        heading += STEP * (rate - curvature[i] * v)
        y += STEP * (v * heading + gust)
        place[i], yaw[i] = y, rate
        steering[i] = wheel * STEERING_RATIO * WHEELBASE / v * (1.0 + (v / CHARACTERISTIC_SPEED) ** 2)
    return place, steering, yaw, count


def sample_times(duration: float, rate: float | None, rng: np.random.Generator) -> np.ndarray:
    """Time stamps of the log [s]: jittered, to the millisecond, and now and then some rows are lost. Shape (n,)."""
    rate = float(rng.choice([18.0, 20.0, 25.0])) if rate is None else rate
    regular = np.arange(0.0, duration - 2.0 / rate, 1.0 / rate)
    jittered = np.maximum(regular + rng.normal(scale=0.12 / rate, size=len(regular)), 0.0)
    burst = np.repeat(rng.random(len(regular) // 3 + 1) < 0.0003, 3)[: len(regular)]
    kept = np.round(np.sort(jittered[~burst & (rng.random(len(regular)) > 0.0015)]), 3)
    return kept[np.diff(kept, prepend=-1.0) > 0.0]


def measure(time: np.ndarray, offset: np.ndarray, context: Context, rng: np.random.Generator) -> pd.DataFrame:
    """What the sensors log at the given times: noise, and the resolution of each signal.

    `time` [s] and `offset` [m] of shape (n,).
    """
    nearest = np.minimum(np.rint(time / STEP).astype(int), len(offset) - 1)
    grid = STEP * np.arange(len(offset))

    def continuous(values: np.ndarray) -> np.ndarray:
        return np.asarray(np.interp(time, grid, values))

    half = 0.5 * continuous(context["lane_width"])
    # a camera sees both markings with the same shake, and each with a noise of its own
    place = np.where(_jumps(offset)[nearest], offset[nearest], continuous(offset)) + rng.normal(
        scale=0.009, size=len(time)
    )
    logged = {
        "time": time,
        "distance_left": half - place + rng.normal(scale=0.009, size=len(time)),
        "distance_right": half + place + rng.normal(scale=0.009, size=len(time)),
    }
    for name, values in context.items():
        if name == "lane_width":
            continue
        stepwise = name in LEVELS or np.isnan(values).any()
        row = values[nearest] if stepwise or name == "wind_direction" else continuous(values)
        logged[name] = row + SENSOR_NOISE.get(name, 0.0) * rng.normal(size=len(time))
    logged["wind_speed"] = np.abs(logged["wind_speed"])
    logged["wind_direction"] = np.mod(logged["wind_direction"], 360.0)
    table = pd.DataFrame(logged).round({"distance_left": 3, "distance_right": 3} | DECIMALS)
    return table.astype(dict.fromkeys(LEVELS, np.int64))


def _jumps(offset: np.ndarray) -> np.ndarray:
    """Where the lane that the offset refers to changes: nothing is interpolated there."""
    change = np.abs(np.diff(offset)) > 1.0
    return np.asarray(np.concatenate([change, [False]]) | np.concatenate([[False], change]))
