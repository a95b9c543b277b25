"""A sensor that is louder in some zones than in others: found, kept, and sampled so."""

from __future__ import annotations

import numpy as np
import pytest
from msgspec.structs import replace

from tests.driver.sensor.test_slope_jumps import JUMP, RATE, WHITE, seen, track
from xosc_lateral.driver.records import read_as
from xosc_lateral.driver.sensor.by_zone import ByZone, ZonedRows, levels_by_zone
from xosc_lateral.driver.sensor.model import SensorModel
from xosc_lateral.driver.sensor.separation import separate
from xosc_lateral.driver.sensor.slope_jumps import SlopeJumps
from xosc_lateral.driver.sensor.slope_jumps_fit import find_slope_jumps
from xosc_lateral.drives.resampling import STEP
from xosc_lateral.drives.zones import zone_codes
from xosc_lateral.errors import DriverProfileError

LONG = 10.0
"""Of a zone. [s]"""


def zones_of(n: int, step: float) -> np.ndarray:
    return np.array([f"zone {k}" for k in (np.arange(n) * step // LONG).astype(int).tolist()])


def test_levels_are_one_in_the_mean_and_those_planted():
    rng = np.random.default_rng(0)
    planted = 0.7 * rng.normal(size=12)
    levels = [planted.repeat(4) + 0.5 * rng.normal(size=48) for _ in range(50)]
    names = [np.array([f"z{k:02}" for k in range(12)]).repeat(4)] * 50
    found = levels_by_zone(levels, names, [f"d{k}" for k in range(50)])
    assert found is not None
    assert np.mean(np.exp(found.levels)) == pytest.approx(1.0)
    np.testing.assert_allclose(found.levels, planted - np.log(np.mean(np.exp(planted))), atol=0.15)


def test_levels_of_unknown_zones_are_none():
    assert levels_by_zone([np.zeros(5)], [np.full(5, "")], ["d"]) is None
    assert levels_by_zone([], [], []) is None


def test_slope_jumps_are_larger_in_some_zones_and_hardly_vary_besides():
    rng = np.random.default_rng(3)
    size = np.exp(np.array([-0.6, 0.6, -0.6, 0.6, -0.6, 0.6]))
    rows = [_jumping(rng, size) for _ in range(60)]
    _, _, runs = seen(rows)
    zoned = ZonedRows(
        [zones_of(len(one), 1.0 / RATE) for one in rows], [zones_of(len(run), STEP) for run in runs], _names(60)
    )
    slope_jumps, _ = find_slope_jumps(rows, RATE, runs, zoned)
    by_zone = slope_jumps.by_zone
    assert by_zone is not None and len(by_zone.zones) == 6
    assert np.diff(by_zone.levels)[::2] == pytest.approx([2.4] * 3, abs=0.6)
    assert slope_jumps.level_variance > 1.0
    assert by_zone.level_variance + by_zone.track_variance < 0.3
    without, _ = find_slope_jumps(rows, RATE, runs)
    assert replace(slope_jumps, by_zone=None) == without


def test_slope_jumps_are_sampled_as_large_as_the_zone_is():
    by_zone = ByZone(("loud", "quiet"), (1.0, -1.0), 0.0, 1.0)
    slope_jumps = SlopeJumps(1.0, (WHITE,) * 5, (0.0,) * 5, 0.5, 5.0, by_zone=by_zone)
    rng, n = np.random.default_rng(1), 4000
    codes = zone_codes(["loud"] * n + ["quiet"] * n + ["elsewhere"] * n)
    made = [_fast(slope_jumps.sample(np.zeros(3 * n), STEP, rng, codes)) for _ in range(20)]
    loud, quiet, elsewhere = (
        np.mean([(one[part] ** 2).mean() for one in made])
        for part in (slice(50, n - 50), slice(n + 50, 2 * n - 50), slice(2 * n + 50, None))
    )
    assert np.log(loud / quiet) == pytest.approx(2.0, abs=0.1)
    assert np.log(loud / elsewhere) == pytest.approx(1.0, abs=0.1)


def test_noise_is_found_and_sampled_louder_in_some_zones():
    rng = np.random.default_rng(5)
    levels = np.array([0.5, 2.0, 0.5, 2.0, 0.5, 2.0])
    runs = []
    for _ in range(40):
        wandering = np.convolve(rng.normal(size=400), np.hanning(101) / 51.0, "valid")[:300]
        place = (np.arange(300) * STEP // LONG).astype(int)
        runs.append(wandering + 0.01 * levels[place] * rng.normal(size=300))
    zones = [zones_of(300, STEP) for _ in runs]
    sensor = separate(runs, STEP, zoned=ZonedRows(zones, zones, _names(40))).sensor
    assert sensor.by_zone is not None
    assert np.diff(sensor.by_zone.levels)[::2] == pytest.approx([2.0 * np.log(4.0)] * 3, abs=0.5)
    assert sensor.by_zone.level_variance < 0.3 * sensor.level_variance
    codes = zone_codes(np.array(["zone 0", "zone 1"]).repeat(5000))
    made = sensor.error_on(np.zeros(10_000), STEP, np.random.default_rng(0), codes)
    assert np.log(made[5100:].var() / made[:4900].var()) == pytest.approx(2.0 * np.log(4.0), abs=0.6)
    both = [sensor.error_on(np.zeros(500), STEP, np.random.default_rng(0), zone) for zone in (None, codes[:500])]
    bare = replace(sensor, by_zone=None).error_on(np.zeros(500), STEP, np.random.default_rng(0), codes[:500])
    np.testing.assert_array_equal(both[0], bare)
    assert not np.array_equal(both[1], bare)


def test_zones_are_kept_in_files_and_checked():
    by_zone = ByZone(("a", "b"), (0.5, -0.5), 0.1, 4.0)
    sensor = SensorModel(1e-5, by_zone=by_zone)
    assert read_as(SensorModel, sensor.to_dict()) == sensor
    assert "by_zone" not in SensorModel(1e-5).to_dict()
    assert sensor.in_words().endswith("in 2 zones the error is 0.8 to 1.3 times as large as on the whole (90 %)")
    slope_jumps = SlopeJumps(1.0, (WHITE,) * 5, (0.0,) * 5, 0.5, 5.0)
    held = SensorModel(1e-5, slope_jumps=replace(slope_jumps, by_zone=by_zone))
    assert read_as(SensorModel, held.to_dict()) == held
    assert "by_zone" not in SensorModel(1e-5, slope_jumps=slope_jumps).to_dict()["kinks"]
    for wrong in (
        {"levels": (0.5,)},
        {"zones": (), "levels": ()},
        {"level_variance": -1.0},
        {"level_duration": 0.0},
        {"levels": (0.5, np.nan)},
    ):
        with pytest.raises(DriverProfileError, match="sensor by zone"):
            replace(by_zone, **wrong)


def _names(count: int) -> list[str]:
    return [f"d{k}" for k in range(count)]


def _jumping(rng: np.random.Generator, size: np.ndarray) -> np.ndarray:
    """A track whose slope jumps are as large as the zone has it, shape (1200,). [m]"""
    smooth, jumping = track(rng, 0.0), track(rng, JUMP) - track(rng, 0.0)
    steps = np.diff(jumping, 2)
    factor = size[(np.arange(len(steps)) / RATE // LONG).astype(int)]
    bent = np.concatenate([np.zeros(2), np.cumsum(np.cumsum(steps * factor))])
    return smooth + bent


def _fast(path: np.ndarray) -> np.ndarray:
    return np.diff(path, 3)
