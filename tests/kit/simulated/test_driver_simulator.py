"""The simulator does what it says: without it, no test that plants an effect means anything."""

from __future__ import annotations

import itertools

import numpy as np
import pandas as pd
import pytest

from tests.kit.simulated import (
    CameraStep,
    Companion,
    CyclicTarget,
    Distraction,
    DriftingTarget,
    Fatigue,
    LanePreference,
    RestoringBy,
    SensorDrift,
    ShiftBy,
    SideWind,
    SimulatedDrive,
    SpreadBy,
    curve_cutting,
    simulate_drive,
    simulate_population,
    truck_avoidance,
)

MINUTE = 60.0


def spread(drive: SimulatedDrive, where: np.ndarray) -> float:
    return float(drive.truth.offset[where & ~drive.truth.lane_change].std())


def offsets(table: pd.DataFrame) -> np.ndarray:
    return np.asarray((table["distance_right"] - table["distance_left"]) / 2.0)


def test_the_same_seed_gives_the_same_drive_and_another_seed_another():
    first, again, other = (simulate_drive(5 * MINUTE, seed).table for seed in (3, 3, 4))
    pd.testing.assert_frame_equal(first, again)
    assert not np.array_equal(first["distance_left"].head(100), other["distance_left"].head(100))


def test_rows_come_at_18_to_25_hz_with_jitter_and_gaps_but_never_backwards():
    for seed in range(3):
        step = np.diff(simulate_drive(10 * MINUTE, seed).table["time"])
        assert step.min() > 0.0
        assert 1 / 26 < np.median(step) < 1 / 17
        assert step.max() > 1.7 * np.median(step)


def test_the_table_holds_no_missing_value_but_for_a_leader_that_is_not_there():
    table = simulate_drive(20 * MINUTE, 1).table
    assert set(table.columns[table.isna().any()]) == {"lead_distance"}
    assert (table.loc[table["lane_index"] == 0, "truck_right"].mean()) < 0.02  # only while it leaves that lane
    assert 3.0 < (table["distance_left"] + table["distance_right"]).min() < 3.5


def test_an_undisturbed_driver_moves_as_drivers_do():
    drives = [simulate_drive(20 * MINUTE, seed) for seed in range(6)]
    spreads = [spread(drive, np.ones(len(drive.table), bool)) for drive in drives]
    assert min(spreads) > 0.15 and max(spreads) < 0.45
    assert 0.2 < np.median(spreads) < 0.3
    changes = [np.count_nonzero(np.diff(drive.table["lane_index"])) for drive in drives]
    assert min(changes) >= 3 and max(changes) <= 20
    assert all(0.3 < drive.truth.corrections / (20 * MINUTE) < 3.0 for drive in drives)


def test_it_resembles_drives_of_another_simulator_in_spread_and_spectrum(shared):
    """Octave by octave, the median of ours is within a factor of 1.7 of the median of theirs."""
    theirs = np.median(
        [_bands(pd.read_parquet(path)) for path in sorted((shared / "drives").glob("*.parquet"))], axis=0
    )
    ours = np.median([_bands(simulate_drive(50 * MINUTE, seed).table) for seed in range(6)], axis=0)
    assert np.all(np.abs(np.log(ours / theirs)) < np.log(1.7)), (ours, theirs)


def _bands(table: pd.DataFrame) -> np.ndarray:
    """RMS [m] of the offset outside of lane changes in six bands between 0.005 and 2.5 Hz."""
    from scipy.signal import welch

    time = np.arange(0.0, table["time"].iloc[-1], 0.2)
    offset = np.interp(time, table["time"], offsets(table))
    changed = table["time"].to_numpy()[np.flatnonzero(np.diff(table["lane_index"]))]
    kept = np.all(np.abs(time[:, None] - changed) > 8.0, axis=1)
    runs = np.split(np.flatnonzero(kept), np.flatnonzero(np.diff(np.flatnonzero(kept)) > 1) + 1)
    spectra = [(len(run), welch(offset[run], 5.0, nperseg=512)[1]) for run in runs if len(run) >= 512]
    density = np.average([spectrum for _, spectrum in spectra], axis=0, weights=[n for n, _ in spectra])
    frequency = np.fft.rfftfreq(512, 0.2)
    edges = [0.005, 0.03, 0.1, 0.3, 0.6, 1.0, 2.5]
    within = [(frequency >= a) & (frequency < b) for a, b in itertools.pairwise(edges)]
    return np.sqrt([density[band].sum() * frequency[1] for band in within])


@pytest.mark.parametrize(
    "plant",
    [curve_cutting(0.25), truck_avoidance(0.25), SideWind(0.25), LanePreference(), ShiftBy(("speed",), 0.25)],
    ids=lambda plant: plant.columns[0],
)
def test_a_shift_of_the_target_moves_the_car_by_as_much(plant):
    """Mean slope of the offset on the target over six drives of half an hour; each scatters by about 0.25."""
    slopes = []
    for seed in range(6):
        truth = simulate_drive(30 * MINUTE, seed, effects=[plant]).truth
        target = truth.target[~truth.lane_change] - truth.target[~truth.lane_change].mean()
        slopes.append(target @ truth.offset[~truth.lane_change] / (target @ target))
    assert np.mean(slopes) == pytest.approx(1.0, abs=0.3)


@pytest.mark.pages
def test_an_ordinary_driver_neither_cuts_curves_nor_is_carried_out_of_them():
    """Mean slope of the offset on the shift that a curve cutter of 0.25 m would show; scatters by 0.26 per drive."""
    slopes = []
    for seed in range(10):
        cutter, ordinary = (simulate_drive(50 * MINUTE, seed, effects=e).truth for e in ([curve_cutting(0.25)], []))
        shift = cutter.target[~cutter.lane_change] - cutter.target[~cutter.lane_change].mean()
        slopes.append(shift @ ordinary.offset[~ordinary.lane_change] / (shift @ shift))
    assert np.mean(slopes) == pytest.approx(0.0, abs=3.0 * 0.26 / np.sqrt(10))


def test_curves_are_cut_ahead_of_the_curve():
    table_truth = [simulate_drive(30 * MINUTE, seed, effects=[curve_cutting(0.5, look_ahead=2.5)]) for seed in range(3)]
    leads = np.arange(-6.0, 6.1, 0.5)
    fits = np.zeros(len(leads))
    for drive in table_truth:
        time, kept = drive.truth.time, ~drive.truth.lane_change
        for number, lead in enumerate(leads):
            curvature = np.interp(time + lead, time, drive.table["curvature"])
            fits[number] += np.corrcoef(curvature[kept], drive.truth.offset[kept])[0, 1]
    assert 1.0 <= leads[fits.argmax()] <= 4.0


@pytest.mark.parametrize("plant", [SpreadBy("speed", 2.0), RestoringBy("speed", 0.25)], ids=["spread", "restoring"])
def test_spread_and_restoring_effects_change_the_spread_where_the_column_is_high(plant):
    def ratio(drive: SimulatedDrive) -> float:
        low, high = np.quantile(drive.table["speed"], [0.25, 0.75])
        return spread(drive, (drive.table["speed"] > high).to_numpy()) / spread(
            drive, (drive.table["speed"] < low).to_numpy()
        )

    with_effect = [ratio(simulate_drive(40 * MINUTE, seed, effects=[plant])) for seed in range(5)]
    without = [ratio(simulate_drive(40 * MINUTE, seed)) for seed in range(5)]
    assert np.mean(with_effect) > 1.2 * np.mean(without)


def test_fatigue_spreads_the_second_half():
    def ratio(drive: SimulatedDrive) -> float:
        late = drive.truth.time > 15 * MINUTE
        return spread(drive, late) / spread(drive, ~late)

    tired = [ratio(simulate_drive(30 * MINUTE, seed, effects=[Fatigue(3.0)])) for seed in range(3)]
    fresh = [ratio(simulate_drive(30 * MINUTE, seed)) for seed in range(3)]
    assert np.mean(tired) > 1.3 * np.mean(fresh)


@pytest.mark.parametrize(
    "plant", [Distraction(), CyclicTarget(0.3), DriftingTarget(0.3)], ids=["regime", "weave", "wander"]
)
def test_hidden_effects_widen_the_spread(plant):
    everywhere = [
        [
            spread(drive, drive.truth.time >= 0.0)
            for drive in (simulate_drive(15 * MINUTE, seed, effects=effects) for seed in range(4))
        ]
        for effects in ([plant], [])
    ]
    assert np.mean(everywhere[0]) > 1.12 * np.mean(everywhere[1])


@pytest.mark.parametrize("plant", [CameraStep(0.25, at=0.5), SensorDrift(0.5)], ids=["step", "drift"])
def test_an_error_of_the_camera_changes_the_record_and_not_the_car(plant):
    wrong, right = (simulate_drive(10 * MINUTE, 2, effects=effects) for effects in ([plant], []))
    np.testing.assert_array_equal(wrong.truth.offset, right.truth.offset)
    late = wrong.truth.time > 5 * MINUTE
    added = offsets(wrong.table) - offsets(right.table)
    assert added[late].mean() - added[~late].mean() == pytest.approx(0.25, abs=0.002)


def test_a_companion_column_follows_its_column_and_moves_nobody():
    alone, accompanied = (
        simulate_drive(10 * MINUTE, 5, effects=e) for e in ([], [Companion("wind_speed", "spray", 0.9)])
    )
    np.testing.assert_array_equal(alone.truth.offset, accompanied.truth.offset)
    assert accompanied.table["spray"].corr(accompanied.table["wind_speed"]) == pytest.approx(0.9, abs=0.08)


def test_the_cause_can_be_left_out_of_the_table():
    whole = simulate_drive(2 * MINUTE, 5, effects=[SideWind()])
    partial = simulate_drive(2 * MINUTE, 5, effects=[SideWind()], drop=["wind_speed", "wind_direction"])
    assert "wind_speed" not in partial.table
    np.testing.assert_array_equal(whole.truth.offset, partial.truth.offset)


def test_people_differ():
    table = simulate_population(8, 10 * MINUTE, seed=1)
    spreads = pd.Series(offsets(table)).groupby(table["drive"].to_numpy()).std()
    assert len(spreads) == 8
    assert spreads.max() > 1.2 * spreads.min()
