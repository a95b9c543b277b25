"""What a profile's sensor adds to what is sampled, for tests of a perception chain."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.seeds import DriveSeed, generator
from xosc_lateral.driver.sensor.model import SensorModel
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


def known_sensor(profile: DriverProfile) -> SensorModel:
    """What the profile's drives were measured by.

    Raises `DriverProfileError` when the profile doesn't know.
    """
    if profile.sensor is None:
        raise DriverProfileError(f"profile {profile.name} holds no sensor: fit it anew, or sample the driver alone")
    return profile.sensor


def sensor_error(
    sensor: SensorModel | None,
    path: FloatArray,
    step: float,
    seed: np.random.SeedSequence,
    part: int = 0,
) -> FloatArray:
    """Error on a drive's sampled path, shape (n,), from random numbers of its own; zeros without a sensor. [m]

    `part` numbers the pieces of one drive: a sensor knows nothing of what it measured minutes ago.
    """
    if sensor is None:
        return np.zeros(len(path))
    return sensor.sample(len(path), step, generator(seed, DriveSeed.SENSOR, part))


def recorded(
    sensor: SensorModel | None,
    draw: Callable[[float], FloatArray],
    n: int,
    start: float,
    step: float,
    seed: np.random.SeedSequence,
) -> FloatArray:
    """A sampled path of n offsets with the sensor's error on it, the sum of which begins at `start`. [m]

    `draw` samples the path from a given start [m].
    """
    if sensor is None:
        return draw(start)
    rng = generator(seed, DriveSeed.SENSOR, 0)
    noise = sensor.sample(n, step, rng)
    return draw(start - float(noise[0])) + noise
