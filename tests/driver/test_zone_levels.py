"""Levels of zones beside drivers' own: planted ones come back, chance gives none."""

from __future__ import annotations

import numpy as np
import pytest

from xosc_lateral.driver.zone_levels import LEAST_DRIVES, SIGNIFICANCE, Passages, zone_levels

ZONES, DRIVERS = 40, 80


def made(
    seed: int,
    *,
    zones: float = 0.0,
    drivers: float = 0.5,
    beside: float = 0.0,
    contrast: float = 0.0,
    count: int = DRIVERS,
) -> tuple[Passages, np.ndarray]:
    """Passages of drivers of two carriageways, each through half of the zones; what was planted in each zone."""
    rng = np.random.default_rng(seed)
    planted = zones * rng.normal(size=ZONES) + contrast * (np.arange(ZONES) % 2 - 0.5)
    level, zone, drive, other = [], [], [], []
    for k in range(count):
        own, speed = drivers * rng.normal(), 25.0 + 10.0 * rng.random()
        for number in range(k % 2, ZONES, 2):
            if rng.random() < 0.7:
                level.append(own + planted[number] + beside * (speed - 30.0) + 0.8 * rng.normal())
                zone.append(f"zone {number:02}")
                drive.append(f"driver {k}")
                other.append([speed])
    return Passages(np.array(level), zone, drive, np.array(other)), planted - planted.mean()


def test_planted_levels_come_back_and_errors_are_what_they_say():
    misses = []
    for seed in range(20):
        seen, planted = made(seed, zones=0.6)
        found = zone_levels(seen)
        assert found is not None and found.names == tuple(f"zone {k:02}" for k in range(ZONES))
        misses.append((found.values - planted) / found.errors)
        assert np.corrcoef(found.values, planted)[0, 1] > 0.9
    assert 0.7 < np.std(misses) < 1.1  # a little too large, where there are several parts


def test_a_carriageway_is_told_from_its_drivers():
    # No driver passes both, so that only drivers' own scatter says whether it is they or the zones who differ.
    found = zone_levels(made(5, zones=0.3, contrast=1.5)[0])
    assert found is not None
    assert found.values[1::2].mean() - found.values[::2].mean() == pytest.approx(1.5, abs=0.35)


def test_what_goes_with_the_speed_is_no_zone():
    quiet, loud = (zone_levels(made(3, zones=0.5, beside=beside)[0]) for beside in (0.0, 0.3))
    assert quiet is not None and loud is not None
    np.testing.assert_allclose(loud.values, quiet.values, atol=1e-6)


def test_chance_gives_none():
    found = [zone_levels(made(seed)[0]) for seed in range(1000, 1200)]
    assert sum(one is not None for one in found) <= SIGNIFICANCE * 200 + 4  # a Poisson of 2: 7 and more in 0.5 %


def test_few_drives_or_one_zone_are_none():
    assert zone_levels(made(1, zones=1.0, count=LEAST_DRIVES - 1)[0]) is None
    seen = made(1, zones=1.0)[0]
    assert zone_levels(Passages(seen.level, ["all"] * len(seen.level), seen.drive, seen.beside)) is None
    assert zone_levels(Passages(np.empty(0), [], [], np.empty((0, 0)))) is None
    assert zone_levels(Passages(np.zeros(len(seen.level)), seen.zone, seen.drive, seen.beside)) is None


def test_a_recording_of_very_many_drives_takes_no_matrix_of_them():
    import tracemalloc

    rng, drivers = np.random.default_rng(8), 6000
    planted = 0.5 * rng.normal(size=ZONES)
    first = rng.integers(ZONES, size=drivers)
    number = (first[:, None] + np.arange(10)).ravel() % ZONES
    level = planted[number] + np.repeat(0.5 * rng.normal(size=drivers), 10) + rng.normal(size=len(number))
    zone, drive = [f"zone {k:02}" for k in number.tolist()], [f"d{k // 10}" for k in range(len(number))]
    tracemalloc.start()
    found = zone_levels(Passages(level, zone, drive, np.empty((len(level), 0))))
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert found is not None
    np.testing.assert_allclose(found.values, planted - planted.mean(), atol=0.12)
    assert most < 0.3 * 8 * drivers**2


def test_columns_that_a_driver_keeps_and_units_change_nothing():
    seen, _ = made(3, zones=0.5, beside=0.3)
    scaled = Passages(seen.level - 17.0, seen.zone, seen.drive, np.column_stack([1e3 * seen.beside, seen.beside]))
    one, other = zone_levels(seen), zone_levels(scaled)
    assert one is not None and other is not None
    np.testing.assert_allclose(other.values, one.values, atol=1e-9)
    np.testing.assert_allclose(other.errors, one.errors, atol=1e-9)
