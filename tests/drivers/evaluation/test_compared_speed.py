"""Profiles are compared at one speed: that of the drives, not one at which only one of them was ever driven."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from xosc_lateral.drivers.drives.drive import Drive
from xosc_lateral.drivers.evaluation.metrics import free_runs
from xosc_lateral.drivers.evaluation.profile_comparison import common_speed, compare
from xosc_lateral.drivers.evaluation.sizes import surest
from xosc_lateral.drivers.fitting.fitting import fit_profile
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.validity import Validity
from xosc_lateral.files.profiles import find_profile, read_profile

SPEED = 14.0
"""Of the sampled drives: `rural` moves faster from there to 26 m/s, its reference, by a quarter and more. [m/s]"""


@pytest.fixture(scope="module")
def rural() -> DriverProfile:
    return read_profile(find_profile("rural"))


@pytest.mark.pages
def test_a_driver_sampled_at_a_low_speed_and_fitted_is_told_apart_from_nobody(rural: DriverProfile) -> None:
    offsets = free_runs(rural, 1, drivers=9, duration=600.0, speed=SPEED)
    time = 0.2 * np.arange(offsets.shape[1], dtype=np.float64)
    width, speed = np.full(len(time), rural.lane_width), {"speed": np.full(len(time), SPEED)}
    drives = [Drive(name=str(k), time=time, offset=x, lane_width=width, context=speed) for k, x in enumerate(offsets)]
    fitted = fit_profile(drives, name="again")
    (parts,) = compare([rural, fitted], 0).differences.values()
    assert surest(parts) > 0.05
    elsewhere = replace(fitted, validity=Validity(speed=(24.0, 24.0)))  # the same, believed to be of faster drives
    (parts,) = compare([rural, elsewhere], 0).differences.values()
    assert surest(parts) < 0.05


def test_the_common_speed_is_one_that_both_were_driven_at(rural: DriverProfile) -> None:
    def at(low: float | None = None, high: float = 0.0) -> DriverProfile:
        return replace(rural, validity=Validity(speed=None if low is None else (low, high)))

    assert common_speed(at(12.0, 25.0), at(21.0, 47.0)) == 23.0
    assert common_speed(at(12.0, 47.0), at(25.0, 25.0)) == 25.0
    assert common_speed(at(12.0, 15.0), at(25.0, 30.0)) == 20.0
    assert common_speed(at(), at(20.0, 30.0)) == 25.0
    assert common_speed(at(), at()) == pytest.approx(95.0 / 3.6)
