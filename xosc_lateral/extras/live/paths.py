"""From a driver's curve to where his vehicle is: what leads over to his path, slow driving, moving aside.

A vehicle's path has no corner (`LARGEST_TURN_RATE`): where a maneuver has moved it, its path leads over from there to
the driver's; below 40 km/h his movement has a slower clock (`base.segment`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.base.segment import LARGEST_HEADING, clock_rate, is_slow, way_of
from xosc_lateral.world.motion.driver_clock import leading_time
from xosc_lateral.world.motion.trajectory import settle, smoother_step
from xosc_lateral.world.surroundings.context import STEERING_DURATION

STANDSTILL = 0.1
"""Below this speed a path has no direction. [m/s]"""

SPEEDS_REMEMBERED = 5
"""Model steps of speed remembered: acceleration is over one second, as in a conversion. [-]"""

NEGLIGIBLE_REST = 1e-12
"""A lateral speed this small is none. [m/s]"""

LARGEST_SINE = float(np.sin(LARGEST_HEADING))
"""Lateral speed over speed, at most. [-]"""

CLOCK_TOLERANCE = 1e-9
"""Share of a model step that clocks may be off when steps of a simulation are added up. [-]"""

DRIVER = np.dtype(
    [("curve", float, 6), ("next", float, 6), ("ahead", bool), ("clock", float), ("own_rate", float), ("begun", bool),
     ("following", bool), ("place", float), ("rest", float), ("from", float), ("from_rate", float), ("share", float),
     ("over", float), ("aside", float), ("aside_rate", float), ("wanted", float), ("moved", bool),
     ("speeds", float, SPEEDS_REMEMBERED)]
)  # fmt: skip
"""A driver beside his random numbers.

His curve until his next model step, the one after it if that is `ahead`, how far on he is in it [-] and how fast he
moves sideways, by his own clock [m/s]; whether he has begun; whether the vehicle followed the road a step ago, and
where it was [m]; what leads over to his path: `rest` [m], from `from` [m] at `from_rate` [m/s], done to `share` [-] of
`over` [s]; how far he has moved aside, how fast, and how far he wants to; whether he has
ever driven; speeds of the last second.
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
    step: float,
    passed: float | None,
    speed: FloatArray,
    offset: FloatArray,
    base: FloatArray,
    following: BoolArray,
) -> tuple[NDArray[Any], Moves]:
    """The drivers' states (`DRIVER`) and moves, shape (n,) each; a curve lasts a `step` of their own clocks. [s]

    After so much time [s], None at the simulation's first step; see `Moment` for speed [m/s], offset, base [m] and
    following.
    """
    is_first, passed = passed is None, passed or 0.0
    powers = np.clip(state["clock"], 0.0, 1.0)[:, None] ** np.arange(6)
    driver = (state["curve"] * powers).sum(axis=1)
    driver_rate = (state["curve"][:, 1:] * np.arange(1, 6) * powers[:, :-1]).sum(axis=1) / step
    pace = pace_of(speed, state["own_rate"])
    is_driven = following & state["begun"]
    taken_over = is_driven & ~state["following"]
    was_rate = np.where(passed > 0.0, (offset - state["place"]) / max(passed, 1e-9), 0.0)
    _move_aside(state, passed * pace)
    aside, aside_rate = state["aside"], state["aside_rate"]
    if is_first:  # who drives, began so; who is slow or stands stays where it is, and is led over as it drives off
        state["rest"][taken_over] = 0.0
        slow = taken_over & (pace < 1.0)
        _lead_over(state, slow, offset - base - driver - aside, np.zeros(len(state)), speed)
    elif taken_over.any():
        was_rate = np.where(np.abs(was_rate) < np.maximum(0.2 * np.abs(speed), 0.1), was_rate, 0.0)  # placed anew
        was_rate = np.where(state["place"] == 0.0, 0.0, was_rate)
        gap_rate = was_rate - (driver_rate + aside_rate) * pace
        gap = offset - base - driver - aside + (driver_rate + aside_rate) * pace * passed  # a step ago
        _lead_over(state, taken_over, gap, gap_rate, speed)
    own_rate = driver_rate + _settle(state, passed * pace) + aside_rate
    place = np.where(is_driven, base + driver + state["rest"] + aside, offset)
    rate = np.where(is_driven, own_rate * pace_of(speed, own_rate), was_rate * (passed > 0.0))
    moving = np.abs(speed) > STANDSTILL
    sine = np.divide(rate, speed, out=np.zeros(len(state)), where=moving)
    most = np.where(is_slow(speed), LARGEST_SINE, 1.0)
    # A car that stands is turned as it came to a stop: of its way in a second of the clock something is left.
    turned = np.where(speed < 0.0, -1.0, 1.0) * np.clip(own_rate / way_of(speed), -most, most)
    state["moved"] |= moving
    turned = np.where(state["moved"], turned, 0.0)  # and one that never moved is straight
    heading = np.arcsin(np.clip(np.where(is_driven, turned, sine), -1.0, 1.0))
    state["following"], state["place"], state["own_rate"] = is_driven, place, np.where(is_driven, own_rate, 0.0)
    return state, Moves(place, np.where(is_driven, rate, 0.0), np.where(is_driven, heading, 0.0), is_driven)


def pace_of(speed: FloatArray, own_rate: FloatArray) -> FloatArray:
    """Seconds of the drivers' clocks in one, shape as the speed [m/s] and their lateral speed by their clocks. [m/s]"""
    turning = LARGEST_SINE * np.abs(speed) / np.maximum(np.abs(own_rate), NEGLIGIBLE_REST)
    return np.asarray(np.where(is_slow(speed), np.minimum(clock_rate(speed), turning), 1.0))


def _move_aside(state: NDArray[Any], passed: FloatArray) -> None:
    """Two equal first-order lags towards what is wanted, solved exactly; drivers respond within `STEERING_DURATION`."""
    keep = np.exp(-passed / STEERING_DURATION)
    gap = state["aside"] - state["wanted"]
    drift = state["aside_rate"] + gap / STEERING_DURATION
    state["aside"] = state["wanted"] + (gap + drift * passed) * keep
    state["aside_rate"] = (drift - (gap + drift * passed) / STEERING_DURATION) * keep


def _lead_over(state: NDArray[Any], which: BoolArray, gap: FloatArray, rate: FloatArray, speed: FloatArray) -> None:
    """Begin to lead over from a gap [m] that changes at a rate [m/s], within what is no corner at this speed. [m/s]"""
    over = leading_time(gap, rate, speed)
    for name, values in (("from", gap), ("from_rate", rate), ("share", 0.0), ("over", over)):
        state[name] = np.where(which, values, state[name])


def left_of_gap(u: FloatArray, over: FloatArray, gap: FloatArray, rate: FloatArray) -> FloatArray:
    """What is left of a gap [m] at a share of the time that leading over takes [s], shape (n,). [m]"""
    return np.asarray(gap * (1.0 - smoother_step(u)) + settle(u * over, over, rate, 0.0))


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
    by_level = -30.0 * u**2 * (1.0 - u) ** 2 / over
    by_slope = 1.0 - 18.0 * u**2 + 32.0 * u**3 - 15.0 * u**4
    rest = left_of_gap(u, over, state["from"], state["from_rate"])
    state["rest"] = np.where(active & ~done, rest, 0.0)
    return np.where(active & ~done, state["from"] * by_level + state["from_rate"] * by_slope, 0.0)
