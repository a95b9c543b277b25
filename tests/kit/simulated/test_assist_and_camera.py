"""An assist that steers at times, and cameras that err: what they do to the driver, the record and nothing else."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from examples.driver_simulator.motorway import STEP
from examples.driver_simulator.plants import Context, Intent, SimulatedResponse, saturating, threshold
from tests.kit.simulated.assist import FLAG, OPENLKA_MAP, LaneKeepingAssist, openlka_layout
from tests.kit.simulated.camera_plants import ShakyCamera
from xosc_lateral.files.drives import drives_of_table
from xosc_lateral.files.mapping import parse_map

N = round(2.0 * 3600.0 / STEP)


def planted(plant: LaneKeepingAssist | ShakyCamera, context: Context, seed: int = 1) -> Intent:
    intent = Intent.neutral(N)
    plant.apply(intent, context, np.random.default_rng(seed))
    return intent


# ---- assist ----------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("place", [0.1, 0.2, -0.15])
def test_the_assist_holds_its_own_place_while_it_is_on_and_only_then(place: float) -> None:
    context: Context = {}
    intent = planted(LaneKeepingAssist(place=place), context)
    on = context[FLAG] > 0.5
    np.testing.assert_allclose(intent.target, np.where(on, place, 0.0))
    assert 0.25 < on.mean() < 0.75


@pytest.mark.parametrize("tightness", [0.3, 0.6])
def test_it_lets_less_pass_and_its_hand_is_as_much_calmer(tightness: float) -> None:
    context: Context = {}
    intent = planted(LaneKeepingAssist(tightness=tightness), context)
    on = context[FLAG] > 0.5
    for factor in (intent.tolerance, intent.noise):
        np.testing.assert_allclose(factor, np.where(on, tightness, 1.0))
    np.testing.assert_array_equal(intent.gain, 1.0)
    np.testing.assert_array_equal(intent.camera, 0.0)


def test_it_stays_on_for_minutes_at_a_time() -> None:
    lengths = []
    for seed in range(12):
        context: Context = {}
        planted(LaneKeepingAssist(spell=60.0), context, seed)
        changes = np.flatnonzero(np.diff(context[FLAG]))
        lengths += (np.diff(changes) * STEP).tolist()
    # exponential lengths: the mean of n of them has an error of mean / sqrt(n)
    assert np.mean(lengths) == pytest.approx(60.0, abs=4.0 * 60.0 / np.sqrt(len(lengths)))


def test_a_log_in_openlkas_layout_is_read_as_the_drive_that_it_is() -> None:
    time = np.arange(0.0, 60.0, 0.05)
    offset = 0.2 * np.sin(2.0 * np.pi * time / 20.0)
    table = pd.DataFrame(
        {
            "time": time,
            "speed": 30.0,
            "distance_left": 1.75 - offset,
            "distance_right": 1.75 + offset,
            "lead_distance": 50.0,
            "yaw_rate": 0.003,
            "steering_wheel_angle": 0.0,
            FLAG: (time > 30.0).astype(float),
        }
    )
    written = openlka_layout(table)
    (drive,) = drives_of_table(written, parse_map(OPENLKA_MAP), "log")
    np.testing.assert_allclose(drive.offset, offset, atol=1e-9)
    np.testing.assert_allclose(drive.lane_width, 3.5)
    assert written["op_curvature_actual"].iloc[0] == pytest.approx(0.0001)
    np.testing.assert_array_equal(written[FLAG], time > 30.0)


# ---- cameras ---------------------------------------------------------------------------------------------------------
@pytest.mark.parametrize("size", [0.02, 0.04])
def test_a_shaky_camera_errs_by_its_size_where_the_column_is_high_and_not_where_it_is_lowest(size: float) -> None:
    rng = np.random.default_rng(2)
    column = np.repeat(rng.uniform(0.0, 1.0, N // 500), 500)
    intent = planted(ShakyCamera("rain", size), {"rain": column})
    low, high = np.quantile(column, [0.05, 0.95])
    near_high, near_low = np.abs(column - high) < 0.02, np.abs(column - low) < 0.02
    assert intent.camera[near_high].std() - intent.camera[near_low].std() == pytest.approx(size, rel=0.15)
    assert intent.camera[column == column.min()].std() < 1e-9
    np.testing.assert_array_equal(intent.target, 0.0)


def test_its_error_lasts_for_its_correlation_time() -> None:
    rng = np.random.default_rng(3)
    column = np.repeat(rng.uniform(0.0, 1.0, N // 5000), 5000)
    error = planted(ShakyCamera("rain", 0.04, correlation_time=0.3), {"rain": column}).camera
    lag = round(0.3 / STEP)
    assert np.corrcoef(error[lag:], error[:-lag])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.05)


# ---- responses -------------------------------------------------------------------------------------------------------
def test_a_response_changes_by_one_between_the_ends_of_what_it_is_a_response_to() -> None:
    values = np.random.default_rng(4).normal(size=20_000)
    for shape in (lambda x: x, saturating(0.5), lambda x: -3.0 * x):
        low, middle, high = np.quantile(SimulatedResponse(shape).scaled(values), [0.05, 0.5, 0.95])
        assert high - low == pytest.approx(1.0)
        assert middle == pytest.approx(0.0, abs=1e-9)


def test_a_switch_that_is_seldom_on_counts_whole() -> None:
    seldom = (np.arange(10_000) % 100 < 2).astype(float)
    found = SimulatedResponse(threshold(0.5)).scaled(seldom)
    assert set(np.unique(found)) == {0.0, 1.0}


@pytest.mark.parametrize("seconds", [0.5, 1.0, 3.0])
def test_looking_ahead_is_being_early_by_so_much(seconds: float) -> None:
    values = np.random.default_rng(5).normal(size=5000)
    plain, early = (SimulatedResponse(look_ahead=ahead).scaled(values) for ahead in (0.0, seconds))
    rows = round(seconds / STEP)
    np.testing.assert_array_equal(early[:-rows], plain[rows:])
    np.testing.assert_array_equal(early[-rows:], plain[-1])


def test_nobody_there_counts_as_the_farthest_that_was_seen() -> None:
    values = np.where(np.arange(4000) % 50 < 25, np.nan, np.linspace(10.0, 80.0, 4000))
    found = SimulatedResponse().scaled(values)
    np.testing.assert_array_equal(found[np.isnan(values)], found[np.nanargmax(values)])
