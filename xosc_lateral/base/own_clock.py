"""The clock that a driver's movement in the lane runs on: real time from 40 km/h on, slower below, none at rest.

A car that stands does not slide: it stays where its driver stopped, and how far drivers spread stays too. Below 40 km/h
drivers move sideways nearly as fast as above: movement goes neither by the distance driven nor by time, and it does not
fade. How much slower is what vehicles do at a signalled junction (DLR Urban Traffic v1.2.0, 0 to 17 m/s), by classes of
speed (docs/validation/driver_model.md).
"""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.segment import MINIMUM_SPEED

CLOCK_SPEEDS = (0.0, 0.65, 1.5, 2.5, 4.0, 6.0, 8.0, MINIMUM_SPEED)
"""Middles of the classes, and their ends. [m/s]"""
CLOCK_RATES = (0.0, 0.32, 0.44, 0.53, 0.65, 0.80, 0.89, 1.0)
"""Rates of the clock there, with which sampled drivers move sideways over 2 s as fast as vehicles of each class did,
relative to those at 9 to 13 m/s; between two, a straight line. [-]"""

LARGEST_HEADING = float(np.deg2rad(3.0))
"""Of a car that keeps its lane, relative to it: what would turn it further is put off. [rad]"""

STEEPER = 3.0 - 3.0**0.5
"""A cubic spline through even knots beside a kink over the line through its knots (2 - sqrt(3) beyond it). [-]"""

SPEED_SLACK = 1e-6
"""40 km/h written as 11.1111 in a scenario is meant as 40 km/h. [-]"""


def is_slow(speed: FloatArray) -> BoolArray:
    """Whether below 40 km/h, any shape. [m/s]"""
    return np.asarray(np.abs(speed) < MINIMUM_SPEED * (1.0 - SPEED_SLACK))


def clock_rate(speed: FloatArray) -> FloatArray:
    """Seconds of the driver's clock per second at a speed [m/s] in either direction, any shape, 0 to 1. [-]"""
    return np.where(is_slow(speed), np.interp(np.abs(speed), CLOCK_SPEEDS, CLOCK_RATES), 1.0)


def way_of(speed: FloatArray) -> FloatArray:
    """Distance driven in a second of the driver's clock at a speed [m/s], any shape; 2 m as it comes to rest. [m]"""
    pace = np.maximum(np.abs(speed), CLOCK_SPEEDS[1])  # below, the rate is in proportion to the speed
    return np.asarray(pace / clock_rate(pace))


def own_time(time: FloatArray, speed: FloatArray) -> FloatArray:
    """The driver's time since the first row, shape (n,), from rows of time [s] and speed [m/s], shape (n,). [s]"""
    rate = clock_rate(speed)
    return np.concatenate(([0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))))


def ticks_of(time: FloatArray, speed: FloatArray, step: float) -> tuple[FloatArray, FloatArray, IntArray]:
    """Own time of each row, shape (n,); own times a step [s] apart from the first row to behind the last, at least two;
    and the rows that are nearest to these. From rows of time [s] and speed [m/s], shape (n,).
    """
    own_times = own_time(time, speed)
    ticks = step * np.arange(max(np.ceil(own_times[-1] / step - 1e-9), 1.0) + 1.0)
    moved = np.flatnonzero(np.diff(own_times, prepend=-1.0) > 0.0)  # of the rows in one place the first
    nearest = np.rint(np.interp(ticks, own_times[moved], moved)).astype(np.int64)
    nearest[-1] = len(own_times) - 1
    return own_times, ticks, nearest


def within_heading(offset: FloatArray, distance: FloatArray) -> FloatArray:
    """Offsets [m] by the distance driven [m], shape (n,), whose spline turns the car by `LARGEST_HEADING` at most.

    In the middle between the nearest such path above and the nearest below: the same where it is one already.
    """
    largest = float(np.tan(LARGEST_HEADING)) / STEEPER
    if (np.abs(np.diff(offset)) <= largest * np.diff(distance)).all():
        return offset
    ramp = largest * distance
    above = np.minimum(
        np.minimum.accumulate(offset - ramp) + ramp, np.minimum.accumulate((offset + ramp)[::-1])[::-1] - ramp
    )
    below = np.maximum(
        np.maximum.accumulate(offset + ramp) - ramp, np.maximum.accumulate((offset - ramp)[::-1])[::-1] + ramp
    )
    return np.asarray(0.5 * (above + below))
