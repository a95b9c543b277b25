"""Where the positions of a file are, by hand."""

from __future__ import annotations

from math import hypot, pi, radians
from pathlib import Path

import numpy as np
import pytest

from tests.kit.stage import (
    STRAIGHT,
    WIDTH,
    Stage,
    arc,
    entity,
    facing,
    in_world,
    map_of,
    on_lane,
    polyline,
    road,
    speed,
    teleport,
)
from tests.world.player.test_driving import MIRRORED, crossing
from xosc_lateral.base.errors import PlaybackError, XoscLateralError
from xosc_lateral.world.player.positions import resolve
from xosc_lateral.world.player.positions.geo import ProjectionError, project
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.position import RelativeObjectPosition, RelativeRoadPosition

REF = teleport(on_lane(-2, 100.0)) + speed(10.0)
BEND = map_of(road("1", arc(0.01, length=300.0), 300.0))


def placed(
    folder: Path, position: str, *, roads: str = STRAIGHT, ref: str = REF, minor: int = 2
) -> tuple[float, float, float, int]:
    """x, y, heading and lane of an entity put at a position, beside another one called Ref. [m], [rad]"""
    start = {"Ref": ref, "Ego": teleport(position)}
    motion = entity(Stage(folder, roads).play(start=start, last=0.1, minor=minor))
    heading = (float(motion.heading[0]) + pi) % (2.0 * pi) - pi
    return float(motion.x[0]), float(motion.y[0]), heading, int(motion.lane[0])


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        (on_lane(-2, 50.0), (50.0, -1.5 * WIDTH, 0.0, -2)),
        (on_lane(-2, 50.0, offset=0.5), (50.0, -1.5 * WIDTH + 0.5, 0.0, -2)),
        (on_lane(1, 50.0), (50.0, 0.5 * WIDTH, -pi, 1)),
        (on_lane(1, 50.0, orientation=facing(0.2)), (50.0, 0.5 * WIDTH, 0.2 - pi, 1)),
        (on_lane(1, 50.0, orientation=facing(0.2, "absolute")), (50.0, 0.5 * WIDTH, 0.2, 1)),
        ('<RoadPosition roadId="1" s="50" t="4"/>', (50.0, 4.0, 0.0, 2)),
        (in_world(50.0, -4.0, 0.3), (50.0, -4.0, 0.3, -2)),
        ('<RelativeWorldPosition entityRef="Ref" dx="5" dy="2"/>', (105.0, -1.5 * WIDTH + 2.0, 0.0, -1)),
        ('<RelativeObjectPosition entityRef="Ref" dx="-5" dy="1"/>', (95.0, -1.5 * WIDTH + 1.0, 0.0, -2)),
        ('<RelativeRoadPosition entityRef="Ref" ds="20" dt="3.5"/>', (120.0, -0.5 * WIDTH, 0.0, -1)),
        ('<RelativeLanePosition entityRef="Ref" ds="20" dLane="1"/>', (120.0, -0.5 * WIDTH, 0.0, -1)),
        ('<RelativeLanePosition entityRef="Ref" ds="20" dLane="2" offset="1"/>', (120.0, 0.5 * WIDTH + 1.0, 0.0, 1)),
        ('<RelativeLanePosition entityRef="Ref" dsLane="-20" dLane="1"/>', (80.0, -0.5 * WIDTH, 0.0, -1)),
    ],
)
def test_positions(tmp_path: Path, position: str, expected: tuple[float, float, float, int]) -> None:
    x, y, heading, lane = placed(tmp_path, position)
    assert (x, y) == pytest.approx(expected[:2], abs=1e-6)
    assert np.cos(heading - expected[2]) == pytest.approx(1.0, abs=1e-12)
    assert lane == expected[3]


def test_a_path_beside_an_entity_is_found_on_one_way_whatever_it_begins_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As reactive outputs have it: the first vertex is where the vehicle is, the others are beside its way."""
    played = Stage(tmp_path, BEND).play(start={"Ref": REF, "Ego": REF}, last=0.1)
    simulation, here = Simulation(played.scenario, played.network), Place("", None, "")
    simulation.entity("Ref", here).move_to(0, -2, 100.0, 0.2)
    places = [
        RelativeObjectPosition("Ref", 0.0, 0.0, place=here),
        *(RelativeRoadPosition("Ref", 3.0 * k, 0.1 * k, place=here) for k in range(1, 9)),
    ]
    one_by_one = [resolve.pose_of(place, simulation) for place in places]
    asked = list[object]()
    monkeypatch.setattr(resolve, "pose_of", lambda place, _: asked.append(place) or one_by_one[0])
    assert np.allclose(resolve.poses_of(places, simulation), one_by_one, rtol=0.0, atol=1e-9)
    assert asked == places[:1]


def test_relative_to_an_entity_that_drives_against_s(tmp_path: Path) -> None:
    """`ds` and `dLane` count along s and t; `dsLane` along the direction of travel and to the left of it."""
    ref = teleport(on_lane(2, 100.0)) + speed(10.0)
    along_s = placed(tmp_path, '<RelativeLanePosition entityRef="Ref" ds="20" dLane="-1"/>', ref=ref)
    along_travel = placed(tmp_path, '<RelativeLanePosition entityRef="Ref" dsLane="20" dLane="1"/>', ref=ref)
    assert along_s[:2] == pytest.approx((120.0, 0.5 * WIDTH))
    assert along_travel[:2] == pytest.approx((80.0, 0.5 * WIDTH))


@pytest.mark.parametrize(
    ("position", "place", "missing"),
    [
        ('<RelativeRoadPosition entityRef="Ref" dt="3.5"/>', (100.0, -0.5 * WIDTH), "ds"),
        ('<RelativeRoadPosition entityRef="Ref" ds="20"/>', (120.0, -1.5 * WIDTH), "dt"),
        ('<RelativeLanePosition entityRef="Ref" dLane="1"/>', (100.0, -0.5 * WIDTH), "ds"),
        ('<RelativeLanePosition entityRef="Ref" ds="20"/>', (120.0, -1.5 * WIDTH), "dLane"),
    ],
)
def test_a_missing_distance_is_none_and_said(
    tmp_path: Path, position: str, place: tuple[float, float], missing: str
) -> None:
    played = Stage(tmp_path).play(start={"Ref": REF, "Ego": teleport(position)}, last=0.1)
    motion = entity(played)
    assert (motion.x[0], motion.y[0]) == pytest.approx(place)
    assert any(f"{missing} is missing: taken as 0" in str(note) for note in played.motion.notes)


def test_relative_positions_go_on_over_road_borders(tmp_path: Path) -> None:
    x, y, _, lane = placed(tmp_path, '<RelativeLanePosition entityRef="Ref" ds="150" dLane="0"/>', roads=MIRRORED)
    assert (x, y) == pytest.approx((250.0, -1.5 * WIDTH))
    assert lane == 2


def test_an_orientation_without_a_type_is_absolute_before_version_1_3_and_relative_from_then_on(
    tmp_path: Path,
) -> None:
    position = on_lane(-1, 50.0, orientation='<Orientation h="0.1"/>')
    along = 0.01 * 50.0
    assert placed(tmp_path, position, roads=BEND, minor=2)[2] == pytest.approx(0.1)
    assert placed(tmp_path, position, roads=BEND, minor=3)[2] == pytest.approx(along + 0.1)


def test_relative_to_an_entity_that_comes_later_in_the_file(tmp_path: Path) -> None:
    start = {"Ego": teleport('<RelativeLanePosition entityRef="Ref" ds="20" dLane="0"/>'), "Ref": REF}
    assert entity(Stage(tmp_path).play(start=start, last=0.1)).x[0] == pytest.approx(120.0)


def test_a_position_on_a_trajectory(tmp_path: Path) -> None:
    way = polyline((None, in_world(0.0, 0.0)), (None, in_world(100.0, 0.0)))
    position = f'<TrajectoryPosition s="30" t="2"><TrajectoryRef>{way}</TrajectoryRef></TrajectoryPosition>'
    assert placed(tmp_path, position)[:2] == pytest.approx((30.0, 2.0), abs=1e-6)


@pytest.mark.parametrize(("path_s", "place"), [(20.0, (60.0, -0.5 * WIDTH)), (90.0, (130.0, -0.5 * WIDTH))])
def test_a_position_on_a_route(tmp_path: Path, path_s: float, place: tuple[float, float]) -> None:
    waypoints = "".join(
        f'<Waypoint routeStrategy="shortest"><Position>{position}</Position></Waypoint>'
        for position in (on_lane(-1, 40.0), on_lane(-1, 50.0, road="2"))
    )
    position = (
        f'<RoutePosition><RouteRef><Route name="r" closed="false">{waypoints}</Route></RouteRef><InRoutePosition>'
        f'<FromLaneCoordinates pathS="{path_s}" laneId="-1"/></InRoutePosition></RoutePosition>'
    )
    ref = teleport(on_lane(-1, 10.0))
    assert placed(tmp_path, position, roads=crossing(), ref=ref)[:2] == pytest.approx(place, abs=1e-6)


def test_where_a_route_runs_along_the_road_its_lanes_are_the_road_s(tmp_path: Path) -> None:
    waypoints = "".join(
        f'<Waypoint routeStrategy="shortest"><Position>{on_lane(-1, s)}</Position></Waypoint>' for s in (100.0, 300.0)
    )
    place = '<InRoutePosition><FromLaneCoordinates pathS="20" laneId="1"/></InRoutePosition>'
    route = f'<RouteRef><Route name="r" closed="false">{waypoints}</Route></RouteRef>'
    position = f"<RoutePosition>{route}{place}</RoutePosition>"
    assert placed(tmp_path, position)[:2] == pytest.approx((120.0, 0.5 * WIDTH), abs=1e-6)


@pytest.mark.parametrize("orientation_first", [True, False])
def test_a_position_on_a_route_against_the_road_is_along_the_route(tmp_path: Path, orientation_first: bool) -> None:
    """Lane -1 of the route is the road's lane 1; the standard lets the orientation stand before or after the place."""
    waypoints = "".join(
        f'<Waypoint routeStrategy="shortest"><Position>{on_lane(1, s)}</Position></Waypoint>' for s in (300.0, 100.0)
    )
    parts = [
        '<Orientation h="0.2" type="relative"/>',
        '<InRoutePosition><FromLaneCoordinates pathS="20" laneId="-1"/></InRoutePosition>',
    ]
    route = f'<RouteRef><Route name="r" closed="false">{waypoints}</Route></RouteRef>'
    position = f"<RoutePosition>{route}{''.join(parts if orientation_first else reversed(parts))}</RoutePosition>"
    assert placed(tmp_path, position) == pytest.approx((280.0, 0.5 * WIDTH, 0.2 - pi, 1), abs=1e-6)


@pytest.mark.parametrize(("first", "last", "is_said"), [(300.0, 100.0, True), (100.0, 300.0, False)])
def test_a_route_that_runs_against_s_is_said(tmp_path: Path, first: float, last: float, is_said: bool) -> None:
    lane = 1 if is_said else -1
    waypoints = "".join(
        f'<Waypoint routeStrategy="shortest"><Position>{on_lane(lane, s)}</Position></Waypoint>' for s in (first, last)
    )
    place = f'<InRoutePosition><FromLaneCoordinates pathS="20" laneId="{lane}"/></InRoutePosition>'
    position = f'<RoutePosition><RouteRef><Route name="r" closed="false">{waypoints}</Route></RouteRef>{place}'
    played = Stage(tmp_path).play(start={"Ego": teleport(f"{position}</RoutePosition>")}, last=0.0)
    assert any("runs against s" in note.what for note in played.motion.notes) is is_said


def test_beyond_the_end_of_the_road_is_its_end_and_said(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(start={"Ego": teleport(on_lane(-1, 1200.0))}, last=0.1)
    assert entity(played).x[0] == pytest.approx(1000.0)
    assert any("beyond" in note.what for note in played.motion.notes)


@pytest.mark.parametrize(
    ("position", "said"),
    [
        (on_lane(-5, 50.0), "no lane -5"),
        (on_lane(-1, 50.0, road="77"), "no road '77'"),
        ('<RelativeLanePosition entityRef="Nobody" ds="1" dLane="0"/>', "Nobody"),
        ('<GeoPosition latitudeDeg="48" longitudeDeg="11"/>', "geoReference"),
    ],
)
def test_what_is_not_there_is_named_with_its_line(tmp_path: Path, position: str, said: str) -> None:
    with pytest.raises(XoscLateralError, match=said) as error:
        placed(tmp_path, position)
    assert "scenario.xosc" in str(error.value)
    assert isinstance(error.value, PlaybackError) or "Nobody" in said


# ---- geographic coordinates ------------------------------------------------------------------------------------------
@pytest.mark.parametrize(
    ("reference", "latitude", "longitude", "expected"),
    [
        # EPSG guidance note 7-2, UTM-like example of the transverse Mercator, on WGS 84 instead of its ellipsoid;
        # the central meridian's distance from the equator is the textbook quarter of the meridian: 10 001 965.729 m.
        ("+proj=tmerc +lat_0=0 +lon_0=9 +k=1 +x_0=0 +y_0=0 +datum=WGS84", 90.0, 9.0, (0.0, 10001965.729)),
        ("+proj=utm +zone=32 +datum=WGS84", 0.0, 9.0, (500000.0, 0.0)),
        ("+proj=utm +zone=32 +south +datum=WGS84", 0.0, 9.0, (500000.0, 10000000.0)),
        ("+proj=merc +lon_0=0 +k=1 +x_0=0 +y_0=0 +datum=WGS84", 0.0, 1.0, (6378137.0 * pi / 180.0, 0.0)),
    ],
)
def test_projections(reference: str, latitude: float, longitude: float, expected: tuple[float, float]) -> None:
    assert project(reference, radians(latitude), radians(longitude)) == pytest.approx(expected, abs=2e-3)


def test_a_utm_reference_with_an_origin_instead_of_a_zone_means_that_origin() -> None:
    local = "+lat_0=37.3 +lon_0=-122 +k_0=1 +x_0=0 +y_0=0 +datum=WGS84"
    place = radians(37.31), radians(-122.02)
    assert project(f"+proj=utm {local}", *place) == project(f"+proj=tmerc {local}", *place)


def test_a_transverse_mercator_keeps_angles_and_small_distances() -> None:
    """A metre north and a metre east on the ellipsoid are k metres each on the plane, at right angles."""
    reference = "+proj=tmerc +lat_0=48 +lon_0=11 +k=1 +datum=WGS84"
    lat, lon = radians(48.1), radians(11.2)
    a, e2 = 6378137.0, (2.0 - 1.0 / 298.257223563) / 298.257223563
    w = 1.0 - e2 * np.sin(lat) ** 2
    north, east = a * (1.0 - e2) / w**1.5, a * np.cos(lat) / w**0.5
    x, y = project(reference, lat, lon)
    step = 100.0
    up = project(reference, lat + step / north, lon)
    side = project(reference, lat, lon + step / east)
    a_, b_ = (up[0] - x, up[1] - y), (side[0] - x, side[1] - y)
    assert hypot(*a_) == pytest.approx(step, rel=1e-5)
    assert hypot(*b_) == pytest.approx(step, rel=1e-5)
    assert a_[0] * b_[0] + a_[1] * b_[1] == pytest.approx(0.0, abs=step * step * 1e-5)


@pytest.mark.parametrize("reference", [None, "", "EPSG:4326", "+proj=utm", "+proj=lcc +lat_1=1", "+proj=tmerc +k=x"])
def test_references_without_a_usable_projection_are_refused(reference: str | None) -> None:
    with pytest.raises(ProjectionError):
        project(reference, 0.8, 0.2)


def test_a_geographic_position_is_on_the_map(tmp_path: Path) -> None:
    reference = (
        "<geoReference><![CDATA[+proj=tmerc +lat_0=48 +lon_0=11 +k=1 +x_0=0 +y_0=0 +datum=WGS84]]></geoReference>"
    )
    roads = STRAIGHT.replace('revMinor="6"/>', f'revMinor="6">{reference}</header>', 1)
    x, y, _, _ = placed(tmp_path, '<GeoPosition latitudeDeg="48" longitudeDeg="11.001"/>', roads=roads)
    assert (x, y) == pytest.approx((74.63, 0.0), abs=0.05)
