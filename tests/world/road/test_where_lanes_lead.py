"""Where a lane leads: the one rule, between sections, at joints of roads, in junctions."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from tests.kit.stage import line, map_of, road, section
from xosc_lateral.files.opendrive.reader import parse_opendrive
from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.network import RoadNetwork

Lanes = Mapping[int, tuple[str, int | None, int | None]]
"""Type, predecessor and successor by lane id."""


def lanes(described: Lanes, closing: int = 0) -> str:
    """Lanes of 3.5 m on the right; one of them narrows to nothing over 100 m."""
    written = []
    for lane, (kind, before, after) in described.items():
        link = "" if before is None else f'<predecessor id="{before}"/>'
        link += "" if after is None else f'<successor id="{after}"/>'
        slope = -0.035 if lane == closing else 0.0
        width = f'<width sOffset="0" a="3.5" b="{slope}" c="0" d="0"/>'
        written.append(f'<lane id="{lane}" type="{kind}"><link>{link}</link>{width}</lane>')
    return section("", "".join(written))


def network(before: Lanes, after: Lanes, *, joint: bool, closing: int = 0) -> RoadNetwork:
    """100 m with lanes, then 100 m with others: of one road, or of another one."""
    first, second = lanes(before, closing), lanes(after)
    if joint:
        roads = [
            road("1", line(length=100.0), 100.0, sections=first,
                 link='<successor elementType="road" elementId="2" contactPoint="start"/>'),
            road("2", line(100.0, length=100.0), 100.0, sections=second,
                 link='<predecessor elementType="road" elementId="1" contactPoint="end"/>'),
        ]  # fmt: skip
    else:
        roads = [road("1", line(length=200.0), 200.0, sections=first + second.replace('s="0.0"', 's="100.0"'))]
    return parse_opendrive(map_of(*roads).encode(), "made.xodr")


def after(made: RoadNetwork, lane: int) -> list[int]:
    return [link.lane for link in made.onward(0, 0, lane, 1)]


@pytest.fixture(params=[False, True], ids=["sections", "roads"])
def joint(request: pytest.FixtureRequest) -> bool:
    return bool(request.param)


def test_an_entry_lane_that_ends_beside_a_shoulder_leads_nowhere_and_its_cars_into_the_next_lane(joint: bool) -> None:
    """As motorway entries are written: the shoulder outside of the entry lane takes over its id."""
    before: Lanes = {-1: ("driving", None, -1), -2: ("entry", None, None), -3: ("shoulder", None, -2)}
    made = network(before, {-1: ("driving", -1, None), -2: ("shoulder", -3, None)}, joint=joint, closing=-2)
    assert after(made, -2) == []
    assert after(made, -3) == [-2]
    onto = made.beyond_end(0, 0, -2, 1, -3.5, DRIVING)
    assert onto is not None and onto.lane == -1
    shoulder = made.beyond_end(0, 0, -2, 1, -5.0, DRIVING | {"shoulder"})
    assert shoulder is not None and shoulder.lane == -2


def test_a_driven_lane_does_not_become_a_shoulder_while_another_is_driven(joint: bool) -> None:
    before: Lanes = {-1: ("driving", None, -1), -2: ("driving", None, -2)}
    assert after(network(before, {-1: ("driving", -1, None), -2: ("shoulder", -2, None)}, joint=joint), -2) == []
    neither = network(before, {-1: ("restricted", -1, None), -2: ("shoulder", -2, None)}, joint=joint)
    assert after(neither, -2) == [-2]


def test_a_shoulder_leads_wherever_its_link_says(joint: bool) -> None:
    before: Lanes = {-1: ("driving", None, -1), -2: ("shoulder", None, -2)}
    assert after(network(before, {-1: ("driving", -1, None), -2: ("exit", -2, None)}, joint=joint), -2) == [-2]


def test_a_link_of_the_lane_beyond_will_do(joint: bool) -> None:
    before: Lanes = {-1: ("driving", None, None), -2: ("driving", None, None)}
    assert after(network(before, {-1: ("driving", -2, None)}, joint=joint), -2) == [-1]


def test_without_any_link_the_lane_of_the_same_id_goes_on_within_a_road_unless_another_claims_it() -> None:
    plain: Lanes = {-1: ("driving", None, None), -2: ("driving", None, None)}
    assert after(network(plain, plain, joint=False), -2) == [-2]
    claimed: Lanes = {-1: ("driving", None, -2), -2: ("driving", None, None)}
    assert after(network(claimed, plain, joint=False), -2) == []
    assert after(network(plain, {-1: plain[-1], -2: ("shoulder", None, None)}, joint=False), -2) == []


def test_between_two_equally_near_lanes_an_ended_one_goes_on_in_that_of_its_id() -> None:
    """A lane closes, and the one outside of it takes its id: the reference player keeps the id."""
    before: Lanes = {-1: ("driving", None, -1), -2: ("driving", None, None), -3: ("driving", None, -2)}
    made = network(before, {-1: ("driving", -1, None), -2: ("driving", -3, None)}, joint=False, closing=-2)
    assert after(made, -2) == []
    onto = made.beyond_end(0, 0, -2, 1, -3.5, DRIVING)
    assert onto is not None and onto.lane == -2


def test_no_ended_lane_leads_into_those_who_come_towards_it() -> None:
    oncoming = '<left><lane id="1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></left>'
    here, beyond = (
        lanes({-1: (kind, None, None)}).replace("<left></left>", oncoming) for kind in ("driving", "border")
    )
    sections = here + beyond.replace('s="0.0"', 's="100.0"')
    made = parse_opendrive(map_of(road("1", line(length=200.0), 200.0, sections=sections)).encode(), "made.xodr")
    assert made.beyond_end(0, 0, -1, 1, -1.75, DRIVING) is None


SPLIT = """<road id="{id}" length="100" junction="{junction}"><link>{link}</link><planView><geometry s="0" x="{x}" y="0"
hdg="0" length="100"><line/></geometry></planView><lanes>{lanes}</lanes></road>"""


def test_of_two_ways_through_a_junction_a_route_takes_the_one_onto_the_lane_of_its_stop() -> None:
    def made(name: str, x: int, inside: str, described: Lanes, link: str) -> str:
        return SPLIT.format(id=name, x=x, junction=inside, lanes=lanes(described), link=link)

    into = '<predecessor elementType="road" elementId="1" contactPoint="end"/>'
    out = '<successor elementType="road" elementId="2" contactPoint="start"/>'
    one: Lanes = {-1: ("driving", None, None)}
    connections = "".join(
        f'<connection id="{k}" incomingRoad="1" connectingRoad="{k}" contactPoint="start"><laneLink from="-1" to="-1"/>'
        "</connection>"
        for k in (10, 11)
    )
    text = map_of(
        made("1", 0, "-1", one, '<successor elementType="junction" elementId="9"/>'),
        made("10", 100, "9", {-1: ("driving", -1, -1)}, into + out),
        made("11", 100, "9", {-1: ("driving", -1, -2)}, into + out),
        made(
            "2", 200, "-1", one | {-2: ("driving", None, None)}, '<predecessor elementType="junction" elementId="9"/>'
        ),
    ).replace("</OpenDRIVE>", f'<junction id="9" name="">{connections}</junction></OpenDRIVE>')
    split = parse_opendrive(text.encode(), "split.xodr")
    for lane, over in ((-1, "10"), (-2, "11")):
        route = split.route((0, -1, 10.0), (3, lane, 50.0))
        assert route is not None
        assert [split.road_ids[step.road] for step in route] == ["1", over, "2"]
        assert not any(step.missed for step in route)
    beyond = split.route((0, -1, 10.0), (3, -3, 50.0))
    assert beyond is not None and beyond[-1].missed == -3
