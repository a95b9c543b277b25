"""The check after a play: motions made by hand, each with one thing wrong."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.kit.stage import line, map_of, road, section
from xosc_lateral.files.opendrive.reader import parse_opendrive
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.workflows.playing.check import doubts_about
from xosc_lateral.world.motion.nominal import (
    Activity,
    EntityMotion,
    FollowedRoute,
    NominalMotion,
    made_vehicle,
)
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.road.positions import RouteStep
from xosc_lateral.world.scenario.place import Place

STEP, SPEED = 0.1, 20.0
TIME = STEP * np.arange(51)
SHOULDER = '<lane id="-2" type="shoulder"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'


def lane(number: int) -> str:
    return f'<lane id="{number}" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    roads = (road(name, line(length=500.0), 500.0, sections=section("", lane(-1) + SHOULDER)) for name in "123")
    return parse_opendrive(map_of(*roads).encode(), "made.xodr")


def car(name: str = "A", **columns: Any) -> EntityMotion:
    """One that drives along the first road's first lane at 20 m/s."""
    n = len(TIME)
    usual: dict[str, Any] = {"x": SPEED * TIME, "y": -1.75, "speed": SPEED, "lane": -1, "s": SPEED * TIME}
    usual |= dict.fromkeys(("z", "heading", "pitch", "roll", "offset", "heading_relative"), 0.0)
    usual |= {"road": 0, "activity": np.full(n, Activity.ACTIVE, dtype=np.uint8)} | columns
    kinds = {"road": np.int32, "lane": np.int32, "activity": np.uint8}
    arrays = {key: np.broadcast_to(value, n).astype(kinds.get(key, np.float64)) for key, value in usual.items()}
    return EntityMotion.of(made_vehicle(name, 4.6, 1.9, 1.4), TIME, **arrays)


def said(network: RoadNetwork, *cars: EntityMotion, routes: tuple[FollowedRoute, ...] = ()) -> list[str]:
    motion = NominalMotion(STEP, cars, end_time=5.0, ended_by="time limit", notes=(), routes=routes)
    return [note.what for note in doubts_about(motion, network, {})]


def test_who_drives_along_a_lane_gives_no_doubt(network: RoadNetwork) -> None:
    assert not said(network, car(), car("B", x=50.0 + SPEED * TIME, s=50.0 + SPEED * TIME))


def test_a_jump_aside_is_named_with_its_time_but_for_who_is_placed_anew(network: RoadNetwork) -> None:
    y = np.where(TIME < 2.95, -1.75, 0.6)
    (what,) = said(network, car(y=y))
    assert what.startswith("'A' jumps 3.1 m at 3.00 s, further than its speed explains")
    placed = np.full(len(TIME), Activity.ACTIVE, dtype=np.uint8)
    placed[30] |= Activity.TELEPORTED
    assert not said(network, car(y=y, activity=placed))


FIELD = Path(__file__).resolve().parents[4] / "shared" / "cases" / "field"


@pytest.mark.skipif(not FIELD.is_dir(), reason="no shared cases")
@pytest.mark.parametrize(
    ("case", "told"),
    [
        ("jump_blamed_on_the_road/ld5", "a LongitudinalDistanceAction without dynamic constraints puts it"),
        ("contact_point_contradicts_geometry/contact", "contactPoint='end' of the successor of road '1' contradicts"),
        ("ttc_rising_at_zero/scenario", "holds at 0 s; in esmini, for which 'Ego' stands in the first frame"),
        ("standing_lane_offset/scenario", "'A' moves sideways while it hardly drives"),
        ("sync_behind_target/scenario", "the place of 'B' lies behind it"),
    ],
)
def test_a_doubt_names_its_cause(case: str, told: str) -> None:
    lines = list(map(str, play_scenario(FIELD / f"{case}.xosc").motion.messages))
    assert sum(told in line for line in lines) == 1, lines


def test_no_lateral_action_is_a_jump(network: RoadNetwork) -> None:
    assert not said(network, car(y=-1.75 + np.clip(9.0 * (TIME - 2.0), 0.0, 3.5)))


def test_a_slanting_way_is_no_jump(network: RoadNetwork) -> None:
    """A lane of 3.5 m that opens over 10 m."""
    y = -1.75 - 1.75 * np.clip((SPEED * TIME - 40.0) / 10.0, 0.0, 1.0)
    assert not said(network, car(y=y))


def test_a_shoulder_that_nobody_steered_for_is_named(network: RoadNetwork) -> None:
    lanes = np.where(TIME < 2.95, -1, -2)
    (what,) = said(network, car(lane=lanes))
    assert "lane -2 of road '1', of type shoulder, at 3.00 s" in what
    steered = np.full(len(TIME), Activity.ACTIVE | Activity.LATERAL, dtype=np.uint8)
    assert not said(network, car(lane=lanes, activity=steered))
    assert not said(network, car(lane=-2))


@pytest.mark.parametrize(("ahead", "aside", "touches"), [(4.5, 0.0, True), (4.7, 0.0, False), (0.0, 2.0, False)])
def test_boxes_that_overlap_at_the_start_are_named(
    network: RoadNetwork, ahead: float, aside: float, touches: bool
) -> None:
    other = car("B", x=ahead + SPEED * TIME, y=-1.75 + aside)
    assert said(network, car(), other) == (["'B' appears in 'A': their boxes overlap at 0.00 s"] if touches else [])


def test_who_appears_later_is_looked_at_then(network: RoadNetwork) -> None:
    later = np.where(TIME < 1.95, 0, Activity.ACTIVE).astype(np.uint8)
    (what,) = said(network, car(), car("B", activity=later))
    assert what == "'B' appears in 'A': their boxes overlap at 2.00 s"


def route(*roads: int, stops: tuple[tuple[int, int, float], ...]) -> FollowedRoute:
    steps = tuple(RouteStep(index, 1, 0.0, 500.0) for index in roads)
    return FollowedRoute("A", 0.0, steps, stops, Place("made.xosc", 7, "AssignRouteAction"))


def test_a_route_that_is_left_is_named(network: RoadNetwork) -> None:
    way = route(0, 1, stops=((0, -1, 0.0), (1, -1, 400.0)))
    roads = np.where(TIME < 2.95, 0, 2)
    (what,) = said(network, car(road=roads), routes=(way,))
    assert what == "'A' leaves its route: it is on road '3', at 3.00 s"
    assert not said(network, car(road=np.where(TIME < 2.95, 0, 1)), routes=(way,))


def test_a_waypoint_that_is_passed_in_another_lane_is_named(network: RoadNetwork) -> None:
    (what,) = said(network, car(), routes=(route(0, stops=((0, -1, 0.0), (0, -2, 50.0))),))
    assert what.startswith("'A' passes waypoint 2 of its route in lane -1 of road '1' instead of -2, at 2.5")


def test_whoever_a_controller_steers_is_not_doubted(network: RoadNetwork) -> None:
    """Its nominal way is not the one that it will take."""
    steered = np.full(len(TIME), Activity.ACTIVE | Activity.STEERED, dtype=np.uint8)
    assert not said(network, car(lane=np.where(TIME < 2.95, -1, -2), activity=steered))
    assert not said(network, car(y=np.where(TIME < 2.95, -1.75, 0.6), activity=steered))
