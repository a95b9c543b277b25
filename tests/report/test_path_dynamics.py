"""Lateral acceleration and jerk of paths whose dynamics are known, and silence beside gaps."""

from __future__ import annotations

import numpy as np
import pytest

from tests.motion.made_motion import RADIUS, drive, entity, two_roads
from xosc_lateral.motion.nominal import Activity, EntityMotion
from xosc_lateral.motion.trajectory import WorldTrajectory, displace
from xosc_lateral.report.path_dynamics import STEP, lateral_dynamics
from xosc_lateral.road.network import RoadNetwork


@pytest.fixture(scope="module")
def network(tmp_path_factory: pytest.TempPathFactory) -> RoadNetwork:
    return two_roads(tmp_path_factory.mktemp("roads"))


def nominal(network: RoadNetwork, motion: EntityMotion) -> WorldTrajectory:
    return displace(motion, network, np.zeros(len(motion.time)))


def test_in_a_left_bend_the_acceleration_is_to_the_left_and_of_the_circle(network: RoadNetwork) -> None:
    motion = drive(network, entity(), lane=-1, start=550.0, duration=10.0)
    found = lateral_dynamics(motion, nominal(network, motion))
    radius = RADIUS + 1.75  # the first lane to the right of the reference line
    speed = np.hypot(np.diff(motion.x), np.diff(motion.y))[5] / 0.02
    np.testing.assert_allclose(found.acceleration[3:-3], speed**2 / radius, rtol=1e-3)
    np.testing.assert_allclose(found.jerk[5:-5], 0.0, atol=0.02)


def test_who_drives_the_other_way_feels_it_on_the_right(network: RoadNetwork) -> None:
    motion = drive(network, entity(), lane=1, start=50.0, duration=10.0)
    assert (lateral_dynamics(motion, nominal(network, motion)).acceleration[3:-3] < -1.0).all()


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["left", "right"])
def test_a_weave_on_a_straight_has_the_derivatives_of_its_sine(network: RoadNetwork, side: float) -> None:
    motion = drive(network, entity(), lane=-2, duration=12.0)
    omega, size = 2.0 * np.pi / 6.0, 0.4 * side
    path = displace(motion, network, size * np.sin(omega * motion.time))
    found = lateral_dynamics(motion, path)
    inside = slice(3, -3)
    expected = -size * omega**2 * np.sin(omega * found.time)
    np.testing.assert_allclose(found.acceleration[inside], expected[inside], atol=0.02)
    steeper = -size * omega**3 * np.cos(omega * found.time)
    np.testing.assert_allclose(found.jerk[inside], steeper[inside], atol=0.04)


def test_rows_are_a_tenth_of_a_second_apart(network: RoadNetwork) -> None:
    motion = drive(network, entity(), duration=5.0)
    found = lateral_dynamics(motion, nominal(network, motion))
    np.testing.assert_allclose(np.diff(found.time), STEP)
    assert np.isnan(found.acceleration[[0, -1]]).all()  # one-sided differences there


@pytest.mark.parametrize("flag", [Activity.TELEPORTED, None], ids=["placed anew", "absent"])
def test_beside_a_gap_nothing_is_said(network: RoadNetwork, flag: Activity | None) -> None:
    n = 501
    activity = np.full(n, int(Activity.ACTIVE), dtype=np.uint8)
    activity[250] = int(Activity.ACTIVE | flag) if flag else 0
    motion = drive(network, entity(), duration=10.0, activity=activity)
    found = lateral_dynamics(motion, nominal(network, motion))
    silent = np.flatnonzero(np.isnan(found.acceleration))
    assert set(silent) == {0, 48, 49, 50, 51, 52, 100}


@pytest.mark.parametrize("duration", [0.0, 0.1])
def test_too_short_a_motion_has_no_dynamics(network: RoadNetwork, duration: float) -> None:
    motion = drive(network, entity(), duration=duration)
    found = lateral_dynamics(motion, nominal(network, motion))
    assert np.isnan(found.acceleration).all()
    assert len(found.time) == len(found.jerk) == len(found.acceleration)
