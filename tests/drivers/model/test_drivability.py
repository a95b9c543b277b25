"""What can be driven, and what is done about the rest."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.drivers.model.plausibility import ACCELERATION_LIMIT, JERK_LIMIT, comfort, drivable, strain

STEP = 0.2


def test_comfort_is_the_friction_of_the_design_guide():
    speed = 0.44704 * np.array([30.0, 60.0, 80.0, 150.0])
    assert comfort(speed) == pytest.approx(9.80665 * np.array([0.20, 0.12, 0.08, 0.08]))


def test_strain_of_a_sine_is_that_of_the_closed_form():
    time = np.arange(0.0, 600.0, 0.02)
    found = strain(0.5 * np.sin(2 * np.pi * time / 4.0), 0.02, np.full(len(time), 30.0))
    top = 0.5 * (2 * np.pi / 4.0) ** 2
    assert (found.largest, found.seldom) == pytest.approx((top, top), rel=0.01)
    assert found.jerk == pytest.approx(top * 2 * np.pi / 4.0, rel=0.05)


def test_what_can_be_driven_is_left_alone_and_the_rest_is_smoothed_no_more_than_it_takes():
    rng = np.random.default_rng(0)
    speed = np.full(3000, 30.0)
    calm = 0.3 * np.sin(2 * np.pi * STEP * np.arange(3000) / 15.0)
    assert drivable(calm, STEP, speed) == (pytest.approx(calm), None)
    shaky = calm + 0.1 * rng.normal(size=3000)
    path, bound = drivable(shaky, STEP, speed)
    assert bound is not None and bound.before.excess > 1.0 >= bound.after.excess
    found = strain(path, STEP, speed)
    assert found.largest <= ACCELERATION_LIMIT and found.jerk <= JERK_LIMIT and found.seldom <= comfort(speed[:1])[0]
    assert np.corrcoef(path, calm)[0, 1] > 0.98, "the wander stays"
    assert (path[0], path[-1]) == pytest.approx((shaky[0], shaky[-1]), abs=0.1)
    assert "could not be driven" in str(bound)
