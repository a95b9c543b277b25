"""From a driver's curve to where his vehicle is: what leads over to his path, slow driving, moving aside.

A vehicle's path has no corner (`LARGEST_TURN_RATE`): where a maneuver has moved it, its path leads over from there to
the driver's; below 40 km/h there is less of the driver's movement.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.world.motion.trajectory import SETTLING_TIME, settle, smoother_step
from xosc_lateral.world.surroundings.around import smooth_step
from xosc_lateral.world.surroundings.context import STEERING_DURATION

LARGEST_TURN_RATE = 0.03
"""Change of heading per time that nobody takes for a corner of the path: 0.3 mrad in a step of 0.01 s. [rad/s]"""

LEADING_OVER_SHARE = 0.5
"""Part of `LARGEST_TURN_RATE` that leading over to the path may take; the driver's own movement has the rest. [-]"""

STEP_PEAK = 10.0 / np.sqrt(3.0)
"""Largest second derivative of the smooth step from 0 to 1 in unit time (of 10 u^3 - 15 u^4 + 6 u^5, by hand). [-]"""

STANDSTILL = 0.1
"""Below this speed a path has no direction. [m/s]"""

SPEEDS_REMEMBERED = 6
"""Model steps of speed remembered: acceleration is over one second, as in a conversion. [-]"""

NEGLIGIBLE_REST = 1e-12
"""A remainder this small is none. [m]"""

DRIVER = np.dtype(
    [("curve", float, 6), ("begun", bool), ("following", bool), ("place", float), ("own", float),
     ("rest", float), ("from", float), ("from_rate", float), ("share", float), ("over", float), ("slip", float),
     ("aside", float), ("aside_rate", float), ("wanted", float), ("speeds", float, SPEEDS_REMEMBERED)]
)  # fmt: skip
"""A driver beside his random numbers.

His curve until the next model step and whether it has begun; whether the vehicle followed the road a step ago, where it
was, and the driver's own offset there [m]; what leads over to his path: `rest` [m], from `from` [m] at `from_rate`
[m/s], done to `share` [-] of `over` [s], plus what slow driving left out (`slip` [m]); how far he has moved aside, how
fast, and how far he wants to; speeds of the last second.
"""


class Moves(NamedTuple):
    """Where drivers are, by the rows of the moment, shape (n,) each; where nobody of ours drives, as it was.

    Offset from the lane's centre, positive left [m], its rate [m/s], the heading relative to the lane, positive left
    [rad], and whether it is the driver's (else the simulation's, or there is none).
    """

    offset: FloatArray
    rate: FloatArray
    heading: FloatArray
    steered: BoolArray

    def by_name(self, names: Sequence[str]) -> dict[str, tuple[float, bool]]:
        """Offset [m], and whether it is the driver's, of each."""
        return dict(zip(names, zip(self.offset.tolist(), self.steered.tolist(), strict=True), strict=True))


def drive_on(
    state: NDArray[Any],
    u: float,
    step: float,
    passed: float | None,
    speed: FloatArray,
    offset: FloatArray,
    base: FloatArray,
    following: BoolArray,
) -> tuple[NDArray[Any], Moves]:
    """The drivers' states (`DRIVER`) and moves at `u`, 0 to 1, of their curves, each of a `step` [s], shape (n,) each.

    After so much time [s], None at the simulation's first step; see `Moment` for speed [m/s], offset, base [m] and
    following.
    """
    is_first, passed = passed is None, passed or 0.0
    powers = u ** np.arange(6)
    driver = state["curve"] @ powers
    driver_rate = state["curve"][:, 1:] @ (np.arange(1, 6) * powers[:-1]) / step
    pace = _pace(speed)
    is_driven = following & state["begun"]
    taken_over = is_driven & ~state["following"]
    was_rate = np.where(passed > 0.0, (offset - state["place"]) / max(passed, 1e-9), 0.0)
    _move_aside(state, passed * pace)
    aside, aside_rate = state["aside"], state["aside_rate"] * pace
    if is_first:  # who drives, began so; who is slow or stands stays where it is, and is led over as it drives off
        state["rest"][taken_over] = 0.0
        slow = taken_over & (pace < 1.0)
        _lead_over(state, slow, offset - base - driver - aside, np.zeros(len(state)), speed)
    elif taken_over.any():
        was_rate = np.where(np.abs(was_rate) < np.maximum(0.2 * np.abs(speed), 0.1), was_rate, 0.0)  # placed anew
        was_rate = np.where(state["place"] == 0.0, 0.0, was_rate)
        gap_rate = was_rate - driver_rate * pace - aside_rate
        gap = offset - base - driver - aside + (driver_rate * pace + aside_rate) * passed  # a step ago
        _lead_over(state, taken_over, gap, gap_rate, speed)
    went_on = is_driven & state["following"]
    state["slip"] = np.where(went_on, state["slip"] - (1.0 - pace) * (driver - state["own"]), 0.0)
    slipped = is_driven & (state["over"] <= 0.0) & (np.abs(state["slip"]) > NEGLIGIBLE_REST)
    if slipped.any():
        _lead_over(state, slipped, state["slip"], np.zeros(len(state)), speed)
        state["slip"][slipped] = 0.0
    rest_rate = _settle(state, passed * pace) * pace
    place = np.where(is_driven, base + driver + state["rest"] + state["slip"] + aside, offset)
    rate = np.where(is_driven, driver_rate * pace + rest_rate + aside_rate, was_rate * (passed > 0.0))
    moving = np.abs(speed) > STANDSTILL
    sine = np.divide(rate, speed, out=np.zeros(len(state)), where=moving)
    heading = np.arcsin(np.clip(sine, -1.0, 1.0))
    state["following"], state["place"], state["own"] = is_driven, place, driver
    return state, Moves(place, np.where(is_driven, rate, 0.0), np.where(is_driven, heading, 0.0), is_driven)


def _pace(speed: FloatArray) -> FloatArray:
    """How much of the driver's lateral movement there is, shape as the speed [m/s]. [-]

    All from 40 km/h on; below, less, so that a path runs along the lane where its car stops and drives on.
    """
    u = np.abs(speed) / MINIMUM_SPEED
    u = np.where(u > 1.0 - 1e-6, 1.0, u)  # 11.1111 m/s are meant as 40 km/h
    return smooth_step(u)


def _move_aside(state: NDArray[Any], passed: FloatArray) -> None:
    """Two equal first-order lags towards what is wanted, solved exactly; drivers respond within `STEERING_DURATION`."""
    keep = np.exp(-passed / STEERING_DURATION)
    gap = state["aside"] - state["wanted"]
    drift = state["aside_rate"] + gap / STEERING_DURATION
    state["aside"] = state["wanted"] + (gap + drift * passed) * keep
    state["aside_rate"] = (drift - (gap + drift * passed) / STEERING_DURATION) * keep


def _lead_over(state: NDArray[Any], which: BoolArray, gap: FloatArray, rate: FloatArray, speed: FloatArray) -> None:
    """Begin to lead over from a gap [m] that changes at a rate [m/s], within what is no corner at this speed. [m/s]"""
    bound = LEADING_OVER_SHARE * LARGEST_TURN_RATE * np.maximum(np.abs(speed), MINIMUM_SPEED)
    over = np.maximum(SETTLING_TIME, np.maximum(np.sqrt(STEP_PEAK * np.abs(gap) / bound), 4.0 * np.abs(rate) / bound))
    for name, values in (("from", gap), ("from_rate", rate), ("share", 0.0), ("over", over)):
        state[name] = np.where(which, values, state[name])


def _settle(state: NDArray[Any], passed: FloatArray) -> FloatArray:
    """On with leading over; returns how fast what is left changes, shape (n,). [m/s]"""
    active = state["over"] > 0.0
    state["rest"] = np.where(active, state["rest"], 0.0)
    if not active.any():
        return np.zeros(len(state))
    over = np.where(active, state["over"], 1.0)
    share = state["share"] + passed / over
    done = active & (share >= 1.0)
    state["share"], state["over"] = np.where(active, share, 0.0), np.where(done, 0.0, state["over"])
    u = np.clip(share, 0.0, 1.0)
    level = 1.0 - smoother_step(u)
    by_level = -30.0 * u**2 * (1.0 - u) ** 2 / over
    by_slope = 1.0 - 18.0 * u**2 + 32.0 * u**3 - 15.0 * u**4
    rest = state["from"] * level + settle(u * over, over, state["from_rate"], 0.0)
    state["rest"] = np.where(active & ~done, rest, 0.0)
    return np.where(active & ~done, state["from"] * by_level + state["from_rate"] * by_slope, 0.0)
