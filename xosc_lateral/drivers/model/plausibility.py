"""What no driver does and no road has: found before it gets into an output. Numbers and reasons are in `limits`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.limits import DISTANCES, OFFSET_LANES, Range, context_range
from xosc_lateral.base.segment import Segment

if TYPE_CHECKING:
    from xosc_lateral.drivers.model.profile import DriverProfile

MINIMUM_LANE_WIDTH = 2.5
"""Where a lane is narrower than this (it opens or closes), an offset is held against a lane of this width. [m]"""

TRIAL = 150
"""Model steps that a profile is tried with: half a minute. [-]"""

TRIAL_SPEED = 30.0
"""Speed of the trial. [m/s]"""


def check_offsets(
    offset: FloatArray, lane_width: FloatArray | float, subject: str, time: FloatArray | None = None
) -> None:
    """Refuse offsets [m], shape (n,), that leave lane and neighbouring lane, or are no numbers.

    Raises `DriverProfileError` with the first such offset: `subject` says whose it is, `time` [s] of shape (n,) when.
    """
    reach = OFFSET_LANES.value * np.maximum(lane_width, MINIMUM_LANE_WIDTH)
    far = np.flatnonzero(~(np.abs(offset) <= reach))  # also NaN
    if not len(far):
        return
    first = int(far[0])
    when = "" if time is None else f" at {time[first]:g} s"
    limit = OFFSET_LANES.refusal(_lanes(offset, lane_width, first))
    raise DriverProfileError(f"{subject}: an offset of {offset[first]:.4g} m{when}; {limit}")


def _lanes(offset: FloatArray, lane_width: FloatArray | float, row: int) -> float:
    width = np.broadcast_to(np.asarray(lane_width, dtype=np.float64), offset.shape)[row]
    return float(abs(offset[row]) / max(width, MINIMUM_LANE_WIDTH))


def check_context(context: Mapping[str, float], subject: str) -> None:
    """Refuse one moment's context that no road has. NaN is none, and fine; so is an infinite distance: nobody in sight.

    Raises `ValueError` with name, value and range.
    """
    for name, value in context.items():
        is_nobody = value == np.inf and name in DISTANCES
        if not is_nobody and (why := implausible(name, float(value))) is not None:
            raise ValueError(f"{subject}: {why}")


def implausible(name: str, value: float) -> str | None:
    """Why a context value can't be; None if it can, or is NaN."""
    believed = context_range(name)
    if value < believed.low or value > believed.high:
        return f"{name} {value:.6g} is not within [{believed.low:g}, {believed.high:g}] ({believed.reason})"
    return None


def first_implausible(name: str, values: FloatArray) -> int | None:
    """Row of the first context value that can't be. `values` of shape (n,). [unit of the column]"""
    wrong = np.flatnonzero(implausible_rows(name, values))
    return int(wrong[0]) if len(wrong) else None


def implausible_rows(name: str, values: FloatArray, believed: Range | None = None) -> BoolArray:
    """Which values can't be, shape (n,) as `values` [unit of the column]; NaN ("there is none") can.

    By what a context column of that name is believed to be, or by the range given.
    """
    believed = believed or context_range(name)
    return (values < believed.low) | ((values > believed.high) & ~drives_nobody(name, values))


def drives_nobody(name: str, values: FloatArray) -> BoolArray:
    """Where the distance to somebody says that nobody is within reach: it is infinite. Shape as `values`."""
    return np.isposinf(values) & (name in DISTANCES)


def check_profile(profile: DriverProfile) -> None:
    """Try a profile in even traffic: its numbers may each be allowed, and together give nonsense.

    Raises `DriverProfileError` if it leaves its lane by more than a lane.
    """
    from xosc_lateral.drivers.model.sampling import sample_offsets

    time = profile.model.step * np.arange(TRIAL, dtype=np.float64)
    width = np.full(TRIAL, profile.lane_width)
    subject = f"profile {profile.name} in half a minute of even traffic"
    with np.errstate(all="ignore"):
        offset = sample_offsets(profile, Segment(time, width, np.full(TRIAL, TRIAL_SPEED)), 0)
    check_offsets(offset, width, subject, time)
