"""Distances and routes over the road network."""

from __future__ import annotations

from math import pi

import pytest

from tests.kit.places import hand_written


def test_the_distance_along_roads_is_signed_by_the_way_that_is_shorter():
    network = hand_written("ring")
    lap = 200.0 * pi
    assert network.path_between((0, 50.0), (0, 80.0)).ds == pytest.approx(30.0)
    assert network.path_between((0, 80.0), (0, 50.0)).ds == pytest.approx(-30.0)
    assert network.path_between((0, 80.0), (0, 50.0), direction=-1).ds == pytest.approx(30.0)
    # over the seam, on the road that is drawn the other way round
    assert network.path_between((0, 10.0), (1, 30.0)).ds == pytest.approx(-40.0)
    assert network.path_between((0, 300.0), (1, 300.0)).ds == pytest.approx(lap - 600.0)
    # on the same road it may be shorter the other way round
    assert network.path_between((0, 5.0), (0, 310.0)).ds == pytest.approx(305.0)


def test_the_distance_to_a_road_that_drives_into_the_junction_leads_over_its_connection_backwards():
    network = hand_written("junction")
    west, east, south = (network.index_of(name) for name in ("west", "east", "south"))
    assert network.path_between((west, 90.0), (east, 10.0)).ds == pytest.approx(10 + 40 + 10)
    assert network.path_between((east, 10.0), (west, 90.0)).ds == pytest.approx(-60.0)
    assert network.path_between((east, 10.0), (south, 70.0)).ds == pytest.approx(-(10 + 10 * pi + 10))
    assert network.path_between((west, 90.0), (east, 10.0), limit=50.0) is None


def test_roads_that_are_not_linked_have_no_distance():
    assert hand_written("leaning").path_between((0, 0.0), (1, 0.0)) is None


def test_a_route_leads_through_the_junction_in_travel_direction():
    network = hand_written("junction")
    west, east, south = (network.index_of(name) for name in ("west", "east", "south"))
    route = network.route((west, -1, 20.0), (south, 1, 30.0))
    assert route is not None
    assert [(network.road_ids[step.road], step.direction) for step in route] == [
        ("west", 1), ("west-south", 1), ("south", -1)]  # fmt: skip
    assert (route[0].s_start, route[0].s_end, route[-1].s_start, route[-1].s_end) == (20.0, 100.0, 80.0, 30.0)
    assert network.route((east, -1, 20.0), (west, 1, 10.0)) is None
    (stay,) = network.route((west, -1, 20.0), (west, -1, 60.0)) or ()
    assert stay[:4] == (west, 1, 20.0, 60.0)


def test_a_route_behind_the_start_leads_round_the_ring():
    network = hand_written("ring")
    route = network.route((0, -1, 50.0), (0, -1, 20.0), via=[(1, 1, 100.0)])
    assert route is not None
    assert sum(abs(step.s_end - step.s_start) for step in route) == pytest.approx(200.0 * pi - 30.0)
    assert [step.road for step in route] == [0, 1, 0]


def test_a_route_takes_the_way_that_its_lane_leads_along_without_a_lane_change():
    """Two lanes part at the end of a road; the shorter way round leads off the other lane."""
    network = hand_written("parting")
    start, end = network.index_of("start"), network.index_of("end")
    on_the_left = network.route((start, -1, 10.0), (end, -1, 20.0))
    on_the_right = network.route((start, -2, 10.0), (end, -1, 20.0))
    assert on_the_left is not None and on_the_right is not None
    assert [network.road_ids[step.road] for step in on_the_left] == ["start", "long", "end"]
    assert [network.road_ids[step.road] for step in on_the_right] == ["start", "short", "end"]
