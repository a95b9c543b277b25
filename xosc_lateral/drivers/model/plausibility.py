"""What no driver does and no road has: found before it gets into an output. Numbers and reasons are in `limits`.

References
----------
.. [1] AASHTO, "A Policy on Geometric Design of Highways and Streets", 2018, chapter 3: limiting values of the side
   friction factor, from 0.32 at 15 mph to 0.08 at 80 mph.
.. [2] UN Regulation No. 79, revision 4, paragraph 5.6.2.1.3: lateral acceleration and jerk of lane keeping, M1.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, smoothed
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.base.limits import DISTANCES, OFFSET_LANES, Range, context_range
from xosc_lateral.base.segment import MINIMUM_SPEED, Segment
from xosc_lateral.drivers.model.effects import Acts, ColumnEffect

if TYPE_CHECKING:
    from xosc_lateral.drivers.model.profile import DriverProfile


MINIMUM_LANE_WIDTH = 2.5
"""Where a lane is narrower than this (it opens or closes), an offset is held against a lane of this width. [m]"""

ENDLESS = 1e9
"""So large is no column; what is twice there of what it is at a thousandth has no end. [any unit]"""

BELIEVED_SPAN = 100.0
"""Ranges of columns up to this are what there is on roads (lanes, truth values, hours); wider ones bound what a sensor
can say. [any unit]"""

TRIAL_STEPS, TRIAL_SPEED = 150, 30.0
"""Model steps that a profile is tried with, half a minute [-], and the speed [m/s]."""


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
    width = np.broadcast_to(np.asarray(lane_width, dtype=np.float64), offset.shape)[first]
    limit = OFFSET_LANES.refusal(float(abs(offset[first]) / max(width, MINIMUM_LANE_WIDTH)))
    raise DriverProfileError(f"{subject}: an offset of {offset[first]:.4g} m{when}; {limit}")


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
    """Try a profile, in even traffic and each effect over its column: numbers may each be allowed, and give nonsense.

    Raises `DriverProfileError` if it leaves its lane by more than a lane.
    """
    from xosc_lateral.drivers.model.sampling import sample_offsets

    time = profile.model.step * np.arange(TRIAL_STEPS, dtype=np.float64)
    width = np.full(TRIAL_STEPS, profile.lane_width)
    subject = f"profile {profile.name} in half a minute of even traffic"
    with np.errstate(all="ignore"):
        offset = sample_offsets(profile, Segment(time, width, np.full(TRIAL_STEPS, TRIAL_SPEED)), 0)
    check_offsets(offset, width, subject, time)
    for number, effect in enumerate(profile.effects, 1):
        if isinstance(effect, ColumnEffect) and effect.acts is Acts.LOCATION:
            shift = np.array([_largest_shift(effect, profile)])
            what = f"profile {profile.name}: effect {number} ({effect.kind} of {', '.join(effect.columns)})"
            check_offsets(shift, profile.lane_width, what)


def _largest_shift(effect: ColumnEffect, profile: DriverProfile) -> float:
    """What an effect on the location comes to at most, over the range of its columns; 0 where that has no end. [m]

    A column has the range that its effect or its profile was fitted on, else what is believed of it, where that says
    something. Without one an effect may still level off.
    """
    values = [_trial_values(effect, name, profile) for name in effect.columns]
    grid = dict(zip(effect.columns, map(np.ravel, np.meshgrid(*values)), strict=True))
    with np.errstate(all="ignore"):
        strength = np.abs(effect.weighed(effect.known(grid)))
        far = np.any([np.abs(column) >= ENDLESS for column in grid.values()], axis=0)
        within = float(np.nanmax(strength[~far]))
        beyond = float(np.nanmax(strength[far], initial=0.0))
    return 0.0 if beyond > 2.0 * within and not effect.response_range else max(within, beyond)


def _trial_values(effect: ColumnEffect, name: str, profile: DriverProfile) -> FloatArray:
    measured = {"speed": profile.validity.speed, "lane_width": profile.validity.lane_width}
    believed = context_range(name)
    low, high = measured.get(name) or _driven_range(name) or (believed.low, believed.high)
    if high - low <= BELIEVED_SPAN:
        return np.union1d(np.linspace(low, high, 41), np.arange(np.ceil(low), high + 0.5))
    marks = [mark for field in ("levels", "knots", "at", "middle") for mark in np.ravel(getattr(effect, field, ()))]
    size = np.geomspace(1e-6, ENDLESS / 1e3, 40)
    return np.unique([*-size, 0.0, *size, *marks, -ENDLESS, ENDLESS, np.inf])


def _driven_range(name: str) -> tuple[float, float] | None:
    """What a driver meets who keeps a lane, where it is far less than what is believed; None: it is not. [its unit]

    Bends that 40 km/h can be driven in at `ACCELERATION_LIMIT`; 13 lanes of one direction (Katy Freeway, Houston).
    """
    bend = ACCELERATION_LIMIT / MINIMUM_SPEED**2
    return {"curvature": (-bend, bend), "lane_index": (0.0, 12.0), "lane_count": (1.0, 13.0)}.get(name)


# ---- what can be driven: bounds on the lateral acceleration and jerk of lane keeping, by speed ----
# Comfort: the side friction at which drivers begin to feel discomfort, by speed [1]_; nobody keeps a lane beyond it for
# more than an instant. Limit: what lane keeping by a machine is allowed in Europe, 3 m/s2 and, over half a second,
# 5 m/s3 [2]_ (the same figures as for lane keeping assistance in ISO 11270:2014). Real motorway traffic stays far below
# either: 0.3 m/s2 in 99.9 % of the time (docs/real_data.md).
GRAVITY = 9.80665
MPH = 0.44704
_SPEED = MPH * np.arange(15.0, 81.0, 5.0)
_FRICTION = np.array([0.32, 0.27, 0.23, 0.20, 0.18, 0.16, 0.15, 0.14, 0.13, 0.12, 0.11, 0.10, 0.09, 0.08])

ACCELERATION_LIMIT, JERK_LIMIT = 3.0, 5.0
"""[m/s2], [m/s3]"""

JERK_WINDOW = 0.5
"""Jerk is averaged over this. [s]"""

UNCOMFORTABLE_SHARE = 1e-3
"""Share of the time that lane keeping may be uncomfortable. [-]"""

MINIMUM_KERNEL_WIDTH, MAXIMUM_KERNEL_WIDTH = 0.1, 3.0
"""Standard deviations of the kernel by which paths are smoothed: from, to. [s]"""


@dataclass(frozen=True, slots=True)
class Strain:
    """How hard a path is to drive."""

    seldom: float  # Lateral acceleration exceeded in 0.1 % of the time. [m/s2]
    largest: float  # Largest acceleration. [m/s2]
    jerk: float  # Largest over half a second. [m/s3]
    excess: float  # Largest of these over their bounds: above 1 it could not be driven. [-]


@dataclass(frozen=True, slots=True)
class Bound:
    """That a path was smoothed, and why: strain before and after, width of the kernel [s]."""

    before: Strain
    after: Strain
    width: float

    def __str__(self) -> str:
        return (
            f"sampled movement could not be driven (lateral acceleration above {self.before.seldom:.2f} m/s2 for 0.1 % "
            f"of the time, at most {self.before.largest:.2f} m/s2, jerk at most {self.before.jerk:.1f} m/s3): smoothed "
            f"over {self.width:.1f} s, now {self.after.seldom:.2f} m/s2, {self.after.largest:.2f} m/s2 and "
            f"{self.after.jerk:.1f} m/s3"
        )


def comfort(speed: FloatArray) -> FloatArray:
    """Lateral acceleration at which drivers begin to feel discomfort. [m/s2] Shape as `speed` [m/s]."""
    return np.asarray(GRAVITY * np.interp(np.abs(speed), _SPEED, _FRICTION))


def strain(offset: FloatArray, step: float, speed: FloatArray) -> Strain:
    """Strain of a path, from its offsets at an even step and the speed there.

    `offset` [m] and `speed` [m/s] of shape (n,); `step` in [s].
    """
    if len(offset) < 4:
        return Strain(0.0, 0.0, 0.0, 0.0)
    signed = np.diff(offset, 2) / step**2
    acceleration, span = np.abs(signed), max(1, round(JERK_WINDOW / step))
    jerk = np.abs(signed[span:] - signed[:-span]) / (span * step) if len(signed) > span else np.zeros(1)
    hardest = float(jerk.max())
    bound = comfort(speed)[1:-1]
    largest = float(acceleration.max())
    seldom, uncomfortable = (_seldom_exceeded(values) for values in (acceleration, acceleration / bound))
    return Strain(seldom, largest, hardest, max(uncomfortable, largest / ACCELERATION_LIMIT, hardest / JERK_LIMIT))


def _seldom_exceeded(values: FloatArray) -> float:
    """What n >= 2 values exceed in `UNCOMFORTABLE_SHARE` of the time: `np.quantile`, which would load `numpy.ma`."""
    at = (len(values) - 1) * (1.0 - UNCOMFORTABLE_SHARE)
    low, high = np.partition(values, (int(at), int(at) + 1))[int(at) : int(at) + 2].tolist()
    share: float = at - int(at)
    return low + (high - low) * share if share < 0.5 else high - (high - low) * (1.0 - share)  # type: ignore[no-any-return]


def drivable(offset: FloatArray, step: float, speed: FloatArray) -> tuple[FloatArray, Bound | None]:
    """The path, smoothed as little as it takes to be drivable; with the reason where it had to be.

    `offset` [m] and `speed` [m/s] of shape (n,); `step` in [s].
    """
    before = strain(offset, step, speed)
    if before.excess <= 1.0:
        return offset, None
    width, smooth, after = MINIMUM_KERNEL_WIDTH, offset, before
    while after.excess > 1.0 and width <= MAXIMUM_KERNEL_WIDTH:
        smooth = smoothed(offset, width / step)
        after = strain(smooth, step, speed)
        width *= 1.3
    return smooth, Bound(before, after, width / 1.3)
