"""Traffic of the other hand, and who moves which way beside whom: fixed seeds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from msgspec import structs

from tests.kit.motion import drive, entity, together, two_roads
from tests.kit.profiles import REFINED, simulated_profile
from xosc_lateral.base.segment import Segment
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.profiles import read_profile
from xosc_lateral.workflows.conversion.driver_context import mirrored
from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
from xosc_lateral.world.scenario.enums import VehicleCategory

ROADS = [("RHT", -1), ("RHT", 1), ("LHT", 1), ("LHT", -1)]
"""Rule, and the side of the road that one drives on."""


def deviations(
    folder: Path, rule: str, side: int, seed: int, driver: DriverProfile, *lanes: int
) -> dict[str, np.ndarray]:
    """Of a truck in lane 2 (the outer one) and a car in lane 1 beside it, on a straight; as far as they are there."""
    network = two_roads(folder, rule=rule)
    start = 100.0 if network.travel_direction(0, side) > 0 else 700.0
    who = {2: entity("truck", VehicleCategory.TRUCK, 12.0), 1: entity("car")}
    motions = [drive(network, who[lane], lane=side * lane, start=start) for lane in lanes]
    drivers = {one.name: driver for one in motions}
    found = enrich(SegmentedRun(together(*motions), network), drivers, seed=seed)
    return {one.name: one.deviation for one in found.entities}


@pytest.mark.parametrize("profile", ["motorway", REFINED])
@pytest.mark.parametrize(("rule", "side"), ROADS)
def test_left_hand_traffic_is_right_hand_traffic_in_a_mirror(
    tmp_path: Path, rule: str, side: int, profile: str
) -> None:
    home = read_profile(profile)
    here, there = (deviations(tmp_path, *road, 5, home, 2, 1) for road in (ROADS[0], (rule, side)))
    sign = -1.0 if rule == "LHT" else 1.0
    for name, deviation in here.items():
        np.testing.assert_allclose(there[name], sign * deviation, atol=1e-9)
        assert np.ptp(deviation) > 0.02


@pytest.mark.parametrize("profile", ["motorway", REFINED])
@pytest.mark.parametrize(("rule", "side"), ROADS)
def test_who_drives_beside_another_keeps_clear_in_either_lane_and_hand(
    tmp_path: Path, rule: str, side: int, profile: str
) -> None:
    home = read_profile(profile)
    away = 1.0 if rule == "RHT" else -1.0  # of the car, which the truck is to the right of in right-hand traffic
    moved = {"truck": 0.0, "car": 0.0}
    for seed in range(4):
        both = deviations(tmp_path, rule, side, seed, home, 2, 1)
        for name, lane in (("truck", 2), ("car", 1)):
            alone = deviations(tmp_path, rule, side, seed, home, lane)
            moved[name] += float(np.mean(both[name] - alone[name])) / 4
    assert 0.02 < away * moved["car"] < 0.4
    assert -0.4 < away * moved["truck"] < -0.01


def test_a_profile_of_left_hand_traffic_is_at_home_there(tmp_path: Path) -> None:
    home = simulated_profile()
    there = structs.replace(home, left_hand=True)
    assert DriverProfile.from_dict(there.to_dict()).left_hand and "left_hand" not in home.to_dict()
    right, left = (deviations(tmp_path, *road, 3, who, 1)["car"] for road, who in ((ROADS[0], home), (ROADS[2], there)))
    np.testing.assert_array_equal(right, left)


def test_a_mirror_exchanges_sides_and_twice_is_nothing() -> None:
    time = np.arange(3.0)
    context = {
        "right_distance": np.array([1.0, np.nan, np.inf]),
        "car_left": np.array([0.0, 1.0, 0.0]),
        "curvature": np.full(3, 1e-3),
        "wind_direction": np.array([90.0, 0.0, 350.0]),
        "lane_index": np.zeros(3),
        "lane_count": np.full(3, 3.0),
        "rain": time,
    }
    segment = Segment(time, np.full(3, 3.5), np.full(3, 30.0), context, before=1)
    other = mirrored(segment)
    assert other.before == 1
    assert set(other.context) == (set(context) - {"right_distance", "car_left"}) | {"left_distance", "car_right"}
    np.testing.assert_array_equal(other.context["left_distance"], context["right_distance"])
    np.testing.assert_array_equal(other.context["wind_direction"], [270.0, 0.0, 10.0])
    np.testing.assert_array_equal(other.context["lane_index"], 2.0)
    np.testing.assert_array_equal(other.context["curvature"], -1e-3)
    for name, values in mirrored(other).context.items():
        np.testing.assert_array_equal(values, context[name])
