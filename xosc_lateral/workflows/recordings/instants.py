"""Which rows of several vehicles belong to one instant, where stamps are rounded, jitter, or frames are missing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.drivers.drives.cuts import MAX_GAP

STAMP_DISTANCE = 0.25
"""Stamps farther apart than this are of two instants ... [steps]"""

INSTANT_WIDTH = 0.5
"""... if no instant is then wider than this; else every vehicle has a clock of its own. [steps]"""

FIRST_STEPS = 100
"""A common clock is fitted to so many steps first, then to twice as many, and so on: never off by half a step."""


def instants(time: FloatArray, vehicle: IntArray, step: float) -> tuple[IntArray, FloatArray]:
    """Number of each row's instant, counted up from 0, and that instant's time, shape (n,); rows by vehicle and time.

    `step`: median step of a vehicle. [s]
    """
    stamps, at = np.unique(time, return_inverse=True)
    new = np.r_[True, np.diff(stamps) > STAMP_DISTANCE * step]
    number = np.cumsum(new) - 1
    first = stamps[new]
    if (np.r_[stamps[:-1][new[1:]], stamps[-1]] - first <= INSTANT_WIDTH * step).all():
        return number[at], first[number][at]
    step, start = _clock(time, vehicle, step)
    number = np.round((time - start) / step).astype(np.int64)
    return number - number.min(), start + step * number


def _clock(time: FloatArray, vehicle: IntArray, step: float) -> tuple[float, float]:
    """Step and time of instant 0 of the even clock that fits all stamps best. [s]"""
    passed = np.diff(time)[np.diff(vehicle) == 0]
    count = np.round(passed / step)
    near = (count >= 1.0) & (count <= 3.0)
    step = float(passed[near].sum() / count[near].sum())
    start, span = float(time.min()), FIRST_STEPS * step
    begin = start
    while True:
        rows = time <= begin + span
        number = np.round((time[rows] - start) / step)
        if np.ptp(number) > 0.0:
            step, start = (float(one) for one in np.polyfit(number, time[rows], 1))
        if rows.all():
            return step, start
        span *= 2.0


@dataclass(frozen=True, eq=False)
class Pool:
    """Every vehicle once at every instant from its first to its last: rows, and instants that it misses for a moment.

    Arrays of shape (m,) but `of_row`.
    """

    row: IntArray  # row of the recording, or of the last one before
    after: IntArray  # row of the vehicle's next instant with a row; only where `share` is not 0
    instant: IntArray
    later: FloatArray  # time of the instant less that of `row` [s]
    share: FloatArray  # of the way from `row` to the vehicle's next, 0 where the instant is its own [-]
    of_row: IntArray  # place of each row of the recording in the pool, shape (n,)

    def moved(self, along: FloatArray, part: IntArray, speed: FloatArray) -> FloatArray:
        """Way along the road at the instants: between two rows of one part of the road, else as fast as before. [m]"""
        after = self.after
        between = (self.share > 0.0) & (part[after] == part[self.row])
        on = along[self.row] + speed[self.row] * self.later
        return np.where(between, along[self.row] + self.share * (along[after] - along[self.row]), on)


def pool_of(time: FloatArray, vehicle: IntArray, step: float, longest: float = MAX_GAP) -> Pool:
    """See `Pool`; instants missing for at most `longest` [s] are filled."""
    instant, when = instants(time, vehicle, step)
    new = np.r_[True, (np.diff(vehicle) != 0) | (np.diff(instant) != 0)]
    row = np.flatnonzero(new)
    missing = np.r_[np.diff(instant[row]) - 1, 0]
    passed = np.r_[np.diff(time[row]), 0.0]
    missing = np.where(np.r_[np.diff(vehicle[row]) == 0, False] & (passed <= longest + 1e-9), missing, 0)
    missing = np.maximum(missing, 0)
    last, following = np.repeat(row, missing), np.repeat(np.r_[row[1:], row[-1]], missing)  # about what is filled
    after = np.arange(len(last)) - np.repeat(np.cumsum(missing) - missing, missing) + 1
    times = np.full(int(instant.max()) + 1, np.nan)
    times[instant] = when
    filled = instant[last] + after
    known = np.isfinite(times[filled])  # nobody was seen at others
    last, following, filled = last[known], following[known], filled[known]
    later = times[filled] - time[last]
    share = later / np.maximum(time[following] - time[last], 1e-9)
    return Pool(
        np.r_[row, last], np.r_[row, following], np.r_[instant[row], filled], np.r_[when[row] - time[row], later],
        np.r_[np.zeros(len(row)), np.clip(share, 0.0, 1.0)], np.cumsum(new) - 1,
    )  # fmt: skip
