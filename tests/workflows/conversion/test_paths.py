"""Paths of vehicles that react, played: over turns and joints, behind an ego that stops; and what the check sees."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import xosc_lateral as xl
from tests.kit.made import reactive
from tests.kit.made.roads import ROADS
from tests.kit.scenario_files import (
    entity,
    private,
    scenario_text,
    speed_action,
    teleport,
    time_condition,
    write_scenario,
)
from tests.kit.stage import follow, polyline
from tests.workflows.conversion.test_vehicle_under_test import EXTERNAL
from tests.world.scenario.test_under_test import at, event, headway, stories
from xosc_lateral.workflows.conversion.ego_drives import BRAKING_RATE, Drive, drives, with_speeds
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.look import look_at, moving
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.player.player import play

ROUTE = (
    '<PrivateAction><RoutingAction><AssignRouteAction><Route name="r" closed="false">'
    '<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" s="60"/></Position></Waypoint>'
    '<Waypoint routeStrategy="shortest"><Position><LanePosition roadId="3" laneId="-1" s="300"/></Position></Waypoint>'
    "</Route></AssignRouteAction></RoutingAction></PrivateAction>"
)


@pytest.fixture
def turning(tmp_path: Path) -> Path:
    """T turns off at a junction, and brakes if Ego, who goes straight on, comes near."""
    brake = reactive._event("brake", reactive._distance("Ego", "T", 8.0, "lessThan"), reactive._speed(9.0, 2.0))
    cars = [("Ego", -1, 20.0, 18.0), ("T", -1, 60.0, 18.0)]
    text = reactive._scenario(cars, [reactive._group("T", brake)], reactive._time(22))
    at = text.index("</Private>", text.index('<Private entityRef="T"'))
    (tmp_path / "road.xodr").write_text(ROADS["junction"](np.random.default_rng(1), 1).xml())
    path = tmp_path / "turning.xosc"
    path.write_text(text[:at] + ROUTE + text[at:])
    return path


def _car(path: Path, name: str = "T") -> EntityMotion:
    return next(one for one in play_scenario(path).motion.entities if one.name == name)


def test_a_car_moves_through_a_turn_and_takes_it(turning: Path, tmp_path: Path) -> None:
    made = xl.convert(turning, tmp_path / "out.xosc", seed=1)
    assert made.modes == {"T": "lane-offset"}
    source, car = _car(turning), _car(tmp_path / "out.xosc")
    assert (source.road[-1], source.lane[-1]) == (car.road[-1], car.lane[-1])
    assert car.road[-1] == 2 and moving(car)[1].mean() > 0.95
    away = np.hypot(car.x - source.x, car.y - source.y)
    assert away.max() < 1.0 and np.abs(np.diff(away)).max() < 0.02
    turned = np.abs(np.angle(np.exp(1j * (car.heading - source.heading))))
    assert turned.max() < 0.04


def test_an_ego_of_the_check_stops_so_that_others_would_stand_at_a_joint(turning: Path) -> None:
    played = play_scenario(turning)
    motion = played.motion
    car = next(one for one in motion.entities if one.name == "T")
    joints = car.time[1:][np.diff(car.road) != 0]
    speeds = [one.speeds for one in drives(motion, ["Ego"], played.network)]
    _, slow, fast, ((braking, to, _), (later, *_)), ((begin, never, _),) = speeds[:5]
    assert (begin, never) == (0.0, 0.0)
    assert (slow[0][1], fast[0][1], to) == (0.7, 1.3, 0.0) and later > braking + 18.0 / BRAKING_RATE
    assert np.abs(joints - braking - 0.5 * 18.0 / BRAKING_RATE).min() < 1e-9
    assert drives(motion, [], played.network) == (Drive(),)


TIED = (
    '<PrivateAction><LongitudinalAction><SpeedAction><SpeedActionDynamics dynamicsShape="linear" value="1" '
    'dynamicsDimension="time"/><SpeedActionTarget><RelativeTargetSpeed entityRef="Ego" value="0" continuous="true" '
    'speedTargetValueType="delta"/></SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>'
)


def test_a_car_whose_speed_is_tied_to_an_ego_that_stops_stands_straight_and_goes_on(tmp_path: Path) -> None:
    places = {"Ego": "50", "A": "150"}
    init = private("Ego", teleport(places["Ego"]), speed_action("20"))
    init += private("A", teleport(places["A"]), speed_action("20"), TIED)
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL) + entity("A"),
        init=init,
        stories=stories(("A", event("late", headway("Ego", "A"), speed_action("20")))),
        stop=time_condition(30),
    )
    path = write_scenario(tmp_path, text)
    assert xl.convert(path, tmp_path / "out.xosc", seed=1).modes == {"A": "lane-offset"}
    played = play_scenario(tmp_path / "out.xosc")
    stopping = with_speeds(played.scenario, played.motion, ["Ego"], ((5.0, 0.0, 5.0), (14.0, 1.0, 3.0)))
    car = next(one for one in play(stopping, played.network, step=0.02).entities if one.name == "A")
    stands = np.abs(car.speed) < 0.01
    assert stands.sum() > 100 and np.ptp(car.offset[stands]) < 1e-6
    assert np.abs(np.sin(car.heading_relative[np.abs(car.speed) < 2.0])).max() < 0.01
    assert moving(car)[1].mean() > 0.95


def test_the_check_sees_a_car_that_slides_is_turned_or_takes_another_road(turning: Path) -> None:
    played = play_scenario(turning)
    motion = played.motion
    car = next(one for one in motion.entities if one.name == "T")

    def seen(**columns: np.ndarray) -> list[str]:
        other = tuple(car.having(**columns) if one is car else one for one in motion.entities)
        return [
            one.what
            for one in look_at(played.network, motion, replace(motion, entities=other), ["T"])
            if one.is_meaning
        ]

    later = car.time > 5.0
    assert seen() == []
    assert "is put" in seen(y=car.y + np.clip(0.5 * (car.time - 5.0), 0.0, 0.4))[0]
    assert "is turned by 17.2 degrees" in seen(heading=car.heading + np.where(later, 0.3, 0.0))[0]
    road = np.where(car.road == 2, 1, car.road).astype(np.int32)
    assert "drives onto road '2' as number 2" in seen(road=road)[0]


def test_a_path_turns_a_car_that_a_stopped_lane_change_leaves_turned_by_and_by(tmp_path: Path) -> None:
    """The player moves it on as it is turned; it is straightened over 0.1 s, not in a frame."""
    made = {name: (road, text) for name, road, text in reactive.reactive_scenarios()}
    road, text = made["act stopped half-way"]
    (tmp_path / "road.xodr").write_text(road)
    (tmp_path / "scenario.xosc").write_text(text)
    xl.convert(tmp_path / "scenario.xosc", tmp_path / "out.xosc", ego=["Ego"], seed=3)
    source, car = _car(tmp_path / "scenario.xosc"), _car(tmp_path / "out.xosc")
    assert abs(np.sin(source.heading_relative[-1])) > 0.02 > 0.01 > abs(np.sin(car.heading_relative[-1]))
    assert np.abs(np.diff(np.unwrap(car.heading))).max() < 0.008  # in 0.02 s


def test_an_offset_is_led_out_before_a_trajectory_that_starts_without_it(tmp_path: Path) -> None:
    way = polyline(*((0.0, f'<LanePosition roadId="1" laneId="-1" s="{s}"/>') for s in range(400, 701, 20)))
    init = private("Ego", teleport("20"), speed_action("20")) + private("A", teleport("100"), speed_action("25"))
    brake, trajectory = event("late", headway("Ego", "A"), speed_action("20")), event("way", at(12.0), follow(way))
    text = scenario_text(
        entities=entity("Ego", controller=EXTERNAL) + entity("A"), init=init,
        stories=stories(("A", brake), ("A", trajectory)), stop=time_condition(20),
    )  # fmt: skip
    made = xl.convert(write_scenario(tmp_path, text), tmp_path / "out.xosc", seed=1)
    assert made.modes == {"A": "lane-offset"}
    car = _car(tmp_path / "out.xosc", "A")
    assert np.abs(car.offset[car.time < 4.0]).max() > 0.05
    assert np.abs(np.diff(car.offset)).max() < 0.01 and np.abs(car.offset[car.time > 12.1]).max() < 1e-6
