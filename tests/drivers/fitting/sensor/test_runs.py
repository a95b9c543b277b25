"""The driver's part of runs, and the sensor's error for tests of a perception chain."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.core_models import POPULATION
from tests.kit.runs import made_run
from xosc_lateral.base.errors import DriverProfileError
from xosc_lateral.drivers.drives.drive import Drive, cut_runs
from xosc_lateral.drivers.fitting.fitting import driver_runs, rows_of
from xosc_lateral.drivers.fitting.sensor.periodogram import WINDOWS
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.drivers.model.sampled_offsets import known_sensor, sensor_error
from xosc_lateral.drivers.model.sensor import SensorModel

STEP = 0.2
SEED = np.random.SeedSequence(5)
SENSOR = SensorModel(white=2.0 * STEP * 0.02**2)
"""0.02 m of white noise on rows of 5 Hz, of which 1.5 of 2.5 Hz are left in runs."""


def recorded(rate: float = 20.0, seconds: float = 30.0, start: float = 100.0) -> Drive:
    time = start + np.arange(round(seconds * rate)) / rate
    return Drive("d", time, 0.1 * np.sin(time), np.full(len(time), 3.5))


def test_runs_shorter_than_a_spectrum_are_left_alone() -> None:
    run = made_run(np.random.default_rng(1).normal(size=round(WINDOWS[-1] / STEP) - 1))
    kept, sensor = driver_runs([run])
    assert kept == [run]
    assert sensor is None
    assert driver_runs([]) == ([], None)


def test_a_sensors_share_is_over_time_not_over_rows() -> None:
    """A tracker that gives three times as many rows on one side of the lane doesn't make the driver more of it."""
    rng = np.random.default_rng(3)
    slow = np.cumsum(rng.normal(size=400)) * 0.02
    offset = np.interp(np.arange(0.0, 400.0, 0.05), np.arange(400.0), slow - slow.mean())
    time = np.arange(len(offset)) / 20.0
    seen = (np.arange(len(offset)) % 3 == 0) | (offset > 0.0)
    noise = 0.03 * rng.normal(size=len(offset))
    uneven = Drive("d", time[seen], (offset + noise)[seen], np.full(seen.sum(), 3.5))
    (run,) = cut_runs(uneven)
    _, durations, _ = rows_of([run], [uneven])
    assert durations is not None
    assert np.concatenate(durations).sum() == pytest.approx(run.time[-1] - run.time[0], abs=0.3)
    _, sensor = driver_runs([run], [uneven])
    assert sensor is not None
    assert np.sqrt(sensor.sensor_variance) == pytest.approx(0.03, rel=0.3)


def test_rows_as_recorded_are_those_within_each_run() -> None:
    drive = recorded()
    run = made_run(np.zeros(50))
    run = type(run)("d", 0, 110.0 + STEP * np.arange(50), run.offset, run.lane_width)
    rows, _, rate = rows_of([run], [drive])
    assert rate == pytest.approx(20.0)
    assert rows is not None
    inside = (drive.time >= 110.0 - 1e-6) & (drive.time <= 119.8 + 1e-6)
    np.testing.assert_array_equal(rows[0], drive.offset[inside])


def test_without_the_drive_of_a_run_there_are_no_rows() -> None:
    assert rows_of([made_run(np.zeros(50), drive="elsewhere")], [recorded()]) == (None, None, None)


def test_a_profile_without_a_sensor_says_so() -> None:
    bare = DriverProfile(name="bare", model=POPULATION)
    with pytest.raises(DriverProfileError, match="profile bare holds no sensor: fit it anew"):
        known_sensor(bare)
    assert known_sensor(DriverProfile(name="own", model=POPULATION, sensor=SENSOR)) is SENSOR


def test_without_a_sensor_nothing_is_added() -> None:
    np.testing.assert_array_equal(sensor_error(None, np.zeros(5), STEP, SEED), np.zeros(5))


def test_the_error_has_the_power_of_its_density_below_the_runs_low_pass() -> None:
    error = sensor_error(SENSOR, np.zeros(60_000), STEP, SEED)
    assert error.std() == pytest.approx(0.02 * np.sqrt(1.5 / 2.5), rel=0.02)
    assert error.mean() == pytest.approx(0.0, abs=5e-4)


def test_pieces_of_a_drive_and_drives_have_errors_of_their_own() -> None:
    one, same, piece, drive = (
        sensor_error(SENSOR, np.zeros(4000), STEP, seed, part)
        for seed, part in ((SEED, 0), (SEED, 0), (SEED, 1), (np.random.SeedSequence(6), 0))
    )
    np.testing.assert_array_equal(one, same)
    for other in (piece, drive):
        assert abs(np.corrcoef(one, other)[0, 1]) < 4.0 / np.sqrt(2400)


def test_four_times_the_density_is_twice_the_error() -> None:
    louder = SensorModel(white=4.0 * SENSOR.white)
    np.testing.assert_allclose(
        sensor_error(louder, np.zeros(100), STEP, SEED),
        2.0 * sensor_error(SENSOR, np.zeros(100), STEP, SEED),
        rtol=1e-9,
    )


def test_no_rows_have_no_error() -> None:
    assert len(sensor_error(SENSOR, np.zeros(0), STEP, SEED)) == 0
