"""Links, moving along, distances and routes."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from tests.road.places import hand_written
from xosc_lateral.formats.opendrive import read_opendrive
from xosc_lateral.road import DRIVING, LaneLink


def named(network, link):
    return network.road_ids[link.road], link.lane, link.s, link.direction


def test_a_junction_offers_every_connection_of_the_lane():
    network = hand_written("junction")
    west = network.index_of("west")
    assert [named(network, link) for link in network.next_lanes(west, -1, 1)] == [
        ("west-south", -1, 0.0, 1),
        ("west-east", -1, 0.0, 1),
    ]
    assert network.next_lanes(west, 1, 1) == ()
    assert network.next_lanes(west, -1, -1) == ()


def test_a_connection_without_lane_links_goes_by_those_of_its_lanes():
    network = hand_written("junction")
    (link,) = network.next_lanes(network.index_of("south"), -1, 1)
    assert named(network, link) == ("south-east", -1, 0.0, 1)


def test_a_contact_point_at_the_end_turns_the_direction_round():
    network = hand_written("junction")
    (link,) = network.next_lanes(network.index_of("west-south"), -1, 1)
    assert named(network, link) == ("south", 1, 80.0, -1)


def test_moving_along_crosses_a_junction_straight_on_unless_told_otherwise():
    network = hand_written("junction")
    west, south = network.index_of("west"), network.index_of("south")
    moved = network.advance(west, -1, 90.0, 60.0)
    assert (network.road_ids[moved.road], moved.lane, moved.s, moved.remaining) == ("east", -1, 10.0, 0.0)

    def turn_right(options):
        return next(link for link in options if network.road_ids[link.road] == "west-south")

    moved = network.advance(west, -1, 90.0, 60.0, choose=turn_right)
    assert (moved.road, moved.lane, moved.direction) == (south, 1, -1)
    assert moved.s == pytest.approx(80.0 - (60.0 - 10.0 - 10.0 * pi))


def test_where_the_lane_ends_the_rest_of_the_way_is_told():
    network = hand_written("junction")
    moved = network.advance(network.index_of("east"), -1, 140.0, 25.0)
    assert (moved.s, moved.remaining) == (150.0, 15.0)
    moved = network.advance(network.index_of("west"), -1, 3.0, -10.0)
    assert (moved.s, moved.direction, moved.remaining) == (0.0, -1, 7.0)


def test_round_a_ring_one_comes_back_to_where_one_was():
    network = hand_written("ring")
    lap = 2 * 100.0 * pi
    for lane in (-1, 1):
        start = network.pose_at(0, lane, 50.0)
        moved = network.advance(0, lane, 50.0, 7 * lap)
        assert (moved.road, moved.lane) == (0, lane)
        assert moved.s == pytest.approx(50.0, abs=1e-9)
        half = network.advance(0, lane, 50.0, lap / 2)
        assert half.lane == -lane
        there = network.pose_at(half.road, half.lane, half.s)
        assert np.hypot(there.x - start.x, there.y - start.y) == pytest.approx(2 * (100.0 - 1.5 * lane))


def test_moving_there_and_back_again_ends_at_the_start():
    network = hand_written("ring")
    there = network.advance(0, -1, 50.0, 1000.0)
    back = network.advance(there.road, there.lane, there.s, -1000.0, direction=there.direction)
    assert (back.road, back.lane, back.s) == (0, -1, pytest.approx(50.0, abs=1e-9))


def test_lane_ids_follow_the_links_from_section_to_section():
    network = hand_written("sections")
    assert network.advance(0, -1, 50.0, 100.0).lane == -2  # by its link
    assert network.advance(0, -1, 150.0, 100.0).lane == -1  # the one-sided section leaves this side alone
    assert network.advance(0, 1, 350.0, 300.0)[1:3] == (1, 50.0)
    ended = network.advance(0, -2, 250.0, 100.0)
    assert (ended.lane, ended.remaining) == (-2, 50.0)
    assert ended.s == pytest.approx(300.0)
    assert network.has_lane_at(0, ended.lane, ended.s)


def test_whoever_reaches_a_section_exactly_is_in_it_both_ways():
    network = hand_written("sections")
    assert network.advance(0, -1, 50.0, 50.0)[1:3] == (-2, 100.0)
    assert network.advance(0, -2, 150.0, -50.0)[1:3] == (-2, 100.0)
    assert network.advance(0, -2, 100.0, -1.0)[1:3] == (-1, 99.0)


def test_the_distance_along_roads_is_signed_by_the_way_that_is_shorter():
    network = hand_written("ring")
    lap = 200.0 * pi
    assert network.path_distance((0, 50.0), (0, 80.0)) == pytest.approx(30.0)
    assert network.path_distance((0, 80.0), (0, 50.0)) == pytest.approx(-30.0)
    assert network.path_distance((0, 80.0), (0, 50.0), direction=-1) == pytest.approx(30.0)
    # over the seam, on the road that is drawn the other way round
    assert network.path_distance((0, 10.0), (1, 30.0)) == pytest.approx(-40.0)
    assert network.path_distance((0, 300.0), (1, 300.0)) == pytest.approx(lap - 600.0)
    # on the same road it may be shorter the other way round
    assert network.path_distance((0, 5.0), (0, 310.0)) == pytest.approx(305.0)


def test_the_distance_to_a_road_that_drives_into_the_junction_leads_over_its_connection_backwards():
    network = hand_written("junction")
    west, east, south = (network.index_of(name) for name in ("west", "east", "south"))
    assert network.path_distance((west, 90.0), (east, 10.0)) == pytest.approx(10 + 40 + 10)
    assert network.path_distance((east, 10.0), (west, 90.0)) == pytest.approx(-60.0)
    assert network.path_distance((east, 10.0), (south, 70.0)) == pytest.approx(-(10 + 10 * pi + 10))
    assert network.path_distance((west, 90.0), (east, 10.0), limit=50.0) is None


def test_roads_that_are_not_linked_have_no_distance():
    assert hand_written("leaning").path_distance((0, 0.0), (1, 0.0)) is None


def test_a_route_leads_through_the_junction_in_travel_direction():
    network = hand_written("junction")
    west, east, south = (network.index_of(name) for name in ("west", "east", "south"))
    route = network.route((west, -1, 20.0), (south, 1, 30.0))
    assert route is not None
    assert [(network.road_ids[step.road], step.direction) for step in route] == [
        ("west", 1), ("west-south", 1), ("south", -1)]  # fmt: skip
    assert (route[0].s_start, route[0].s_end, route[-1].s_start, route[-1].s_end) == (20.0, 100.0, 80.0, 30.0)
    assert network.route((east, -1, 20.0), (west, 1, 10.0)) is None
    assert network.route((west, -1, 20.0), (west, -1, 60.0)) == ((west, 1, 20.0, 60.0),)


def test_a_route_behind_the_start_leads_round_the_ring():
    network = hand_written("ring")
    route = network.route((0, -1, 50.0), (0, -1, 20.0), via=[(1, 1, 100.0)])
    assert route is not None
    assert sum(abs(step.s_end - step.s_start) for step in route) == pytest.approx(200.0 * pi - 30.0)
    assert [step.road for step in route] == [0, 1, 0]


def test_links_of_the_public_roads_join_lanes_that_touch(shared):
    for path in sorted((shared / "corpus").rglob("*.xodr")):
        network = read_opendrive(path)
        for index, road in enumerate(network.roads):
            for lane in road.sections[-1].lanes:
                if lane.type not in DRIVING:
                    continue
                here = network.pose_at(index, lane.id, road.length)
                for link in network.next_lanes(index, lane.id, 1):
                    there = network.pose_at(link.road, link.lane, link.s)
                    gap = np.hypot(there.x - here.x, there.y - here.y)
                    assert gap < 1.0, (path.name, road.id, lane.id, network.road_ids[link.road], gap)


def test_the_straightest_of_several_ways_is_taken():
    network = hand_written("junction")
    options = [LaneLink(network.index_of(name), -1, 0.0, 1) for name in ("west-south", "west-east", "south-east")]
    assert network.straightest(options) == options[1]
