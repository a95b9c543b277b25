"""The one thing that the driver model and the scenario player share: a road-following segment."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.limits import CONTEXT_RANGES

MINIMUM_SPEED = 40.0 / 3.6
"""Below this drives are not fitted (Neis & Beyerer cut their data at 40 km/h), and movement has its own clock. [m/s]"""

CONTEXT_UNITS: Mapping[str, str] = MappingProxyType({name: known.unit for name, known in CONTEXT_RANGES.items()})
"""Of the contexts that a scenario can supply by itself; NaN in their arrays where there is none (no vehicle ahead)."""

FADES = "_fades"
"""Ends the name of a column that says how far another column's is there, 0 to 1, where it comes and goes, as a lane
that opens does: `left_distance_fades` is of `left_distance`. [-]"""


@dataclass(frozen=True, eq=False, slots=True)
class Segment:
    """A road-following segment: a part of one vehicle's motion with no lateral action running, on a uniform time grid.

    Parameters
    ----------
    time : array, shape (n,)
        Uniformly increasing. [s]
    lane_width : array, shape (n,)
        Width of the lane followed. [m]
    speed : array, shape (n,)
        [m/s]
    context : mapping of str to array, shape (n,)
        What the driver may react to (`CONTEXT_UNITS` and other names); NaN where there is nothing (no leader).
        A name that is absent has no effect.
    before, after : int
        Rows at the start and at the end of the arrays that lie outside the segment: context only, no offsets are
        sampled there. Effects that look ahead or respond slowly need what comes after and what went before.
    """

    time: FloatArray
    lane_width: FloatArray
    speed: FloatArray
    context: Mapping[str, FloatArray] = field(default_factory=dict)
    before: int = 0
    after: int = 0

    def __post_init__(self) -> None:
        """Copy and freeze the arrays; refuse unequal lengths."""
        n = len(self.time)
        for name in ("time", "lane_width", "speed"):
            object.__setattr__(self, name, _frozen(getattr(self, name), name, n))
        context = {name: _frozen(values, name, n) for name, values in self.context.items()}
        object.__setattr__(self, "context", MappingProxyType(context))
        if self.before < 0 or self.after < 0 or self.before + self.after > n:
            raise ValueError(f"{self.before} rows before and {self.after} after a segment in {n} rows")

    @classmethod
    def even(cls, duration: float, step: float, lane_width: float, speed: float) -> Segment:
        """Free driving at one speed [m/s] in a lane of one width [m], for so long, at this step. [s]"""
        n = round(duration / step) + 1
        return cls(step * np.arange(n, dtype=np.float64), np.full(n, lane_width), np.full(n, speed))

    def at(self, rows: IntArray) -> Segment:
        """With these rows of its inside, shape (k,), a step apart in time, in place of all: as on another clock."""
        around = np.arange(self.before), np.arange(self.inside.stop, len(self))
        taken = np.concatenate((around[0], self.before + rows, around[1]))
        time = self.time[0] + (self.time[1] - self.time[0]) * np.arange(len(taken))
        context = {name: values[taken] for name, values in self.context.items()}
        return Segment(time, self.lane_width[taken], self.speed[taken], context, self.before, self.after)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def inside(self) -> slice:
        """Rows of the segment itself."""
        return slice(self.before, len(self.time) - self.after)


def _frozen(values: FloatArray, name: str, n: int) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    if array.shape != (n,):
        raise ValueError(f"{name}: shape {array.shape}, expected ({n},)")
    array.flags.writeable = False
    return array


# ---- the clock that a driver's movement in the lane runs on: real time from 40 km/h on, slower below, none at rest ---
# A car that stands does not slide: it stays where its driver stopped, and how far drivers spread stays too. Below 40
# km/h drivers move sideways nearly as fast as above: movement goes neither by the distance driven nor by time, and it
# does not fade. How much slower is what vehicles do at a signalled junction (DLR Urban Traffic v1.2.0, 0 to 17 m/s), by
# classes of speed (docs/validation/driver_model.md).
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
