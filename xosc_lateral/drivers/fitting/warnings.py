"""What to know about a fitted profile before it is used: its sensor, how it can be driven, its band."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.drives.resampling import STEP
from xosc_lateral.drivers.fitting.bands import COMPARED_FREQUENCIES, KEEPING_BAND, SPLIT_AT, density_of, fast_part_of
from xosc_lateral.drivers.fitting.sensor.periodogram import COARSE_STEP_RATIO, uniform_variance
from xosc_lateral.drivers.model.core.base import ModelKind
from xosc_lateral.drivers.model.plausibility import ACCELERATION_LIMIT, JERK_LIMIT, comfort, strain
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampling import sample_offsets

TRAFFIC_ACCELERATION = 0.6
"""Twice what 99.9 % of real motorway traffic stays below: beyond, a profile probably holds a sensor's noise. [m/s2]"""

ERROR_RATIO = 1.15
"""A sensor's error found may be so many times the one given: by chance errors go along with the path. [-]"""

FREE_RUN, FREE_SPEED = 1200.0, 30.0
"""Sampled to see what a profile writes. [s], [m/s]"""

MINIMUM_POWER_SHARE = 0.2
"""Share of other drivers' power below which movement falls as no driver's does: real ones differ by a factor of two to
either side. [-]"""


def fit_warnings(
    profile: DriverProfile, sensor_noise: float | None = None, reference: DriverProfile | None = None
) -> list[str]:
    """What to know about a profile, in lines, and about the error of its sensor as far as it was given. [m]

    With a `reference`, of real drivers, also about its band.
    """
    return [
        *_beside_given(profile, sensor_noise), *_coarse_steps(profile), *_strained(profile),
        *([] if reference is None else _band_warnings(profile, reference)),
    ]  # fmt: skip


def _beside_given(profile: DriverProfile, stated: float | None) -> list[str]:
    """Where the drives don't bear out a sensor error that was given."""
    sensor = profile.sensor
    if stated is None:
        return []
    if sensor is None:
        return [f"runs are too short to separate driver and sensor: the error of {stated:g} m is not used"]
    least = float(np.sqrt(uniform_variance(sensor.rounding)))
    if stated < least / ERROR_RATIO:
        return [
            f"a sensor error of {stated:g} m is less than that of rounding to {sensor.rounding:.3g} m alone, "
            f"{least:.2g} m: taken for rounding and nothing else"
        ]
    noise = float(np.sqrt(sensor.sensor_variance))
    is_rounding = least > noise / ERROR_RATIO  # that of coarse steps is not even
    if is_rounding or noise / ERROR_RATIO < stated < ERROR_RATIO * noise:
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
    segment = Segment.even(FREE_RUN, profile.model.step, profile.lane_width, FREE_SPEED)
    speed = segment.speed
    strained = strain(sample_offsets(profile, segment, 1), profile.model.step, speed)
    if strained.excess > 1.0:
        return [
            f"movement of {profile.name} could not be driven at {speed[0]:g} m/s: lateral acceleration above "
            f"{strained.seldom:.2f} m/s2 for 0.1 % of the time (comfort limit {float(comfort(speed[:1])[0]):.2f}), "
            f"at most {strained.largest:.1f} m/s2, jerk at most {strained.jerk:.1f} m/s3 "
            f"(UN R79: {ACCELERATION_LIMIT:g} and {JERK_LIMIT:g}); convert will smooth it"
        ]
    if strained.seldom > TRAFFIC_ACCELERATION:
        return [
            f"lateral acceleration of {profile.name} is above {strained.seldom:.2f} m/s2 for 0.1 % of the time, twice "
            "that of real motorway traffic or more: check the sensor that measured the drives"
        ]
    return []


def smoothed_above(profile: DriverProfile, reference: DriverProfile) -> float | None:
    """Frequency above which a profile has less than `MINIMUM_POWER_SHARE` of real drivers' power at its speed. [Hz]

    None where it is not, up to `KEEPING_BAND`. `reference`: profile of those.
    """
    speed = profile.validity.speed
    if speed is None or profile.model.kind != ModelKind.AUTOREGRESSIVE:
        return None
    top = min(KEEPING_BAND, profile.validity.highest_frequency or KEEPING_BAND)
    at = COMPARED_FREQUENCIES[(COMPARED_FREQUENCIES >= SPLIT_AT) & (top >= COMPARED_FREQUENCIES)]
    fast = fast_part_of(reference)
    driven = np.array([0.5 * sum(speed)])
    strength = sum(
        float(grown[0]) for effect in fast.effects if (grown := effect.strength(STEP, {"speed": driven})) is not None
    )
    low = density_of(profile)(at) < MINIMUM_POWER_SHARE * np.exp(2.0 * strength) * fast.density(at)
    if not len(at) or not low[-1]:
        return None
    return float(np.round(at[len(at) - int(np.argmin(low[::-1])) if not low.all() else 0], 2))


def _band_warnings(profile: DriverProfile, reference: DriverProfile) -> list[str]:
    """What to know about the band that a profile's drives show."""
    highest = profile.validity.highest_frequency
    if profile.model.kind != ModelKind.AUTOREGRESSIVE:
        return []
    if highest is not None and highest < KEEPING_BAND:
        what = f"{profile.name} moves below {highest:g} Hz alone, as its drives show it"
        return [f"{what}: a second table or --prior gives it what is faster"]
    above = smoothed_above(profile, reference)
    if above is None:
        return []
    return [
        f"above {above:g} Hz {profile.name} has less than a fifth of the power of real drivers: if the drives were "
        "smoothed, say so with --valid-below"
    ]
