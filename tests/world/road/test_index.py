"""World to lane: round trips, overlapping roads, points off every road."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from tests.kit.places import VALID, hand_written, random_places
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.world.road.index import BRUTE_FORCE
from xosc_lateral.world.road.network import RoadNetwork

# Elements of these files are far apart on purpose: jumps have no inverse.
TORN = {"clothoids", "arcs"}


@pytest.mark.parametrize("name", sorted({path.stem for path in VALID.glob("*.xodr")} - TORN - {"odd", "cubics"}))
def test_a_round_trip_ends_where_it_began_to_1e_11(name):
    network = hand_written(name)
    road, lane, s, offset = random_places(network, np.random.default_rng(7), 200)
    poses = network.lane_to_world(road, lane, s, offset)
    found = network.world_to_lane(poses.x, poses.y, poses.z, poses.heading)
    assert np.array_equal(found.road, road)
    assert np.array_equal(found.lane, lane)
    assert np.abs(found.s - s).max() < 1e-11
    assert np.abs(found.offset - offset).max() < 1e-11
    assert found.distance.max() == 0.0


def test_round_trips_hold_on_every_public_road(shared):
    rng = np.random.default_rng(8)
    for path in sorted((shared / "corpus").rglob("*.xodr")):
        network = read_opendrive(path)
        road, lane, s, offset = random_places(network, rng, 15)
        poses = network.lane_to_world(road, lane, s, offset)
        found = network.world_to_lane(poses.x, poses.y, poses.z, poses.heading)
        same = (found.road == road) & (found.lane == lane)
        # roads of a junction lie on top of each other
        assert same.mean() > (0.95 if network.junctions else 0.9999), path.name
        assert np.abs(found.s - s)[same].max() < 1e-9, path.name
        assert np.abs(found.offset - offset)[same].max() < 1e-10, path.name
        back = network.lane_to_world(found.road, found.lane, found.s, found.offset)
        assert np.hypot(back.x - poses.x, back.y - poses.y).max() < 1e-9, path.name


def test_a_path_is_followed_from_a_rough_guess_and_over_the_end_of_a_road():
    network = hand_written("ring")
    s = np.linspace(1.0, 313.0, 100)
    poses = network.lane_to_world(0, -1, s, 0.3)
    found = network.path_to_lane(poses.x, poses.y, 0, s + np.random.default_rng(9).normal(0.0, 3.0, 100))
    assert np.abs(found.s - s).max() < 1e-11
    assert found.offset == pytest.approx(np.full(100, 0.3))
    # the same points, said to be on the other road
    lost = network.path_to_lane(poses.x, poses.y, 1, 300.0)
    assert np.array_equal(lost.road, found.road)
    assert np.abs(lost.s - s).max() < 1e-11


def test_one_point_is_found_like_many_with_and_without_a_hint():
    network = hand_written("junction")
    road, lane, s, offset = random_places(network, np.random.default_rng(10), 5)
    poses = network.lane_to_world(road, lane, s, offset)
    for i in range(len(s)):
        point = float(poses.x[i]), float(poses.y[i])
        with_hint = network.world_to_lane_at(*point, near=(int(road[i]), float(s[i]) + 0.7))
        assert (with_hint.road, with_hint.lane) == (road[i], lane[i])
        assert (with_hint.s, with_hint.offset) == pytest.approx((s[i], offset[i]), abs=1e-10)
        cold, batch = network.world_to_lane_at(*point), network.world_to_lane(*point)
        assert cold == pytest.approx(tuple(field.item() for field in batch), abs=1e-12)


def test_heading_chooses_between_roads_that_cross():
    network = hand_written("junction")
    right_turn, straight_on = network.index_of("west-south"), network.index_of("west-east")
    pose = network.pose_at(right_turn, -1, 8.0, 0.4)
    assert network.world_to_lane(pose.x, pose.y, None, pose.heading).road == right_turn
    assert network.world_to_lane(pose.x, pose.y, None, 0.1).road == straight_on


@pytest.mark.parametrize("y", [-0.5, -1.5, -2.5])
def test_where_roads_lie_on_each_other_a_point_has_gone_onto_the_one_least_bent(y):
    """At the entry of a junction; whose lane's middle is nearest says nothing there."""
    network = hand_written("junction")
    west, bend, straight_on = (network.index_of(name) for name in ("west", "west-south", "west-east"))
    assert network.path_to_lane(-18.0, y, bend, 1.0).road == bend
    assert network.world_to_lane_at(-18.0, y, near=(west, 99.0)).road == straight_on
    assert network.world_to_lane_at(-18.0, y, near=(bend, 1.0)).road == bend


def test_a_car_on_the_wrong_side_of_its_road_is_in_the_lane_that_it_is_in():
    network = hand_written("straight")
    pose = network.pose_at(0, 1, 100.0)
    assert network.world_to_lane(pose.x, pose.y, None, pose.heading + pi).lane == 1


def test_height_chooses_between_roads_on_top_of_each_other(tmp_path):
    text = (VALID / "straight.xodr").read_text()
    road = text[text.index("<road") : text.index("</road>") + 7]
    bridge = road.replace('id="7"', 'id="8"').replace(
        "<planView>", '<elevationProfile><elevation s="0" a="6"/></elevationProfile><planView>'
    )
    path = tmp_path / "bridge.xodr"
    path.write_text(text.replace("</OpenDRIVE>", bridge + "</OpenDRIVE>"))
    network = read_opendrive(path)
    pose = network.pose_at(1, -2, 321.0)
    found = network.world_to_lane(pose.x, pose.y, [0.3, 5.8])
    assert [network.road_ids[i] for i in found.road] == ["7", "8"]


def test_a_point_beside_the_road_tells_how_far_off_it_is():
    network = hand_written("arcs")
    pose = network.road_pose_at(0, 100.0, -20.0)
    found = network.world_to_lane_at(pose.x, pose.y)
    assert (found.lane, found.distance, found.t) == pytest.approx((-2, 20.0 - 6.75, -20.0))
    on_shoulder = network.road_pose_at(0, 100.0, 4.5)
    assert network.world_to_lane_at(on_shoulder.x, on_shoulder.y).lane == 1
    assert network.world_to_lane_at(on_shoulder.x, on_shoulder.y, lane_types=None).lane == 2


def test_a_point_before_the_start_of_a_road_is_found_at_its_start():
    network = hand_written("sections")
    found = network.world_to_lane_at(-30.0, -5.0)
    assert (found.s, found.lane) == (0.0, -1)
    assert found.distance == pytest.approx(np.hypot(30.0, 1.5))


def test_points_far_off_are_found_alike_one_by_one_and_in_crowds():
    network = hand_written("junction")
    rng = np.random.default_rng(11)
    angle = rng.uniform(0.0, 2.0 * pi, 30_000)
    x, y = 5000.0 * np.cos(angle), 5000.0 * np.sin(angle)
    crowd = network.world_to_lane(x, y)
    assert len(x) * 60 > BRUTE_FORCE / 4  # the tree is used for at least one part
    few = network.world_to_lane(x[:50], y[:50])
    assert crowd.distance[:50] == pytest.approx(few.distance, abs=1e-6)
    assert np.all((crowd.distance > 4800.0) & (crowd.distance < 5200.0))


def test_the_inside_of_a_tight_bend_has_a_nearest_place_too():
    every = hand_written("cubics")
    network, bend = RoadNetwork((every.roads[every.index_of("bend")],)), 0
    rng = np.random.default_rng(12)
    x, y = rng.uniform(-60.0, -30.0, 400), rng.uniform(-55.0, -30.0, 400)
    found = network.world_to_lane(x, y, lane_types=None)
    s = np.linspace(0.0, network.roads[bend].length, 4001)
    line = network.road_to_world(bend, s)
    nearest = np.hypot(x[:, None] - line.x, y[:, None] - line.y).min(axis=1)
    foot = network.road_to_world(bend, found.s)
    # off the lanes the nearest lane counts, not the nearest place of the line: never nearer than that; 4 mm samples
    assert np.all(np.hypot(x - foot.x, y - foot.y) >= nearest - 2e-3)
    inside = nearest < 1.5
    assert np.hypot(x - foot.x, y - foot.y)[inside] == pytest.approx(nearest[inside], abs=2e-3)


def test_asking_for_lanes_that_no_road_has_is_refused():
    with pytest.raises(PlaybackError, match="no road has a lane of these types: tram"):
        hand_written("straight").world_to_lane(0.0, 0.0, lane_types={"tram"})
