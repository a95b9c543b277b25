"""The default driver: lanes over sections, roads and junctions, in both directions, to the end of the road."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from tests.kit.stage import (
    WIDTH,
    Stage,
    after,
    arc,
    car,
    entity,
    event,
    facing,
    follow,
    in_world,
    lane_change,
    lanes,
    line,
    maneuvers,
    map_of,
    on_lane,
    polyline,
    private_action,
    road,
    row,
    section,
    speed,
    teleport,
    to_lane,
)
from xosc_lateral.world.motion.nominal import Activity

SUCCESSOR = '<successor elementType="road" elementId="{}" contactPoint="{}"/>'
PREDECESSOR = '<predecessor elementType="road" elementId="{}" contactPoint="{}"/>'

CURVE = map_of(
    road("1", line(length=200.0), 200.0, link=SUCCESSOR.format("2", "start")),
    road("2", arc(0.005, x=200.0, length=300.0), 300.0, link=PREDECESSOR.format("1", "end")),
)
"""200 m straight, then 300 m to the left with a radius of 200 m."""

TURNED = section(lanes(2, 1, links={k: (k, -k) for k in (1, 2)}), lanes(-1, -2, links={k: (k, -k) for k in (-1, -2)}))

MIRRORED = map_of(
    road("1", line(length=200.0), 200.0, link=SUCCESSOR.format("2", "end"), sections=TURNED),
    road("2", line(500.0, 0.0, pi, 300.0), 300.0, link=SUCCESSOR.format("1", "end"), sections=TURNED),
)
"""Two straight roads whose ends meet: s runs back on the second, and lane ids change their sign."""


WALKER = (
    '<ScenarioObject name="Ego"><Pedestrian name="walker" model="walker" mass="80" pedestrianCategory="pedestrian">'
    '<BoundingBox><Center x="0" y="0" z="0.9"/><Dimensions width="0.5" length="0.5" height="1.8"/></BoundingBox>'
    "<Properties/></Pedestrian></ScenarioObject>"
)


def ego(lane: int, s: float, v: float = 20.0, road: str = "1") -> dict[str, str]:
    return {"Ego": teleport(on_lane(lane, s, road=road)) + speed(v)}


@pytest.mark.parametrize(("lane", "s", "sign"), [(-2, 10.0, 1.0), (1, 900.0, -1.0)])
def test_lanes_are_driven_in_their_direction(tmp_path: Path, lane: int, s: float, sign: float) -> None:
    motion = entity(Stage(tmp_path).play(start=ego(lane, s)))
    np.testing.assert_allclose(motion.x, s + sign * 20.0 * motion.time, atol=1e-9)
    np.testing.assert_allclose(motion.heading_relative, 0.0, atol=1e-12)
    assert (motion.activity[1:] == Activity.ACTIVE).all()


def test_on_a_curve_the_way_along_the_reference_line_depends_on_t(tmp_path: Path) -> None:
    """ds = v dt / (1 - kappa t) with the curvature where the frame starts."""
    motion = entity(Stage(tmp_path, CURVE).play(start=ego(-2, 20.0, road="2")))
    np.testing.assert_allclose(np.diff(motion.s), 0.4 / (1.0 + 0.005 * 1.5 * WIDTH), rtol=1e-12)
    assert set(motion.lane) == {-2}
    angle = 0.005 * motion.s
    radius = 200.0 + 1.5 * WIDTH
    np.testing.assert_allclose(motion.x, 200.0 + radius * np.sin(angle), atol=1e-9)
    np.testing.assert_allclose(motion.y, 200.0 - radius * np.cos(angle), atol=1e-9)


@pytest.mark.parametrize("lane", [-1, 2])
def test_over_a_road_border_both_ways(tmp_path: Path, lane: int) -> None:
    start = ego(lane, 150.0) if lane < 0 else ego(lane, 50.0, road="2")
    played = Stage(tmp_path, CURVE).play(start=start, last=8.0)
    motion = entity(played)
    roads = [played.network.road_ids[k] for k in motion.road]
    assert roads[0] != roads[-1]
    assert set(motion.lane.tolist()) == {lane}
    jumps = np.hypot(np.diff(motion.x), np.diff(motion.y))
    np.testing.assert_allclose(jumps, 0.4, rtol=1e-2)


def test_where_the_next_road_runs_the_other_way_the_lane_changes_its_sign(tmp_path: Path) -> None:
    played = Stage(tmp_path, MIRRORED).play(start=ego(-2, 150.0), last=9.0)
    motion = entity(played)
    np.testing.assert_allclose(motion.x, 150.0 + 20.0 * motion.time, atol=1e-9)
    np.testing.assert_allclose(motion.y, -1.5 * WIDTH, atol=1e-9)
    assert (motion.lane[0], motion.lane[-1]) == (-2, 2)
    np.testing.assert_allclose(np.cos(motion.heading), 1.0)
    assert (np.abs(motion.offset) < 1e-9).all()


@pytest.mark.parametrize("contact", ["start", "end"])
@pytest.mark.parametrize("lane", [-2, 2])
def test_without_links_the_nearest_lane_of_the_next_road_is_taken(tmp_path: Path, contact: str, lane: int) -> None:
    none = dict.fromkeys((2, 1, -1, -2), (None, None))
    bare, way = section(lanes(2, 1, links=none), lanes(-1, -2, links=none)), 1.0 if lane < 0 else -1.0
    border, entry = 200.0 if lane < 0 else 0.0, 1 if contact == "start" else -1
    second = line(border if entry > 0 else border + 200.0 * way, heading=0.0 if way == entry else pi, length=200.0)
    link = (SUCCESSOR if lane < 0 else PREDECESSOR).format("2", contact)
    roads = map_of(
        road("1", line(length=200.0), 200.0, link=link, sections=bare), road("2", second, 200.0, sections=bare)
    )
    start = {"Ego": teleport(on_lane(lane, 100.0, offset=0.4 * way)) + speed(20.0)}
    motion = entity(Stage(tmp_path, roads).play(start=start, last=9.0))
    np.testing.assert_allclose(motion.x, 100.0 + way * 20.0 * motion.time, atol=1e-6)
    assert motion.lane[-1] == -2 * entry
    np.testing.assert_allclose(np.abs(motion.y[motion.time > 5.1]), 1.5 * WIDTH, atol=1e-9)


def test_a_lane_change_over_such_a_border_goes_on(tmp_path: Path) -> None:
    played = Stage(tmp_path, MIRRORED).play(maneuvers(event(lane_change(to_lane(-1)))), start=ego(-2, 150.0))
    motion = entity(played)
    u = np.clip(motion.time / 4.0, 0.0, 1.0)
    np.testing.assert_allclose(motion.y, -1.5 * WIDTH + WIDTH * 0.5 * (1.0 - np.cos(pi * u)), atol=1e-9)


SIDEWALK = (
    '<lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/><width sOffset="40" a="3.5" b="0.05" '
    'c="0" d="0"/><width sOffset="80" a="5.5" b="0" c="0" d="0"/></lane>'
    '<lane id="-2" type="{kind}"><width sOffset="0" a="2" b="0" c="0" d="0"/></lane>'
)
"""Beside a lane that widens from 3.5 to 5.5 m."""


@pytest.mark.parametrize("kind", ["sidewalk", "walking"])
@pytest.mark.parametrize(("who", "y"), [(WALKER, -6.5), (car("Ego"), -5.5)], ids=["pedestrian", "car"])
def test_after_a_trajectory_a_pedestrian_keeps_to_the_sidewalk(tmp_path: Path, kind: str, who: str, y: float) -> None:
    """The middle of the sidewalk lies 1 m beyond the driving lane; a car keeps its distance to that lane's middle."""
    roads = map_of(road("1", line(length=120.0), 120.0, sections=section("", SIDEWALK.format(kind=kind))))
    way = polyline(*((None, on_lane(-2, s)) for s in (5.0, 25.0)))
    start = {"Ego": teleport(on_lane(-2, 5.0)) + speed(2.0)}
    played = Stage(tmp_path, roads).play(maneuvers(event(follow(way))), start=start, last=50.0, entities=(who,))
    motion = entity(played)
    assert motion.y[-1] == pytest.approx(y, abs=1e-6)
    assert {int(lane) for lane in motion.lane} == {-2 if who is WALKER else -1}


def test_of_two_lanes_that_lead_into_one_the_nearer_is_taken_on_the_way_back(tmp_path: Path) -> None:
    """Road 2 names no link; both lanes of road 1 name its only lane. The way back goes on straight."""
    merging = section(lanes(2, 1, links=dict.fromkeys((1, 2), (None, 1))), lanes(-1))
    merged = section(lanes(1, links={1: (None, None)}), lanes(-1))
    roads = map_of(
        road("1", line(length=200.0), 200.0, link=SUCCESSOR.format("2", "start"), sections=merging),
        road("2", line(200.0, length=200.0), 200.0, link=PREDECESSOR.format("1", "end"), sections=merged),
    )
    motion = entity(Stage(tmp_path, roads).play(start=ego(1, 50.0, road="2"), last=9.0))
    np.testing.assert_allclose(motion.y, 0.5 * WIDTH, atol=1e-9)


def test_the_end_of_the_road_stops_and_is_flagged(tmp_path: Path) -> None:
    motion = entity(Stage(tmp_path).play(start=ego(-1, 950.0)))
    there = motion.time > 2.6
    np.testing.assert_allclose(motion.x[there], 1000.0)
    np.testing.assert_allclose(motion.speed[there], 0.0)
    assert (motion.activity[there] & Activity.ROAD_END > 0).all()
    assert not (motion.activity[motion.time < 2.4] & Activity.ROAD_END).any()


def test_an_entity_beside_the_road_moves_parallel_to_it_and_is_flagged(tmp_path: Path) -> None:
    """The default driver never drives along its heading: also an entity that is turned stays parallel to the lane."""
    start = {"Ego": teleport(on_lane(-2, 10.0, offset=-10.0, orientation=facing(0.3))) + speed(10.0)}
    motion = entity(Stage(tmp_path).play(start=start))
    np.testing.assert_allclose(motion.y, -1.5 * WIDTH - 10.0, atol=1e-9)
    np.testing.assert_allclose(motion.heading, 0.3, atol=1e-9)
    np.testing.assert_allclose(motion.x, 10.0 + 10.0 * motion.time, atol=1e-9)
    assert (motion.activity & Activity.OFF_ROAD > 0).all()


def test_an_entity_put_down_in_the_world_follows_the_nearest_lane(tmp_path: Path) -> None:
    start = {"Ego": teleport(in_world(100.0, 0.5 * WIDTH + 0.3, pi)) + speed(10.0)}
    motion = entity(Stage(tmp_path).play(start=start))
    np.testing.assert_allclose(motion.y, 0.5 * WIDTH + 0.3, atol=1e-6)
    assert motion.x[-1] == pytest.approx(0.0, abs=1e-3)
    assert set(motion.lane.tolist()) == {1}
    np.testing.assert_allclose(motion.offset, -0.3, atol=1e-6)


def test_without_a_road_an_entity_stands(tmp_path: Path) -> None:
    start = {"Ego": teleport(in_world(5.0, 6.0, 1.0)) + speed(10.0)}
    motion = entity(Stage(tmp_path, None).play(start=start, last=1.0))
    np.testing.assert_allclose(motion.x, 5.0)
    assert (motion.road == -1).all()


# ---- junctions -------------------------------------------------------------------------------------------------------
def crossing(arms: str = section("", lanes(-1))) -> str:
    """Road 1 leads into a junction from which 2 goes on straight, 3 turns left and 4 turns right (20 m arms)."""

    def connecting(name: str, plan: str, length: float, to: str) -> str:
        link = PREDECESSOR.format("1", "end") + SUCCESSOR.format(to, "start")
        return road(name, plan, length, link=link, junction="100", sections=arms)

    quarter = 10.0 * pi / 2.0
    one_lane = section(lanes(1), lanes(-1))
    leave = '<predecessor elementType="junction" elementId="100"/>'
    roads = [
        road("1", line(length=100.0), 100.0, sections=one_lane,
             link='<successor elementType="junction" elementId="100"/>'),
        road("2", line(x=120.0, length=100.0), 100.0, link=leave, sections=one_lane),
        road("3", line(x=110.0, y=10.0, heading=pi / 2, length=100.0), 100.0, link=leave, sections=one_lane),
        road("4", line(x=110.0, y=-10.0, heading=-pi / 2, length=100.0), 100.0, link=leave, sections=one_lane),
        connecting("12", line(x=100.0, length=20.0), 20.0, "2"),
        connecting("13", arc(0.1, x=100.0, length=quarter), quarter, "3"),
        connecting("14", arc(-0.1, x=100.0, length=quarter), quarter, "4"),
    ]  # fmt: skip
    connections = "".join(
        f'<connection id="{k}" incomingRoad="1" connectingRoad="{name}" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection>'
        for k, name in enumerate(("13", "12", "14"))
    )
    return map_of(*roads, f'<junction id="100" name="j">{connections}</junction>')


def assign_route(*waypoints: str, strategy: str = "shortest") -> str:
    inside = "".join(
        f'<Waypoint routeStrategy="{strategy}"><Position>{position}</Position></Waypoint>' for position in waypoints
    )
    route = f'<Route name="route" closed="false">{inside}</Route>'
    return private_action(f"<RoutingAction><AssignRouteAction>{route}</AssignRouteAction></RoutingAction>")


def acquire(position: str) -> str:
    inside = f"<Position>{position}</Position>"
    return private_action(f"<RoutingAction><AcquirePositionAction>{inside}</AcquirePositionAction></RoutingAction>")


def test_without_a_route_a_junction_is_crossed_straight(tmp_path: Path) -> None:
    played = Stage(tmp_path, crossing()).play(start=ego(-1, 50.0), last=5.0)
    assert played.network.road_ids[entity(played).road[-1]] == "2"


def test_who_drives_against_the_lane_takes_the_way_that_turns_most(tmp_path: Path) -> None:
    """As the reference player does, which takes straight on as seen by who drives along the lane."""
    against = {"Ego": teleport(on_lane(1, 50.0, orientation=facing(pi))) + speed(20.0)}
    played = Stage(tmp_path, crossing(section(lanes(1), lanes(-1)))).play(start=against, last=5.0)
    assert played.network.road_ids[entity(played).road[-1]] == "3"


@pytest.mark.parametrize("exit_road", ["2", "3", "4"])
@pytest.mark.parametrize("by", ["route", "position"])
def test_a_route_decides_at_a_junction(tmp_path: Path, exit_road: str, by: str) -> None:
    end = on_lane(-1, 50.0, road=exit_road)
    guide = assign_route(on_lane(-1, 60.0), end) if by == "route" else acquire(end)
    start = {"Ego": teleport(on_lane(-1, 50.0)) + speed(20.0) + guide}
    played = Stage(tmp_path, crossing()).play(start=start, last=5.0)
    motion = entity(played)
    roads = list(dict.fromkeys(played.network.road_ids[k] for k in motion.road))
    assert roads == ["1", f"1{exit_road}", exit_road]
    np.testing.assert_allclose(motion.offset, 0.0, atol=1e-9)


def test_a_route_assigned_on_the_way_counts_from_then_on(tmp_path: Path) -> None:
    guide = assign_route(on_lane(-1, 60.0), on_lane(-1, 50.0, road="4"))
    played = Stage(tmp_path, crossing()).play(
        maneuvers(event(guide, trigger=after(1.0))), start=ego(-1, 50.0), last=5.0
    )
    motion = entity(played)
    assert played.network.road_ids[motion.road[-1]] == "4"
    assert row(motion, 1.0)


@pytest.mark.parametrize("strategy", ["shortest", "fastest", "leastIntersections", "random"])
def test_a_route_by_another_strategy_is_the_shortest_and_named(tmp_path: Path, strategy: str) -> None:
    guide = assign_route(on_lane(-1, 60.0), on_lane(-1, 50.0, road="4"), strategy=strategy)
    played = Stage(tmp_path, crossing()).play(start={"Ego": teleport(on_lane(-1, 50.0)) + guide}, last=0.1)
    noted = [note.what for note in played.motion.notes if "routeStrategy" in note.what]
    assert noted == ([] if strategy == "shortest" else [f"routeStrategy {strategy}: the shortest way is taken"])


def direct_junction() -> str:
    """Road 1 goes over into road 2; without connecting roads."""
    roads = [
        road("1", line(length=100.0), 100.0, link='<successor elementType="junction" elementId="100"/>'),
        road("2", line(100.0, length=200.0), 200.0, link='<predecessor elementType="junction" elementId="100"/>'),
    ]
    links = "".join(f'<laneLink from="{k}" to="{k}"/>' for k in (2, 1, -1, -2))
    connection = f'<connection id="0" incomingRoad="1" linkedRoad="2" contactPoint="start">{links}</connection>'
    return map_of(*roads, f'<junction id="100" name="j" type="direct">{connection}</junction>')


@pytest.mark.parametrize(("road_id", "lane", "s", "way"), [("1", -2, 50.0, 1.0), ("2", 1, 50.0, -1.0)])
def test_a_direct_junction_is_driven_both_ways(tmp_path: Path, road_id: str, lane: int, s: float, way: float) -> None:
    played = Stage(tmp_path, direct_junction()).play(start=ego(lane, s, road=road_id), last=4.0)
    motion = entity(played)
    np.testing.assert_allclose(motion.x, motion.x[0] + way * 20.0 * motion.time, atol=1e-9)
    assert len(set(motion.road.tolist())) == 2
    assert set(motion.lane.tolist()) == {lane}


@pytest.mark.parametrize(("exit_road", "by"), [("3", "13"), ("4", "14"), (None, "12")])
def test_a_relative_position_follows_the_route_of_who_is_put_there(
    tmp_path: Path, exit_road: str | None, by: str
) -> None:
    """100 m on from Lead, which is 20 m before the junction and has no route: past the arms of 20 m."""
    way = "" if exit_road is None else assign_route(on_lane(-1, 5.0), on_lane(-1, 60.0, road=exit_road))
    ahead = '<RelativeLanePosition entityRef="Lead" dLane="0" dsLane="30"/>'
    start = {"Lead": teleport(on_lane(-1, 80.0)), "Ego": way + teleport(ahead)}
    played = Stage(tmp_path, crossing()).play(start=start, last=0.1)
    assert played.network.road_ids[entity(played).road[0]] == by


def test_where_a_lane_has_closed_the_one_of_its_side_that_opens_beside_it_goes_on(tmp_path: Path) -> None:
    closing = '<lane id="-1" type="driving"><width sOffset="0" a="3.5" b="-0.0175" c="0" d="0"/></lane>'
    apart = dict.fromkeys((1, -1), (None, None))
    sections = section(lanes(1, links=apart), closing) + section(lanes(1, links=apart), lanes(-1, links=apart), s=200.0)
    roads = map_of(road("1", line(length=400.0), 400.0, sections=sections))
    start = {"Ego": teleport(on_lane(-1, 150.0)) + speed(10.0)}
    motion = entity(Stage(tmp_path, roads).play(start=start, last=8.0))
    assert motion.x[-1] > 200.0
    assert motion.y[-1] == pytest.approx(-0.5 * WIDTH)


def test_where_a_lane_ends_with_its_section_the_one_beside_its_middle_goes_on(tmp_path: Path) -> None:
    """With the offset kept, however far aside that is."""
    sections = section(lanes(1), lanes(-1, -2) + lanes(-3, links={-3: (None, None)})) + section(
        lanes(1), lanes(-1, -2), s=200.0
    )
    roads = map_of(road("1", line(length=400.0), 400.0, sections=sections))
    start = {"Ego": teleport(on_lane(-3, 150.0, offset=4.0)) + speed(10.0)}
    motion = entity(Stage(tmp_path, roads).play(start=start, last=8.0))
    assert motion.x[-1] > 200.0
    assert motion.y[-1] == pytest.approx(-1.5 * WIDTH + 4.0)
