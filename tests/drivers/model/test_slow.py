"""Sampled offsets below 40 km/h."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.profiles import simulated_profile
from xosc_lateral.base.segment import LARGEST_HEADING, MINIMUM_SPEED, Segment, own_time
from xosc_lateral.drivers.model.sampling import sample_offsets

STEP = 0.2


def even(speed: np.ndarray) -> Segment:
    n = len(speed)
    return Segment(STEP * np.arange(n), np.full(n, 3.5), speed, {"speed": speed})


def test_a_standing_driver_stays_and_the_same_movement_goes_on_afterwards() -> None:
    fast = sample_offsets(simulated_profile(), even(np.full(200, 20.0)), 1)
    speed = np.concatenate([np.full(50, 20.0), np.zeros(100), np.full(150, 20.0)])
    stops = sample_offsets(simulated_profile(), even(speed), 1)
    np.testing.assert_allclose(stops[:49], fast[:49], atol=1e-9)
    assert np.ptp(stops[51:149]) == 0.0
    own = own_time(STEP * np.arange(300), speed)
    np.testing.assert_allclose(
        stops[160:], np.interp(own[160:], STEP * np.arange(200), fast)[: len(stops) - 160], atol=0.01
    )


@pytest.mark.parametrize("speed", [0.3, 1.0, 4.0])
def test_nobody_turns_further_than_three_degrees(speed: float) -> None:
    for seed in range(20):
        offset = sample_offsets(simulated_profile(), even(np.full(500, speed)), seed)
        assert np.abs(np.diff(offset)).max() <= np.tan(LARGEST_HEADING) * speed * STEP


def test_what_is_not_slow_or_not_known_is_sampled_in_real_time() -> None:
    profile = simulated_profile()
    known, unknown = (sample_offsets(profile, even(np.full(100, v)), 2) for v in (MINIMUM_SPEED, np.nan))
    np.testing.assert_array_equal(known, unknown)
