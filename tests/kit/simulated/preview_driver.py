"""A second simulator of drives: two-point preview steering of a single-track car by late and intermittent hands.

A driver looks at a far point for the road's bend and at a near point for the place in the lane [1]_, acts after a delay
and through the neuromuscular system's lag [2]_, and only when what is needed differs from what the hands do. The car is
a linear single-track model [3]_. The road has straights, clothoids and arcs; a driver cuts its bends. The log has
columns of the road, the weather, the traffic, the driver and the car itself, among them consequences of the movement
(a lane departure warning with hysteresis) and clocks (a battery, an odometer, a counter of frames).

References
----------
.. [1] D. Salvucci, R. Gray, "A two-point visual control model of steering", Perception 33, 2004.
.. [2] D. Pick, D. Cole, "A mathematical model of driver steering control including neuromuscular dynamics", J. Dynamic
   Systems, Measurement and Control 130, 2008.
.. [3] R. Rajamani, "Vehicle Dynamics and Control", 2012, chapter 2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter1d

from xosc_lateral.base.lazy import njit

Values = np.ndarray
Context = Mapping[str, Values]

STEP, EVERY = 0.02, 5
"""Time between two states [s]; rows of the log are so many states apart (10 Hz)."""

MASS, YAW_INERTIA, FRONT, REAR, STIFF_FRONT, STIFF_REAR = 1500.0, 2600.0, 1.25, 1.45, 110e3, 120e3
"""Of the car. [kg], [kg m2], axles from the centre of mass [m], cornering stiffness per axle [N/rad]"""

WARN_ON, WARN_OFF = 0.62, 0.52
"""Distance from the lane centre from which the lane departure warning is on, and below which it ends. [m]"""


@dataclass(frozen=True)
class Act:
    """What is planted in a drive: how the target [m] and the log of the spread [-] depend on context and time [s]."""

    target: Callable[[Context, Values], Values] | None = None
    log_spread: Callable[[Context, Values], Values] | None = None
    camera: Callable[[Values], Values] | None = None
    columns: tuple[str, ...] = ()
    """By which it may rightly be named; empty: time."""


def kinds() -> dict[str, Act]:
    """Every kind of drive by name. Bends act on all of them."""

    def near(c: Context, scale: float) -> Values:
        return np.nan_to_num(np.exp(-c["lead_distance"] / scale))

    return {
        "bends": Act(),
        "wind": Act(lambda c, t: 0.030 * _late(c["wind_speed"] - 6.0, 1.5), columns=("wind_speed",)),
        "lead_saturating": Act(
            lambda c, t: -0.40 * _late(np.nan_to_num(1.0 / (1.0 + np.exp((c["lead_distance"] - 45.0) / 6.0))), 1.5),
            columns=("lead_distance",),
        ),
        "lead_in_lane": Act(
            lambda c, t: 0.45 * _late(near(c, 50.0) * (c["lane_index"] == 1), 1.5),
            columns=("lead_distance", "lane_index"),
        ),
        "truck": Act(lambda c, t: 0.28 * _late(c["truck_right"], 1.2), columns=("truck_right",)),
        "light": Act(
            log_spread=lambda c, t: -0.24 * (np.log(c["illuminance"]) - np.log(4000.0)), columns=("illuminance",)
        ),
        "rain": Act(log_spread=lambda c, t: 0.11 * c["rain"], columns=("rain",)),
        "learning": Act(log_spread=lambda c, t: 0.75 * np.exp(-t / 420.0)),
        "settling": Act(lambda c, t: 0.90 * np.exp(-t / 420.0)),
        "fatigue": Act(log_spread=lambda c, t: 0.42 * np.cos(2.0 * np.pi * (t / t[-1] - 0.5))),
        "two_drivers": Act(
            lambda c, t: np.where(t < 0.5 * t[-1], -0.22, 0.22),
            lambda c, t: np.where(t < 0.5 * t[-1], -0.12, 0.12),
        ),
        "camera": Act(camera=lambda t: np.where(t < 0.37 * t[-1], -0.18, 0.18)),
    }


@dataclass(frozen=True, eq=False)
class PreviewDrive:
    """A drive and what lies behind it."""

    table: pd.DataFrame
    kind: str
    act: Act
    context: dict[str, Values] = field(repr=False)


def _late(values: Values, seconds: float) -> Values:
    """Smoothed over seconds, half of them in advance: drivers see things come."""
    return np.asarray(gaussian_filter1d(values.astype(float), seconds / STEP, mode="nearest"))


def _noise(n: int, rng: np.random.Generator, correlation_s: float) -> Values:
    from scipy.signal import lfilter

    keep = np.exp(-STEP / correlation_s)
    white = rng.normal(size=n) * np.sqrt(1.0 - keep**2)
    white[0] = rng.normal()
    return np.asarray(lfilter([1.0], [1.0, -keep], white))


def _held(n: int, rng: np.random.Generator, values: list[float], mean_s: float, ramp_s: float = 0.0) -> Values:
    out, at = np.empty(n), 0
    while at < n:
        length = max(1, round(rng.exponential(mean_s) / STEP))
        out[at : at + length] = rng.choice(values)
        at += length
    return np.asarray(gaussian_filter1d(out, 0.5 * ramp_s / STEP, mode="nearest")) if ramp_s else out


def _on(n: int, rng: np.random.Generator, gap_s: float, length_s: float) -> Values:
    out, at = np.zeros(n), rng.exponential(gap_s)
    while at < n * STEP:
        length = rng.gamma(3.0, length_s / 3.0)
        out[round(at / STEP) : round((at + length) / STEP)] = 1.0
        at += length + 2.0 + rng.exponential(gap_s)
    return out


def _road(distance: Values, rng: np.random.Generator) -> tuple[Values, Values]:
    """Curvature [1/m] and crossfall [%]: straights, clothoids, arcs of 350 m to 1800 m."""
    at, curvature, fall = [0.0], [0.0], [2.5]
    while at[-1] < distance[-1]:
        at.append(at[-1] + rng.uniform(40.0, 450.0))
        curvature.append(0.0)
        fall.append(2.5)
        bend = float(rng.choice([-1.0, 1.0])) / np.exp(rng.uniform(np.log(350.0), np.log(1800.0)))
        for length in (rng.uniform(60.0, 140.0), rng.uniform(80.0, 500.0)):
            at.append(at[-1] + length)
            curvature.append(bend)
            fall.append(-np.clip(2500.0 * bend, -6.0, 6.0) if abs(bend) > 1.0 / 1500.0 else 2.5)
        at.append(at[-1] + rng.uniform(60.0, 140.0))
        curvature.append(0.0)
        fall.append(2.5)
    return np.interp(distance, at, curvature), np.interp(distance, at, fall)


def _world(n: int, rng: np.random.Generator) -> dict[str, Values]:
    speed = 26.0 + _held(n, rng, [-6.0, -3.0, 0.0, 3.0, 6.0], 120.0, 12.0) + 0.3 * _noise(n, rng, 10.0)
    curvature, crossfall = _road(np.cumsum(speed) * STEP, rng)
    lead = _on(n, rng, 25.0, 35.0) > 0.0
    distance = np.maximum(60.0 + 22.0 * _noise(n, rng, 30.0), 8.0)
    lanes = _held(n, rng, [0.0, 1.0, 2.0], 150.0)
    light = np.exp(_held(n, rng, [np.log(400.0), np.log(4000.0), np.log(30000.0)], 260.0, 8.0))
    return {
        "speed": speed,
        "curvature": curvature,
        "crossfall": crossfall,
        "grade": 2.5 * _noise(n, rng, 40.0),
        "lane_index": lanes,
        "roughness": np.exp(0.5 * _noise(n, rng, 60.0)),
        "bridge": _on(n, rng, 150.0, 12.0),
        "guardrail_right": _on(n, rng, 60.0, 60.0),
        "wind_speed": np.abs(6.0 + 4.0 * _noise(n, rng, 25.0)),
        "wind_direction": np.mod(180.0 + 100.0 * _noise(n, rng, 200.0), 360.0),
        "rain": np.maximum(_held(n, rng, [0.0, 0.0, 2.0, 6.0], 300.0, 20.0), 0.0),
        "air_temperature": 12.0 + 4.0 * _noise(n, rng, 900.0),
        "illuminance": light,
        "visibility": 2000.0 * np.exp(0.4 * _noise(n, rng, 300.0)),
        "lead_distance": np.where(lead, distance, np.nan),
        "lead_speed": np.where(lead, speed + 1.5 * _noise(n, rng, 20.0), np.nan),
        "truck_right": _on(n, rng, 28.0, 9.0) * (lanes > 0),
        "car_left": _on(n, rng, 40.0, 5.0) * (lanes < 2),
        "gap_behind": np.where(
            _on(n, rng, 40.0, 40.0) > 0.0, np.maximum(45.0 + 15.0 * _noise(n, rng, 30.0), 5.0), np.nan
        ),
        "vehicles_in_view": np.round(np.maximum(6.0 + 3.0 * _noise(n, rng, 90.0), 0.0)),
        "phone_ringing": _on(n, rng, 240.0, 10.0),
        "heart_rate": 72.0 + 5.0 * _noise(n, rng, 45.0),
        "radio_volume": np.round(_held(n, rng, [0.0, 8.0, 12.0, 15.0], 200.0)),
        "cabin_temperature": 21.0 + _noise(n, rng, 400.0),
        "fan_level": _held(n, rng, [1.0, 2.0, 3.0], 300.0),
        "engine_torque": 120.0 + 40.0 * _noise(n, rng, 8.0),
        "gps_accuracy": np.exp(0.3 * _noise(n, rng, 60.0)),
        "tyre_noise": 60.0 + 2.0 * _noise(n, rng, 15.0),
    }


def simulate(kind: str, seed: int, duration: float = 3000.0) -> PreviewDrive:
    """One drive of a kind; same kind and seed, same table."""
    world_rng, hand_rng, log_rng, trait_rng = np.random.default_rng([61, seed]).spawn(4)
    act = kinds()[kind]
    n = round(duration / STEP)
    context = _world(n, world_rng)
    time = STEP * np.arange(n)
    share = np.exp(0.2 * trait_rng.normal(size=6))
    target = 85.0 * share[0] * _late(context["curvature"], 0.6) + 0.05 * trait_rng.normal()
    target = target + (act.target(context, time) if act.target else 0.0)
    spread = np.exp(act.log_spread(context, time)) if act.log_spread else np.ones(n)
    lane = context["lane_index"]
    place, heading, yaw, wheel = _drive(  # type: ignore[no-untyped-call]
        target, context["curvature"], context["speed"], spread, hand_rng.normal(size=(6, n)), share
    )
    change = np.flatnonzero(np.diff(lane)) + 1
    camera = act.camera(time) if act.camera else np.zeros(n)
    seen = place + camera
    warning, on = np.zeros(n), False
    for row in range(n):  # of what the camera sees
        on = abs(seen[row]) > (WARN_OFF if on else WARN_ON)
        warning[row] = on
    speed = context["speed"]
    sideways = speed * heading
    own = {
        "steering_wheel_angle": np.degrees(15.0 * wheel) + 0.2 * log_rng.normal(size=n),
        "yaw_rate": yaw + 0.001 * log_rng.normal(size=n),
        "lateral_acceleration": speed * yaw + 0.05 * log_rng.normal(size=n),
        "lateral_speed": sideways + 0.01 * log_rng.normal(size=n),
        "steering_torque": np.gradient(wheel, STEP) * 6.0 + wheel * 20.0 + 0.05 * log_rng.normal(size=n),
        "roll": 0.02 * speed * yaw + 0.03 * log_rng.normal(size=n),
        "lane_departure_warning": warning,
        "battery_soc": np.round(88.0 - 34.0 * np.cumsum(speed) / np.sum(speed) + 0.02 * _noise(n, log_rng, 5.0), 2),
        "frame_id": np.arange(n) // EVERY,
        "odometer_km": np.round(41234.0 + np.cumsum(speed) * STEP / 1000.0, 2),
    }
    rows = np.arange(0, n, EVERY)
    away = np.min(np.abs(rows[:, None] - change), axis=1, initial=n) * STEP if len(change) else np.full(len(rows), n)
    kept = rows[away > 5.0]  # no lane change is simulated: its surroundings are left out of the log
    width = 3.6
    noise = 0.012 * log_rng.normal(size=n)
    table = pd.DataFrame(
        {"time": np.round(time[kept], 3), "offset": np.round((seen + noise)[kept], 4), "lane_width": width}
    )
    for name, values in (context | own).items():
        table[name] = np.round(values[kept], 6)
    return PreviewDrive(table, kind, act, context)


@njit
def _drive(target, curvature, speed, spread, noise, share):  # type: ignore[no-untyped-def]
    """Place [m] and heading [rad] relative to the lane, yaw rate [rad/s], road wheel angle [rad]; step by step."""
    n = len(target)
    place, angle, rates, steered = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    y, psi, sideslip, rate = 0.0, 0.0, 0.0, 0.0
    wanted, first, wheel = 0.0, 0.0, 0.0
    eye, mood, gust, wait = 0.0, 0.0, 0.0, 0.0
    far, near = round(0.75 / STEP), 1.7 * share[1]
    back = round(0.18 * share[2] / STEP)
    understeer = MASS / (FRONT + REAR) * (REAR / STIFF_FRONT - FRONT / STIFF_REAR)
    for i in range(n):
        v = speed[i]
        # noise of the eye, of what feels like the right place, and of air and road
        eye += -STEP / 0.9 * eye + 0.06 * spread[i] * share[3] * np.sqrt(2.0 * STEP / 0.9) * noise[0, i]
        mood += -STEP / 22.0 * mood + 0.15 * spread[i] * share[4] * np.sqrt(2.0 * STEP / 22.0) * noise[1, i]
        gust += -STEP / 0.8 * gust + 0.10 * spread[i] * np.sqrt(2.0 * STEP / 0.8) * noise[2, i]
        past = max(0, i - back)
        seen, turned = (place[past], angle[past]) if i > 0 else (y, psi)
        error = seen + near * v * turned + eye - target[i] - mood
        path = 0.85 * curvature[min(n - 1, i + far)] - 0.55 * share[5] * 2.0 * error / (near * v) ** 2
        need = path * (FRONT + REAR + understeer * v * v)
        wait -= STEP
        if wait <= 0.0 and abs(need - wanted) > 0.0012 * np.exp(0.4 * noise[3, i]):
            wanted = need * (1.0 + 0.08 * noise[4, i])
            wait = 0.25 * np.exp(0.3 * noise[5, i])
        first += STEP / 0.10 * (wanted - first)
        wheel += STEP / 0.10 * (first - wheel)
        front = STIFF_FRONT * (wheel - (sideslip + FRONT * rate / v))
        rear = STIFF_REAR * (-(sideslip - REAR * rate / v))
        sideslip += STEP * ((front + rear) / (MASS * v) - rate)
        rate += STEP * (FRONT * front - REAR * rear) / YAW_INERTIA
        psi += STEP * (rate - v * curvature[i])
        y += STEP * (v * (psi + sideslip) + gust)
        place[i], angle[i], rates[i], steered[i] = y, psi + sideslip, rate, wheel
    return place, angle, rates, steered


DESIGN, VALIDATION, TEST = (
    {name: first + number for number, name in enumerate(kinds())} for first in (1000, 2100, 3000)
)
"""Seed of each kind's drive. The method was made on the first, looked at once on the second, and once more on the
third when it was done (docs/validation/identification.md)."""
