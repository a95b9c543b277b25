"""Speeds of straight pieces come back from the way that they give."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.extras.recordings.plan import SpeedProfile, fit_speed

TIME = np.arange(0.0, 60.05, 0.1)


def driven(corners: list[float], speeds: list[float]) -> np.ndarray:
    return SpeedProfile(np.array(corners), np.array(speeds), 0.0).way(TIME)


@pytest.mark.parametrize(
    ("corners", "speeds"),
    [
        ([0.0, 60.0], [30.0, 30.0]),
        ([0.0, 20.0, 25.0, 60.0], [30.0, 30.0, 20.0, 20.0]),
        ([0.0, 13.3, 16.7, 30.0, 41.0, 60.0], [25.0, 25.0, 31.0, 31.0, 5.0, 0.0]),
    ],
)
def test_planted_corners_are_found_and_no_others(corners, speeds):
    found = fit_speed(TIME, driven(corners, speeds), error=0.5)
    assert found.time == pytest.approx(corners, abs=0.01)
    assert found.speed == pytest.approx(speeds, abs=0.01)


def test_a_way_integrates_its_speed():
    rng = np.random.default_rng(3)
    profile = SpeedProfile(np.cumsum(rng.uniform(1, 9, 8)), rng.uniform(0, 40, 8), 5.0)
    fine = np.linspace(profile.time[0], profile.time[-1], 200_001)
    speed = np.interp(fine, profile.time, profile.speed)
    summed = 5.0 + np.r_[0.0, np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))]
    assert np.abs(profile.way(fine) - summed).max() < 1e-4


@pytest.mark.parametrize("error", [0.2, 1.0])
def test_positions_of_a_restless_driver_stay_within_the_bound_and_a_looser_one_needs_fewer_corners(error):
    rng = np.random.default_rng(5)
    wish = np.interp(TIME, np.arange(0, 61, 4), rng.normal(0.0, 0.5, 16))
    way = np.cumsum((30.0 + np.cumsum(wish) * 0.1) * 0.1)
    found = fit_speed(TIME, way, error=error)
    assert np.abs(found.way(TIME) - way).max() <= 1.02 * error  # rows between those that are looked at
    assert len(fit_speed(TIME, way, error=3.0 * error).time) < len(found.time)


def test_who_stands_never_drives_backwards():
    stop = np.where(TIME < 20.0, 20.0 * TIME - 0.5 * TIME**2, 200.0) + 0.01 * np.sin(7 * TIME)
    found = fit_speed(TIME, stop, error=0.5)
    assert found.speed.min() >= 0.0
    assert np.abs(found.way(TIME) - stop).max() < 0.6


def test_three_rows_are_an_even_speed():
    found = fit_speed(np.array([1.0, 2.0, 3.0]), np.array([5.0, 15.0, 25.0]), error=0.5)
    assert found.speed.tolist() == [10.0, 10.0]
    assert found.start == 5.0
