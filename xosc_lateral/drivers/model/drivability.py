"""What can be driven: bounds on the lateral acceleration and jerk of lane keeping, by speed.

Comfort: the side friction at which drivers begin to feel discomfort, by speed [1]_; nobody keeps a lane beyond it for
more than an instant. Limit: what lane keeping by a machine is allowed in Europe, 3 m/s2 and, over half a second,
5 m/s3 [2]_ (the same figures as for lane keeping assistance in ISO 11270:2014). Real motorway traffic stays far below
either: 0.3 m/s2 in 99.9 % of the time (docs/real_data.md).

References
----------
.. [1] AASHTO, "A Policy on Geometric Design of Highways and Streets", 2018, chapter 3: limiting values of the side
   friction factor, from 0.32 at 15 mph to 0.08 at 80 mph.
.. [2] UN Regulation No. 79, revision 4, paragraph 5.6.2.1.3: lateral acceleration and jerk of lane keeping, M1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.filters import filtered
from xosc_lateral.drivers.fitting.sensor.periodogram import COARSE_STEP_RATIO, uniform_variance
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets

GRAVITY = 9.80665
MPH = 0.44704
_SPEED = MPH * np.arange(15.0, 81.0, 5.0)
_FRICTION = np.array([0.32, 0.27, 0.23, 0.20, 0.18, 0.16, 0.15, 0.14, 0.13, 0.12, 0.11, 0.10, 0.09, 0.08])

LIMIT, JERK_LIMIT = 3.0, 5.0
"""[m/s2], [m/s3]"""

JERK_WINDOW = 0.5
"""Jerk is averaged over this. [s]"""

UNCOMFORTABLE_SHARE = 1e-3
"""Share of the time that lane keeping may be uncomfortable. [-]"""

TRAFFIC = 0.6
"""Twice what 99.9 % of real motorway traffic stays below: beyond, a profile probably holds a sensor's noise. [m/s2]"""

MINIMUM_KERNEL_WIDTH, MAXIMUM_KERNEL_WIDTH = 0.1, 3.0
"""Standard deviations of the kernel by which paths are smoothed: from, to. [s]"""

AS_GIVEN = 1.15
"""A sensor's error found may be so many times the one given: by chance errors go along with the path. [-]"""

FREE_RUN = 1200.0
"""Sampled to see what a profile writes. [s]"""


@dataclass(frozen=True, slots=True)
class Strain:
    """How hard a path is to drive."""

    seldom: float
    """Lateral acceleration exceeded in 0.1 % of the time. [m/s2]"""
    largest: float
    """Largest acceleration. [m/s2]"""
    jerk: float
    """Largest over half a second. [m/s3]"""
    excess: float
    """Largest of these over their bounds: above 1 it could not be driven. [-]"""


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
    return Strain(seldom, largest, hardest, max(uncomfortable, largest / LIMIT, hardest / JERK_LIMIT))


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
        smooth = _smoothed(offset, width / step)
        after = strain(smooth, step, speed)
        width *= 1.3
    return smooth, Bound(before, after, width / 1.3)


def fit_warnings(profile: DriverProfile, sensor_noise: float | None = None) -> list[str]:
    """What to know about a profile's sensor (and its error, as far as it was given, [m]) and drivability, in lines."""
    return [*_beside_given(profile, sensor_noise), *_coarse_steps(profile), *_strained(profile)]


def _beside_given(profile: DriverProfile, stated: float | None) -> list[str]:
    """Where the drives don't bear out a sensor error that was given."""
    sensor = profile.sensor
    if stated is None:
        return []
    if sensor is None:
        return [f"runs are too short to separate driver and sensor: the error of {stated:g} m is not used"]
    least = float(np.sqrt(uniform_variance(sensor.rounding)))
    if stated < least / AS_GIVEN:
        return [
            f"a sensor error of {stated:g} m is less than that of rounding to {sensor.rounding:.3g} m alone, "
            f"{least:.2g} m: taken for rounding and nothing else"
        ]
    noise = float(np.sqrt(sensor.sensor_variance))
    if least > noise / AS_GIVEN or noise / AS_GIVEN < stated < AS_GIVEN * noise:  # rounding of coarse steps is not even
        return []
    return [f"the drives contradict a sensor error of {stated:g} m: {noise:.2g} m is what explains them best beside it"]


def _coarse_steps(profile: DriverProfile) -> list[str]:
    sensor = profile.sensor
    if sensor is None or sensor.driver_share != (0.0, 1.0):
        return []
    deviation = np.sqrt(sensor.driver_variance + sensor.sensor_variance)
    if sensor.rounding <= COARSE_STEP_RATIO * deviation:  # little data, not steps
        return []
    return [
        f"the offsets are rounded to {sensor.rounding:.3g} m, too coarse to show how far the driver of {profile.name} "
        "moves between steps"
    ]


def _strained(profile: DriverProfile) -> list[str]:
    segment = Segment.even(FREE_RUN, profile.model.step, profile.lane_width, 30.0)
    speed = segment.speed
    strained = strain(sample_offsets(profile, segment, 1), profile.model.step, speed)
    if strained.excess > 1.0:
        return [
            f"movement of {profile.name} could not be driven at {speed[0]:g} m/s: lateral acceleration above "
            f"{strained.seldom:.2f} m/s2 for 0.1 % of the time (comfort limit {float(comfort(speed[:1])[0]):.2f}), "
            f"at most {strained.largest:.1f} m/s2, jerk at most {strained.jerk:.1f} m/s3 "
            f"(UN R79: {LIMIT:g} and {JERK_LIMIT:g}); convert will smooth it"
        ]
    if strained.seldom > TRAFFIC:
        return [
            f"lateral acceleration of {profile.name} is above {strained.seldom:.2f} m/s2 for 0.1 % of the time, twice "
            "that of real motorway traffic or more: check the sensor that measured the drives"
        ]
    return []


def _smoothed(values: FloatArray, width: float) -> FloatArray:
    """Gaussian smoothing, continued point-symmetrically past both ends, which stay where they are."""
    half = min(int(np.ceil(4.0 * width)), len(values) - 1)
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / width) ** 2)
    return filtered(values, kernel / kernel.sum())
