"""What a driver does to a vehicle at most, whatever suddenly changes or a profile's numbers come to."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest

from tests.kit.compiled import CompiledDriver
from tests.kit.profiles import REFINED
from tests.kit.stepped import stepped_offsets
from xosc_lateral.base.errors import FormatError
from xosc_lateral.drivers.model.actuator import drivable_step, fault_in_words, pay_off, stopping_speed
from xosc_lateral.drivers.model.effects import Cycle, Step
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.live.c_numbers import inputs_of
from xosc_lateral.extras.live.traffic import Traffic
from xosc_lateral.files.profiles import read_profile, write_profile

STEP = 0.05
USUAL = {"speed": 33.0, "lane_width": 3.5, "lane_index": 1.0, "is_truck": 0.0}
SEEDS = 30


def driven(profile: DriverProfile, seconds: float, at: float, **stepped: float) -> tuple[np.ndarray, Traffic]:
    """Offsets of `SEEDS` drivers, shape (n, SEEDS) [m], some of whose columns step at a time [s]."""
    usual = {name: USUAL.get(name, np.inf) for name in inputs_of(profile)}
    return stepped_offsets(
        profile, SEEDS, round(seconds / STEP), STEP, lambda time: usual | (stepped if time >= at else {})
    )


STEPPED: list[dict[str, float]] = [
    {}, {"lane_index": 0.0}, {"lane_width": 2.75}, {"is_truck": 1.0}, {"right_distance": 3.0}, {"left_distance": 3.0},
    {"right_distance": float("nan")}, {"lane_index": 2.0, "lane_width": 4.25, "left_distance": 5.0},
]  # fmt: skip


@pytest.mark.pages
@pytest.mark.parametrize("name", ["motorway", REFINED])
def test_a_column_that_steps_throws_nobody_and_is_responded_to_in_the_end(name: str) -> None:
    profile = read_profile(name)
    still = driven(profile, 25.0, 12.0)[0]
    for stepped in STEPPED:
        moved = driven(profile, 25.0, 12.0, **stepped)[0]
        assert np.abs(np.diff(moved, 2, axis=0)).max() / STEP**2 < 1.0, stepped
        np.testing.assert_array_equal(moved[:240], still[:240])
        if "right_distance" in stepped and np.isfinite(stepped["right_distance"]):
            assert np.mean(moved[-1] - still[-1]) > 0.05  # to the left, of who comes on the right


def test_what_is_slow_and_soft_passes_at_once_and_the_rest_is_paid_off_to_centimetres() -> None:
    owed, pace = pay_off(np.array([0.002]), np.zeros(1), 0.2)
    assert owed[0] == 0.0 and pace[0] == pytest.approx(0.01)
    owed, pace, way = np.array([0.8, -0.8]), np.zeros(2), []
    for _ in range(60):
        before = pace
        owed, pace = pay_off(owed, pace, 0.2)
        assert (np.abs(pace) <= 0.2 + 1e-12).all() and (np.abs(pace - before) <= 0.06 * 0.2 + 1e-12).all()
        way.append(owed)
    assert (np.array(way)[:, 0] > -0.015).all() and owed.tolist() == [0.0, 0.0]
    assert np.flatnonzero(np.abs(np.array(way)[:, 0]) < 0.015)[0] * 0.2 < 8.0


def test_one_stops_in_time_at_the_border_of_what_is_allowed() -> None:
    offsets = [np.zeros(1), np.zeros(1)]
    for _ in range(60):
        offsets.append(drivable_step(np.array([50.0]), offsets[-1], offsets[-2], np.array([5.25]), 0.2))
    path = np.ravel(offsets)
    assert 5.2 < path.max() <= 5.25
    assert np.abs(np.diff(path, 2)).max() / 0.2**2 <= 3.0 + 1e-9
    assert stopping_speed(np.zeros(1), 3.0, 0.2)[0] == 0.0


def planted(profile: DriverProfile, coefficient: float) -> DriverProfile:
    values = copy.deepcopy(profile.to_dict())
    values["effects"][1]["coefficients"] = [coefficient]
    return DriverProfile.from_dict(values)


@pytest.mark.parametrize("coefficient", [50.0, -50.0, 1e300])
def test_an_effect_that_wants_what_cannot_be_driven_is_left_out_and_named(coefficient: float, tmp_path: Path) -> None:
    profile = planted(read_profile(REFINED), coefficient)
    moved, traffic = driven(profile, 20.0, 8.0, lane_index=2.0)
    assert np.abs(moved).max() < 1.5
    assert set(traffic.faults.values()) == {"effect 2, levels of lane_index"}
    driver = CompiledDriver(profile, tmp_path)
    driver.start(1)
    values = {name: USUAL.get(name, np.inf) for name in driver.columns}
    own = [driver.step(k * STEP, values | ({"lane_index": 2.0} if k * STEP >= 8.0 else {}))[0] for k in range(401)]
    np.testing.assert_allclose(own, moved[:, 0], rtol=0.0, atol=1e-9)
    number, words = driver.fault()
    assert number == 2 and words.startswith("effect 2, levels of lane_index wanted")


def test_movement_that_cannot_be_driven_stays_near_the_lane_and_is_named() -> None:
    profile = read_profile(REFINED).with_effects(Step(size=40.0, at_s=5.0))
    moved, traffic = driven(profile, 40.0, 50.0)
    assert np.abs(moved).max() <= 1.5 * 3.5 + 1e-9
    assert np.abs(moved[700:]).max() < 0.1  # back to the lane's centre
    assert set(traffic.faults.values()) == {fault_in_words(profile, len(profile.effects) + 1)}


def test_who_would_cross_the_lane_too_fast_is_held_to_a_heading_that_can_be_driven(tmp_path: Path) -> None:
    """Weaving over 9 m within 10 s: no acceleration that a tyre lacks the grip for, but 15 degrees at 40 km/h."""
    profile = read_profile(REFINED).with_effects(Cycle(amplitude=4.5, period_s=10.0))
    moved, traffic = driven(profile, 30.0, 40.0)
    turned = np.abs(np.diff(moved[round(2.0 / STEP) :], axis=0)).max() / STEP / 11.2
    assert 0.14 < turned < 0.18 and np.abs(moved).max() <= 1.5 * 3.5
    assert set(traffic.faults.values()) == {fault_in_words(profile, len(profile.effects) + 1)}
    driver = CompiledDriver(profile, tmp_path)
    driver.start(1)
    values = {name: USUAL.get(name, np.inf) for name in driver.columns}
    own = [driver.step(k * STEP, values)[0] for k in range(len(moved))]
    np.testing.assert_allclose(own, moved[:, 0], rtol=0.0, atol=1e-9)
    assert driver.fault()[0] == len(profile.effects) + 1


def test_a_profile_is_tried_over_its_columns_where_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "p.json"
    write_profile(planted(read_profile(REFINED), 50.0), path)
    with pytest.raises(
        FormatError, match=r"effect 2 \(levels of lane_index\): an offset of 36\.\d+ m; lane widths"
    ) as e:
        read_profile(path)
    assert "\n" not in str(e.value)
