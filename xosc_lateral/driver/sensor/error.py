"""What a profile's sensor adds to what is sampled, for tests of a perception chain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.seeds import DriveSeed, generator
from xosc_lateral.driver.sensor.model import SensorModel
from xosc_lateral.errors import DriverProfileError

FloatArray = NDArray[np.float64]


def known_sensor(profile: DriverProfile) -> SensorModel:
    """What the profile's drives were measured by.

    Raises
    ------
    DriverProfileError
        When the profile doesn't know.
    """
    if profile.sensor is None:
        raise DriverProfileError(f"profile {profile.name} holds no sensor: fit it anew, or sample the driver alone")
    return profile.sensor


def sensor_error(
    sensor: SensorModel | None, n: int, step: float, seed: np.random.SeedSequence, part: int = 0
) -> FloatArray:
    """Error on n offsets of a drive, `step` seconds apart, from random numbers of its own; zeros without a sensor. [m]

    `part` tells the pieces of one drive apart: a sensor knows nothing of what it measured minutes ago.
    """
    return np.zeros(n) if sensor is None else sensor.sample(n, step, generator(seed, DriveSeed.SENSOR, part))
