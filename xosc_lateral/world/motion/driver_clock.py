"""The driver's clock along a way in its fastest run, and the one bound on how fast movement turns a vehicle.

A path by distance is driven at any speed that an ego allows. Its clock is that of the fastest: what is bounded there is
bounded everywhere. Live driving has the same bound (`extras.live.moment`).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from msgspec import Struct

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.segment import MINIMUM_SPEED, way_of
from xosc_lateral.world.motion.look import FRAME_TURN, LATERAL_ACCELERATION, LOOK_STEP
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.motion.trajectory import SETTLING_TIME, distance_driven

LARGEST_TURN_RATE = 0.03
"""Change of heading per time that nobody takes for a corner of the path: 0.3 mrad in a step of 0.01 s. [rad/s]"""
LEADING_OVER_SHARE = 0.5
"""Part of `LARGEST_TURN_RATE` that leading over to the path may take; the driver's own movement has the rest. [-]"""
STEP_PEAK = 10.0 / np.sqrt(3.0)
"""Largest second derivative of the smooth step from 0 to 1 in unit time (of 10 u^3 - 15 u^4 + 6 u^5, by hand). [-]"""
CUT_SHARE = 0.9
"""Of what the look lets pass in a frame, and from vertex to vertex, that an action may take away which begins there:
the path's own corners have the rest. [-]"""
TICK, GRID = 0.1, 0.2
"""Of movement along the clock [s], of the clock along the way: who drives off is a little faster at each place. [m]"""


def leading_time(gap: Any, rate: Any, speed: Any) -> Any:
    """How long leading over a gap [m] that changes at a rate [m/s] takes at a speed [m/s]; any shape. [s]"""
    bound = LEADING_OVER_SHARE * LARGEST_TURN_RATE * np.maximum(np.abs(speed), MINIMUM_SPEED)
    ways = np.maximum(np.sqrt(STEP_PEAK * np.abs(gap) / bound), 4.0 * np.abs(rate) / bound)
    return np.maximum(SETTLING_TIME, ways)


class DriverClock(Struct, frozen=True, eq=False):
    """Speed and clock at distances along a way, shape (n,)."""

    distance: FloatArray  # [m]
    speed: FloatArray  # [m/s]
    time: FloatArray  # [s]

    @classmethod
    def of_fastest(cls, runs: Iterable[EntityMotion], length: float, *, anywhere: bool = False) -> DriverClock:
        """Of an entity in several runs. Who slows down for an ego may not have to: nobody counts as slower than before.

        `anywhere`: nor than behind; where a path begins is not known.
        """
        at = np.arange(0.0, length + 2.0 * GRID, GRID)
        speeds = [np.interp(at, distance_driven(one), np.abs(one.speed)) for one in runs]
        speed = np.maximum.accumulate(np.max(speeds, axis=0))
        speed = np.full(len(at), speed[-1]) if anywhere else speed
        way = way_of(speed)
        return cls(at, speed, np.concatenate(([0.0], np.cumsum(2.0 * GRID / (way[1:] + way[:-1])))))

    def time_at(self, distance: Any) -> Any:
        """[s]"""
        return np.interp(distance, self.distance, self.time)

    def distance_at(self, time: FloatArray) -> FloatArray:
        """[m]"""
        return np.interp(time, self.time, self.distance)

    def speed_at(self, distance: float) -> float:
        """[m/s]"""
        return float(np.interp(distance, self.distance, self.speed))

    def ticks(self) -> FloatArray:
        """Distances a `TICK` apart. [m]"""
        return self.distance_at(np.arange(0.0, self.time[-1], TICK))

    def limit(self, at: FloatArray) -> FloatArray:
        """Of the lateral acceleration by the clock, at distances. [m/s2]"""
        speed = np.interp(at, self.distance, self.speed)
        return LARGEST_TURN_RATE * np.maximum(speed, MINIMUM_SPEED)

    def limit_where_cut(self, at: FloatArray) -> FloatArray:
        """Of the lateral speed by the clock, at distances where an action may begin, which takes it away. [m/s]"""
        way = way_of(np.interp(at, self.distance, self.speed))  # in its second, which is longer below 40 km/h
        return CUT_SHARE * np.minimum(FRAME_TURN * way, LATERAL_ACCELERATION * LOOK_STEP)
