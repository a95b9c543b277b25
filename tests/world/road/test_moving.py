"""Moving along lanes."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from tests.kit.places import hand_written
from xosc_lateral.world.road.positions import LaneLink


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


def test_the_straightest_of_several_ways_is_taken():
    network = hand_written("junction")
    options = [LaneLink(network.index_of(name), -1, 0.0, 1) for name in ("west-south", "west-east", "south-east")]
    assert network.straightest(options) == options[1]
    assert network.most_turning(options) != options[1]
