"""Links of lanes through roads and junctions."""

from __future__ import annotations

import numpy as np

from tests.kit.places import hand_written
from xosc_lateral.files.opendrive import read_opendrive
from xosc_lateral.world.road import DRIVING


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
