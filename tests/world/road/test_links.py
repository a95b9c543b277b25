"""Links of lanes through roads and junctions."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.kit.places import VALID, hand_written
from xosc_lateral.files.opendrive.reader import parse_opendrive, read_opendrive
from xosc_lateral.world.road.lanes import DRIVING


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


@pytest.mark.parametrize("name", ["junction", "parting", "ring"])
def test_a_contact_point_that_a_file_leaves_out_is_the_nearer_end(name: str) -> None:
    text = (VALID / f"{name}.xodr").read_text("utf-8")
    bare = re.sub(r'(<(?:predecessor|successor) elementType="road"[^>]*?) contactPoint="\w+"', r"\1", text)
    assert bare != text
    whole, without = parse_opendrive(text.encode(), name), parse_opendrive(bare.encode(), name)
    for index, road in enumerate(whole.roads):
        for way, section in ((1, road.sections[-1]), (-1, road.sections[0])):
            for lane in section.lanes:
                assert without.next_lanes(index, lane.id, way) == whole.next_lanes(index, lane.id, way)
        for goal in range(len(whole.roads)):
            for way in (1, -1):
                ends = (index, 3.0), (goal, 0.5 * whole.roads[goal].length)
                assert without.path_between(*ends, direction=way) == whole.path_between(*ends, direction=way)


DIRECT = """<OpenDRIVE><header revMajor="1" revMinor="7"/>{roads}
<junction id="J" name="J" type="direct">
<connection id="0" incomingRoad="main" linkedRoad="{other}" contactPoint="{contact}">
<laneLink from="-1" to="{to}"/><laneLink from="1" to="{back}"/></connection></junction></OpenDRIVE>"""
ROAD = """<road id="{id}" name="" length="100" junction="-1"><link>{link}</link><planView>
<geometry s="0" x="{x}" y="0" hdg="{hdg}" length="100"><line/></geometry></planView><lanes><laneSection s="0">
<left><lane id="1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></left>
<center><lane id="0"/></center>
<right><lane id="-1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road>"""


@pytest.mark.parametrize("contact", ["start", "end"])
def test_a_direct_junction_is_driven_through_both_ways(contact: str) -> None:
    out, at_start = (
        ROAD.format(id="main", link='<successor elementType="junction" elementId="J"/>', x=0, hdg=0),
        contact == "start",
    )
    link = f'<{"predecessor" if at_start else "successor"} elementType="junction" elementId="J"/>'
    onto = ROAD.format(id="onto", link=link, x=100 if at_start else 200, hdg=0 if at_start else np.pi)
    to = -1 if at_start else 1
    text = DIRECT.format(roads=out + onto, other="onto", contact=contact, to=to, back=-to)
    network = parse_opendrive(text.encode(), "direct.xodr")
    entered = (0.0, 1) if at_start else (100.0, -1)
    assert network.next_lanes(0, -1, 1) == ((1, to, *entered),)
    assert network.next_lanes(1, -to, -1 if at_start else 1) == ((0, 1, 100.0, -1),)
    assert network.next_lanes(1, -to, 1 if at_start else -1) == ()
    path = network.path_between((1, 40.0), (0, 30.0), direction=-1 if at_start else 1)
    assert path is not None and path.ds == pytest.approx(70.0 + (40.0 if at_start else 60.0))
    assert path.is_turned is not at_start
