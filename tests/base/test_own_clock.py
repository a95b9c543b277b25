"""The clock of a driver's movement below 40 km/h."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.base.segment import LARGEST_HEADING, MINIMUM_SPEED, clock_rate, own_time, way_of, within_heading


def test_it_is_real_time_from_40_km_h_on_and_stands_with_the_car() -> None:
    assert clock_rate(np.array([11.1111, MINIMUM_SPEED, 12.0, 60.0, -30.0])).tolist() == [1.0] * 5
    assert clock_rate(np.array([0.0]))[0] == 0.0
    near = clock_rate(MINIMUM_SPEED * np.array([0.9999, 1.0]))
    assert near[1] - near[0] < 1e-4  # no jump
    speeds = np.linspace(0.0, 15.0, 200)
    assert (np.diff(clock_rate(speeds)) >= 0.0).all()


def test_it_runs_as_the_law_says() -> None:
    """At the middles of classes, and half-way between two."""
    expected = {0.325: 0.16, 0.65: 0.32, 1.5: 0.44, 2.5: 0.53, 3.25: 0.59, 4.0: 0.65, 6.0: 0.80, 8.0: 0.89}
    assert clock_rate(np.array(list(expected))) == pytest.approx(np.array(list(expected.values())), abs=1e-3)


def test_its_time_is_the_integral_and_the_way_of_its_second_the_speed_over_its_rate() -> None:
    time = np.linspace(0.0, 100.0, 100_001)
    speed = 0.04 * time  # from rest to 4 m/s: trapezoids by hand
    area = 0.65 * 0.16 + 0.85 * 0.38 + 1.0 * 0.485 + 1.5 * 0.59
    assert own_time(time, speed)[-1] == pytest.approx(25.0 * area, rel=1e-6)
    for pace in (0.01, 1.0, 7.0, 11.0, 20.0):
        at = np.array([pace])
        assert way_of(at) == pytest.approx(at / clock_rate(at))


def test_a_path_that_turns_too_far_is_led_through_the_middle_and_another_is_left_alone() -> None:
    distance = np.arange(0.0, 50.0, 0.2)
    calm = 0.2 * np.sin(distance / 10.0)
    assert within_heading(calm, distance) is calm
    step = np.where(distance < 25.0, 0.0, 0.5)
    led = within_heading(step, distance)
    assert np.abs(np.diff(led)).max() <= np.tan(LARGEST_HEADING) * 0.2
    assert (led[0], led[-1]) == (0.0, 0.5)
    assert np.interp(24.9, distance, led) == pytest.approx(0.25, abs=0.01)
