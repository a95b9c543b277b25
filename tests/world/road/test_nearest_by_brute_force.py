"""The lane that a point is in, or is nearest to, against thousands of places laid over all lanes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.kit.places import hand_written
from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.network import RoadNetwork

SPACING = 0.5
"""Of the places, along and across. [m]"""

ASLANT = 1.01
"""Distances count across the road: a little more than the shortest where an edge runs aslant or the road leans. [-]"""

NAMES = ("junction", "ring", "leaning", "straight")
"""Not where lanes begin and end beside each other: lanes are looked for across the road, at the foot of the point."""


def places(network: RoadNetwork) -> tuple[np.ndarray, np.ndarray]:
    """x and y of places on all driving lanes, edges included, no further than `SPACING` apart."""
    x, y = [], []
    for index, road in enumerate(network.roads):
        for section in road.sections:
            s = np.linspace(section.start, section.end - 1e-9, 2 + round((section.end - section.start) / SPACING))
            for lane in (one for one in section.lanes if one.type in DRIVING):
                width = network.lane_width(index, lane.id, s)
                for share in np.linspace(-0.5, 0.5, 11):
                    found = network.lane_to_world(index, lane.id, s, share * width)
                    x.append(found.x)
                    y.append(found.y)
    return np.concatenate(x), np.concatenate(y)


@pytest.mark.parametrize("name", NAMES)
def test_no_lane_is_nearer_than_the_one_that_is_found(name: str) -> None:
    network, rng = hand_written(name), np.random.default_rng(3)
    x, y = places(network)
    at = rng.integers(len(x), size=150)
    px, py = x[at] + rng.normal(0.0, 6.0, 150), y[at] + rng.normal(0.0, 6.0, 150)
    found = network.world_to_lane(px, py)
    nearest = np.min(np.hypot(px[:, None] - x, py[:, None] - y), axis=1)
    assert np.all(found.distance <= ASLANT * nearest + 1e-9)
    assert np.all(found.distance >= nearest - SPACING)
    assert (found.distance == 0.0).any() and (found.distance > 1.0).any()


@pytest.mark.parametrize("name", NAMES)
def test_what_is_found_leads_back_to_the_point(name: str) -> None:
    network, rng = hand_written(name), np.random.default_rng(4)
    x, y = places(network)
    at = rng.integers(len(x), size=150)
    px, py = x[at] + rng.normal(0.0, 0.2, 150), y[at] + rng.normal(0.0, 0.2, 150)
    found = network.world_to_lane(px, py)
    inside = found.distance == 0.0
    back = network.lane_to_world(*(values[inside] for values in found[:4]))
    np.testing.assert_allclose(np.hypot(back.x - px[inside], back.y - py[inside]), 0.0, atol=1e-8)
    width = network.lane_width(found.road[inside], found.lane[inside], found.s[inside])
    assert np.all(np.abs(found.offset[inside]) <= 0.5 * width + 1e-9)
    assert inside.mean() > 0.8


@pytest.mark.parametrize("shift", [0.1, 0.2, -0.1, -0.2])
def test_a_car_that_is_decimetres_off_the_middle_is_found_there_on_the_same_lane(shift: float) -> None:
    for road in hand_written("junction").roads:
        network = RoadNetwork((road,))
        for lane in (one.id for one in road.sections[0].lanes if one.type in DRIVING):
            s = np.linspace(0.2, 0.8, 5) * road.sections[0].end
            pose = network.lane_to_world(0, lane, s, shift)
            found = network.world_to_lane(pose.x, pose.y, heading=pose.heading)
            assert found.lane.tolist() == [lane] * 5
            np.testing.assert_allclose(found.offset, shift, atol=1e-9)
            np.testing.assert_allclose(found.s, s, atol=1e-8)
