"""What lanes are like: index, curvature, limits, markings."""

from __future__ import annotations

from itertools import pairwise
from math import inf

import numpy as np
import pytest

from tests.kit.places import hand_written, random_places


def test_lanes_are_counted_from_the_right_in_travel_direction():
    network = hand_written("straight")
    index, count = network.lane_index(0, [-2, -1, 1], 10.0)
    assert index.tolist() == [0, 1, 0]
    assert count.tolist() == [2, 2, 1]


def test_in_left_hand_traffic_the_rightmost_lane_is_the_one_at_the_middle_of_the_road():
    index, count = hand_written("left_hand").lane_index(0, [-2, -1, 1], 10.0)
    assert index.tolist() == [1, 0, 0]
    assert count.tolist() == [2, 2, 1]


def test_a_lane_counts_once_it_has_a_width_and_shoulders_never_do():
    network = hand_written("sections")
    index, count = network.lane_index(0, -2, [100.5, 150.0])
    assert (index.tolist(), count.tolist()) == ([0, 0], [1, 2])
    arcs = hand_written("arcs")
    index, count = arcs.lane_index(0, [2, 1], 5.0)
    assert (index.tolist(), count.tolist()) == ([-1, 0], [1, 1])


def test_the_curvature_of_a_lane_is_that_of_its_own_circle_seen_in_travel_direction():
    network = hand_written("arcs")
    assert network.curvature(0, [10.0, 400.0]) == pytest.approx([0.005, -0.005])
    assert network.lane_curvature(0, -1, 10.0) == pytest.approx(1.0 / (200.0 + 1.75))
    assert network.lane_curvature(0, -1, 10.0, 0.5) == pytest.approx(1.0 / (200.0 + 1.25))
    assert network.lane_curvature(0, 1, 10.0) == pytest.approx(-1.0 / (200.0 - 1.75))


def test_the_curvature_of_an_opening_lane_is_that_of_the_path_down_its_middle():
    network = hand_written("edges")
    s = np.linspace(60.0, 141.0, 9)  # the kink of the lane offset at 100 m left out
    h = 1e-3
    poses = [network.lane_to_world(0, -2, s + k * h) for k in (-1, 0, 1)]
    heading = [np.arctan2(b.y - a.y, b.x - a.x) for a, b in pairwise(poses)]
    step = np.hypot(poses[2].x - poses[0].x, poses[2].y - poses[0].y) / 2.0
    assert network.lane_curvature(0, -2, s) == pytest.approx((heading[1] - heading[0]) / step, abs=1e-7)


def test_the_speed_limit_of_the_lane_goes_before_that_of_the_road():
    network = hand_written("straight")
    assert network.speed_limit(0, -1, [0.0, 599.0, 600.0]) == pytest.approx([130 / 3.6, 130 / 3.6, inf])
    assert network.speed_limit(0, -2, [100.0, 200.0]) == pytest.approx([inf, 60 * 0.44704])


def test_markings_are_named_with_their_lane():
    network = hand_written("straight")
    middle, edge = network.road_marks(0)
    assert (middle.lane, middle.type, middle.color, middle.s_end) == (0, "broken", "white", 1000.0)
    assert (edge.lane, edge.type, edge.width) == (-2, "solid", 0.2)


def test_the_cross_section_is_listed_from_left_to_right():
    network = hand_written("arcs")
    assert [(lane.id, lane.type, lane.direction) for lane in network.lanes_at(0, 0.0)] == [
        (2, "shoulder", -1), (1, "driving", -1), (-1, "driving", 1), (-2, "driving", 1)]  # fmt: skip
    centres = [lane.centre_t for lane in network.lanes_at(0, 0.0)]
    assert centres == sorted(centres, reverse=True)


def test_the_lane_at_t_is_the_one_that_holds_it_and_else_the_nearest_one_that_is_driven_on():
    network = hand_written("arcs")
    assert network.lane_at(0, 5.0, -4.0).lane == -2
    assert network.lane_at(0, 5.0, -4.0).offset == pytest.approx(-4.0 + 3.5 + 1.625)
    on_shoulder = network.lane_at(0, 5.0, 4.0)
    assert (on_shoulder.lane, on_shoulder.offset, on_shoulder.distance) == pytest.approx((1, -2.25, 0.5))
    assert network.lane_at(0, 5.0, 4.0, lane_types=None).lane == 2
    assert network.lane_at(0, 5.0, 4.0, lane_types={"tram"}).lane == 0


def test_a_lane_of_no_width_is_never_the_one_that_is_found():
    network = hand_written("edges")
    # at s = 25 m lane -2 has no width: it touches lane -1 at t = -3.5
    assert network.lane_at(0, 25.0, -3.5).lane == -1
    assert network.lane_at(0, 25.0, -3.6).lane == -1


def test_places_on_random_lanes_are_told_apart_by_lane_at():
    network = hand_written("arcs")
    road, lane, s, offset = random_places(network, np.random.default_rng(5), 40, driving=False)
    t = network.offset_to_t(road, lane, s, offset)
    for i in range(len(s)):
        found = network.lane_at(int(road[i]), float(s[i]), float(t[i]), lane_types=None)
        assert (found.lane, found.offset) == (lane[i], pytest.approx(offset[i], abs=1e-12))
