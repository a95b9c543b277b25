"""Profiles in figures that a person can picture, from movement that is known."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from laboratory.comparison import compare_profiles
from tests.kit.core_models import POPULATION, STEADY
from xosc_lateral.drivers.evaluation.lane_keeping import summarise
from xosc_lateral.drivers.evaluation.metrics import free_runs
from xosc_lateral.drivers.model.profile import DriverProfile


def test_a_sine_is_summed_up_by_its_closed_forms() -> None:
    time = 0.2 * np.arange(3000)
    found = summarise(0.05 + 0.2 * np.sin(2.0 * np.pi * time / 30.0)[None], 0.2)
    assert found.mean_offset == pytest.approx(0.05, abs=1e-9)
    assert found.spread == found.spread_within == pytest.approx(0.2 / np.sqrt(2.0), rel=1e-6)
    assert (found.low, found.high) == pytest.approx(
        (0.05 - 0.2 * np.cos(0.05 * np.pi), 0.05 + 0.2 * np.cos(0.05 * np.pi)), abs=1e-3
    )
    assert found.lateral_speed == pytest.approx(0.2 * 2.0 * np.pi / 30.0 / np.sqrt(2.0), rel=1e-3)


def test_drivers_who_keep_elsewhere_widen_the_whole_and_not_the_one() -> None:
    rng = np.random.default_rng(1)
    runs = 0.3 * np.array([-1.0, 1.0])[:, None] + 0.1 * rng.normal(size=(2, 4000))
    found = summarise(runs, 0.2)
    assert found.spread_within == pytest.approx(0.1, rel=0.03)
    assert found.spread == pytest.approx(np.hypot(0.3, 0.1), rel=0.03)


def test_free_runs_are_as_wide_as_the_profile_s_lane_and_each_by_another_driver() -> None:
    profile = DriverProfile(name="p", model=POPULATION, lane_width=3.5)
    runs = free_runs(profile, 1, drivers=5, duration=20.0)
    assert runs.shape == (5, 101)
    wider = free_runs(replace(profile, lane_width=7.0), 1, drivers=5, duration=20.0)
    np.testing.assert_allclose(wider, 2.0 * runs, rtol=1e-12)
    assert len(np.unique(runs[:, 0])) == 5


def test_fewer_drivers_are_the_first_of_many() -> None:
    profile = DriverProfile(name="p", model=STEADY)
    np.testing.assert_array_equal(
        free_runs(profile, 1, drivers=2, duration=10.0), free_runs(profile, 1, drivers=4, duration=10.0)[:2]
    )


def test_a_profile_is_nearer_to_itself_than_to_one_of_drivers_20_centimetres_farther_left() -> None:
    own = DriverProfile(name="own", model=POPULATION)
    left = DriverProfile(name="left", model=replace(POPULATION, mean=POPULATION.mean + 0.2 / own.lane_width))
    near, far = compare_profiles(own, own), compare_profiles(own, left)
    assert near.mean < 0.25 * far.mean
    assert far.by_metric["mean"] > 5.0 * far.by_metric["std"]
