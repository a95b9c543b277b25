"""Shifted paths: the side, the size, headings and speeds, against geometry worked out by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.motion import RADIUS, drive, entity, two_roads
from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.motion.path_pieces import vertex_times
from xosc_lateral.world.motion.trajectory import displace, distance_driven


def _left_of_nominal(motion, path) -> np.ndarray:  # type: ignore[no-untyped-def]
    """Signed distance of the path to the left of the nominal pose, by the vehicle's own heading. [m]"""
    dx, dy = path.x - motion.x, path.y - motion.y
    return -np.sin(motion.heading) * dx + np.cos(motion.heading) * dy


@pytest.mark.parametrize("rule", ["RHT", "LHT"])
@pytest.mark.parametrize("lane", [-2, 2])
def test_left_stays_left_on_lanes_along_and_against_s_in_right_and_left_hand_traffic(
    tmp_path: Path, rule: str, lane: int
) -> None:
    network = two_roads(tmp_path, rule=rule)
    motion = drive(network, entity(), lane=lane, start=350.0)
    deviation = np.full(len(motion.time), 0.4)
    np.testing.assert_allclose(_left_of_nominal(motion, displace(motion, network, deviation)), 0.4, atol=1e-9)


def test_no_deviation_changes_no_bit(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    motion = drive(network, entity(), start=350.0)
    path = displace(motion, network, np.zeros(len(motion.time)))
    for name in ("x", "y", "z", "heading", "speed"):
        assert (getattr(path, name) == getattr(motion, name)).all()


def test_heading_and_speed_follow_the_shifted_path(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    motion = drive(network, entity(), start=50.0)
    slope = 0.01
    path = displace(motion, network, slope * distance_driven(motion))
    np.testing.assert_allclose(path.heading, np.arctan(slope), atol=1e-9)
    np.testing.assert_allclose(path.speed, 30.0 * np.hypot(1.0, slope), rtol=1e-9)


def test_inside_of_a_left_curve_is_driven_slower(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    motion = drive(network, entity(), lane=-1, start=560.0, duration=5.0)
    radius = RADIUS + 1.75
    path = displace(motion, network, np.full(len(motion.time), 0.5))
    np.testing.assert_allclose(path.speed / motion.speed, (radius - 0.5) / radius, rtol=1e-6)


def test_heading_is_held_at_standstill_and_rows_off_the_road_stay(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    time = np.arange(501)
    motion = drive(network, entity(), start=50.0, speed=np.where(time < 200, 20.0, 0.0))
    path = displace(motion, network, 0.02 * distance_driven(motion))
    assert np.ptp(path.heading[:199]) < 1e-9
    np.testing.assert_allclose(path.heading[210:], path.heading[205], atol=0)
    motion = motion.having(road=np.where(time < 300, motion.road, -1).astype(np.int32))
    off = displace(motion, network, np.full(len(time), 0.3))
    assert (off.x[300:] == motion.x[300:]).all()


def test_being_placed_anew_is_no_driving(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    activity = np.full(501, int(Activity.ACTIVE), dtype=np.uint8)
    activity[250] |= int(Activity.TELEPORTED)
    motion = drive(network, entity(), activity=activity)
    motion = motion.having(x=motion.x + np.where(np.arange(501) < 250, 0.0, 100.0))
    assert distance_driven(motion)[-1] == pytest.approx(499 * 0.6)


@pytest.mark.parametrize(("radius", "step"), [(60.0, 0.05), (200.0, 0.1)])
def test_bends_that_straight_lines_would_cut_by_half_a_centimetre_have_twice_the_vertices(
    radius: float, step: float
) -> None:
    """At 20 m/s chords of 0.1 s are 8 and 2.5 mm beside them: (20 * 0.1)**2 / (8 radius)."""
    time = 0.02 * np.arange(500)
    turned = 20.0 * time / radius
    times = vertex_times(time, radius * np.sin(turned), radius * (1.0 - np.cos(turned)))
    assert np.median(np.diff(times)) == pytest.approx(step, rel=0.05)
