"""What each planted effect does to a driver's intent, and what the simulated motorway is like."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from examples.driver_simulator.motorway import STEP, draw_motorway
from examples.driver_simulator.plants import (
    Context,
    Intent,
    LanePreference,
    Plant,
    ShiftBy,
    SimulatedResponse,
    lagged,
    threshold,
)
from tests.kit.simulated.camera_plants import CameraStep, SensorDrift
from tests.kit.simulated.hidden_plants import Companion, CyclicTarget, Distraction, DriftingTarget, Fatigue
from tests.kit.simulated.spread_plants import RestoringBy, SpreadBy

N = round(3600.0 / STEP)
FIELDS = ("target", "tolerance", "gain", "noise", "attention", "camera")


def planted(plant: Plant, context: Context | None = None, seed: int = 1) -> Intent:
    intent = Intent.neutral(N)
    plant.apply(intent, {} if context is None else context, np.random.default_rng(seed))
    return intent


def changed(intent: Intent) -> set[str]:
    """Fields that differ from those of a driver without any effect."""
    neutral = Intent.neutral(N)
    return {name for name in FIELDS if not np.array_equal(getattr(intent, name), getattr(neutral, name))}


@pytest.fixture(scope="module")
def motorway() -> Context:
    return draw_motorway(3600.0, np.random.default_rng(7))


# ---- hidden effects --------------------------------------------------------------------------------------------------
def test_a_wander_has_its_size_and_its_correlation_time() -> None:
    intent = planted(DriftingTarget(0.2, 30.0))
    assert changed(intent) == {"target"}
    assert intent.target.std() == pytest.approx(0.2)
    assert intent.target.mean() == pytest.approx(0.0, abs=1e-12)
    lag = round(30.0 / STEP)
    products = (intent.target[lag:] * intent.target[:-lag]).mean() / intent.target.var()
    assert products == pytest.approx(np.exp(-1.0), abs=0.2)


@pytest.mark.parametrize(("amplitude", "period"), [(0.15, 12.0), (0.05, 40.0)])
def test_a_cycle_is_a_sine_of_any_phase(amplitude: float, period: float) -> None:
    time = STEP * np.arange(N)
    phases = []
    for seed in range(5):
        target = planted(CyclicTarget(amplitude, period), seed=seed).target
        turn = np.exp(-2j * np.pi * time / period) @ target * 2.0 / N
        assert abs(turn) == pytest.approx(amplitude, rel=1e-3)
        phases.append(round(float(np.angle(turn)), 3))
    assert len(set(phases)) == 5


def test_fatigue_widens_by_its_factor_from_end_to_end() -> None:
    intent = planted(Fatigue(2.0))
    assert changed(intent) == {"tolerance", "noise"}
    assert intent.tolerance[-1] / intent.tolerance[0] == pytest.approx(2.0)
    assert np.log(intent.tolerance).mean() == pytest.approx(0.0, abs=1e-12)
    assert np.diff(intent.noise).min() > 0.0


def test_distraction_is_on_for_its_share_and_looks_away_only_then() -> None:
    shares, lengths = [], []
    for seed in range(12):
        intent = planted(Distraction(0.3, 40.0, 2.2), seed=seed)
        on = intent.tolerance > 1.0
        shares.append(on.mean())
        edges = np.flatnonzero(np.diff(on.astype(int)))
        lengths += [STEP * (b - a) for a, b in pairwise(edges) if on[a + 1]]
        assert set(np.unique(intent.tolerance)) == {1.0, 2.2}
        assert intent.attention[~on].all()
        assert intent.attention[on].mean() == pytest.approx(0.7, abs=0.02)  # 0.9 s of every 3 s
    assert np.mean(shares) == pytest.approx(0.3, abs=0.06)
    assert np.mean(lengths) == pytest.approx(40.0, rel=0.2)


@pytest.mark.parametrize("plant", [CameraStep(0.25, 0.45), SensorDrift(0.3)])
def test_errors_of_the_camera_leave_the_driver_alone(plant: Plant) -> None:
    assert changed(planted(plant)) == {"camera"}


def test_a_step_reads_more_to_the_left_from_its_time_on_and_a_drift_by_its_size_in_all() -> None:
    step = planted(CameraStep(0.25, 0.45)).camera
    assert (step[: round(0.45 * N)] == 0.0).all()
    assert (step[round(0.45 * N) :] == 0.25).all()
    drift = planted(SensorDrift(0.3)).camera
    assert (drift[0], drift[-1]) == pytest.approx((-0.15, 0.15))
    np.testing.assert_allclose(np.diff(drift), 0.3 / (N - 1))


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
def test_a_companion_is_correlated_as_it_says_and_moves_nothing(correlation: float, motorway: Context) -> None:
    context = dict(motorway)
    intent = planted(Companion("wind_speed", "gust", correlation), context)
    assert not changed(intent)
    assert np.corrcoef(context["gust"], context["wind_speed"])[0, 1] == pytest.approx(correlation, abs=0.12)
    assert set(context) - set(motorway) == {"gust"}


def test_a_companion_of_a_column_with_gaps_has_none_itself(motorway: Context) -> None:
    context = dict(motorway)
    planted(Companion("lead_distance", "echo"), context)
    assert np.isfinite(context["echo"]).all()


# ---- effects of columns ----------------------------------------------------------------------------------------------
def test_a_shift_moves_the_target_by_its_size_between_the_ends_of_the_column(motorway: Context) -> None:
    intent = planted(ShiftBy(("grade",), 0.2, SimulatedResponse(lag=0.0)), dict(motorway))
    assert changed(intent) == {"target"}
    low, high = np.quantile(motorway["grade"], [0.05, 0.95])
    at = [intent.target[np.abs(motorway["grade"] - end) < 0.05].mean() for end in (low, high)]
    assert at[1] - at[0] == pytest.approx(0.2, abs=0.01)


def test_a_shift_by_a_switch_is_its_whole_size(motorway: Context) -> None:
    intent = planted(ShiftBy(("truck_right",), 0.25, SimulatedResponse(lag=0.0)), dict(motorway))
    on = motorway["truck_right"] > 0.5
    assert intent.target[on].mean() - intent.target[~on].mean() == pytest.approx(0.25, abs=1e-9)


@pytest.mark.parametrize("plant", [SpreadBy("wind_speed", 1.8), RestoringBy("wind_speed", 2.0)])
def test_spread_and_restoring_leave_the_target_where_it_is(plant: Plant, motorway: Context) -> None:
    fields = changed(planted(plant, dict(motorway)))
    assert fields
    assert not fields & {"target", "camera"}


def test_a_preference_by_lane_is_a_level_for_each_lane(motorway: Context) -> None:
    intent = planted(LanePreference(), dict(motorway))
    assert changed(intent) == {"target"}
    lane = np.rint(motorway["lane_index"])
    settled = [slice(k, k + 1) for k in range(50, N, 997)]
    levels = {float(lane[rows][0]) for rows in settled}
    means = [intent.target[lane == level].mean() for level in sorted(levels)]
    assert max(means) - min(means) > 0.05


def test_a_lag_is_exponential_and_begins_settled() -> None:
    step = np.where(np.arange(N) * STEP < 10.0, 1.0, 3.0)
    response = lagged(step, 2.0)
    begin = round(10.0 / STEP)
    assert (response[:begin] == pytest.approx(1.0)) is True
    after = response[begin - 1 + round(2.0 / STEP)]
    assert after == pytest.approx(3.0 - 2.0 * np.exp(-1.0), abs=1e-9)
    np.testing.assert_array_equal(lagged(step, 0.0), step)


def test_a_threshold_is_all_or_nothing(motorway: Context) -> None:
    response = SimulatedResponse(threshold(2.0), lag=0.0)
    shaped = response.scaled(motorway["grade"])
    calm = motorway["grade"] < 2.0
    assert len(np.unique(shaped[calm])) == len(np.unique(shaped[~calm])) == 1
    assert shaped[~calm][0] - shaped[calm][0] == pytest.approx(1.0)


# ---- the motorway ----------------------------------------------------------------------------------------------------
def test_columns_are_within_what_a_motorway_has(motorway: Context) -> None:
    ranges = {
        "speed": (20.0, 45.0), "curvature": (-1.0 / 560.0, 1.0 / 560.0), "lane_width": (3.25, 3.75),
        "wind_direction": (0.0, 360.0), "crossfall": (-2.5, 2.5), "rain": (0.0, 6.0), "illuminance": (400.0, 20_000.0),
        "truck_right": (0.0, 1.0), "car_left": (0.0, 1.0),
    }  # fmt: skip
    for name, (low, high) in ranges.items():
        assert low - 1e-9 <= np.nanmin(motorway[name]), name
        assert np.nanmax(motorway[name]) <= high + 1e-9, name
    assert {len(values) for values in motorway.values()} == {N}


def test_nobody_is_beside_the_outer_lanes_where_there_is_no_lane(motorway: Context) -> None:
    lane = motorway["lane_index"]
    assert not motorway["truck_right"][lane == 0].any()
    assert not motorway["car_left"][lane == lane.max()].any()


def test_curvature_is_continuous_along_the_way(motorway: Context) -> None:
    """Clothoids of 80 m and more lead to at most 1 / 560 m."""
    per_metre = np.abs(np.diff(motorway["curvature"])) / (motorway["speed"][1:] * STEP)
    assert per_metre.max() <= 1.01 / 560.0 / 80.0


def test_lane_changes_take_seconds_and_lead_to_the_next_lane(motorway: Context) -> None:
    way = motorway["lane_change"]
    np.testing.assert_array_equal(np.rint(way), motorway["lane_index"])
    moving = way != np.rint(way)
    edges = np.flatnonzero(np.diff(moving.astype(int)))
    begins, ends = edges[~moving[edges]], edges[moving[edges]]
    whole = [(a, b) for a, b in zip(begins, ends, strict=False) if b > a]
    assert whole
    for a, b in whole:
        assert 4.0 <= (b - a) * STEP <= 8.1
        assert abs(way[min(b + 1, N - 1)] - way[a]) == pytest.approx(1.0)


@pytest.mark.parametrize(("seed", "other"), [(1, 2), (3, 4)])
def test_drives_of_other_seeds_are_other_drives(seed: int, other: int) -> None:
    one, same, next_one = (draw_motorway(120.0, np.random.default_rng(k)) for k in (seed, seed, other))
    for name, values in one.items():
        np.testing.assert_array_equal(values, same[name])
    assert not np.array_equal(one["speed"], next_one["speed"])
