"""Context of a driver in a scenario, against distances and curvatures worked out by hand."""

from __future__ import annotations

from datetime import datetime
from pathlib import Path

import numpy as np
import pytest

from tests.kit.motion import LANE_WIDTH, RADIUS, drive, entity, entity_context, together, two_roads
from tests.kit.profiles import effect_from_dict
from xosc_lateral.drivers.model.effects import ColumnEffect
from xosc_lateral.world.motion.nominal import EntityMotion, PlayedAction
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.entity import Entity
from xosc_lateral.world.scenario.enums import VehicleCategory
from xosc_lateral.world.scenario.global_actions import Environment, EnvironmentAction, TimeOfDay, Weather
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.scenario import Action
from xosc_lateral.world.surroundings.around import INFLUENCE_DISTANCE
from xosc_lateral.world.surroundings.context import STEERING_DURATION

GRID = np.arange(0, 501, 10)
TRUCK = VehicleCategory.TRUCK


@pytest.mark.parametrize(("lane", "sign"), [(-2, 1.0), (2, -1.0)])
def test_curvature_is_that_of_the_lane_and_positive_to_the_left_of_travel(
    tmp_path: Path, lane: int, sign: float
) -> None:
    network = two_roads(tmp_path)
    start = 550.0 if lane < 0 else 100.0
    context = entity_context(together(drive(network, entity(), lane=lane, start=start)), network, 0, GRID)
    t = np.sign(lane) * 1.5 * LANE_WIDTH
    np.testing.assert_allclose(context["curvature"], sign / (RADIUS - t), rtol=1e-9)


def test_lane_index_counts_from_the_right_of_travel_in_both_directions(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    for lane, expected in ((-3, 0), (-1, 2), (3, 0), (1, 2)):
        context = entity_context(together(drive(network, entity(), lane=lane)), network, 0, GRID)
        assert set(context["lane_index"]) == {expected}
        assert set(context["lane_count"]) == {3}
        np.testing.assert_allclose(context["lane_width"], LANE_WIDTH)


@pytest.mark.parametrize("lane", [-2, 2])
def test_lead_distance_is_bumper_to_bumper_also_across_a_road_border(tmp_path: Path, lane: int) -> None:
    network = two_roads(tmp_path)
    own = drive(network, entity("own"), lane=lane, start=380.0)
    lead = drive(network, entity("lead", TRUCK, 15.0), lane=lane, start=440.0)
    context = entity_context(together(own, lead), network, 0, GRID)
    np.testing.assert_allclose(context["lead_distance"], 60.0 - 0.5 * (5.0 + 15.0), atol=1e-6)
    assert set(context["lead_is_truck"]) == {1.0}
    behind = entity_context(together(own, lead), network, 1, GRID)
    assert np.isposinf(behind["lead_distance"]).all()


@pytest.mark.parametrize(("lane", "neighbour"), [(-2, -1), (2, 1)])
def test_neighbours_are_found_on_their_side_and_flagged_while_alongside(
    tmp_path: Path, lane: int, neighbour: int
) -> None:
    network = two_roads(tmp_path)
    own = drive(network, entity("own"), lane=lane, start=100.0, speed=30.0)
    left = drive(network, entity("left"), lane=neighbour, start=40.0, speed=40.0)
    right = drive(network, entity("right", TRUCK), lane=2 * lane - neighbour, start=130.0)
    context = entity_context(together(own, left, right), network, 0, GRID)
    time = own.time[GRID]
    np.testing.assert_allclose(context["left_distance"], np.maximum(np.abs(-60 + 10 * time) - 5.0, 0.0), atol=1e-6)
    np.testing.assert_allclose(context["right_distance"], 25.0, atol=1e-6)
    assert set(context["right_is_truck"]) == {1.0}
    assert not context["truck_right"].any()
    free = np.maximum(np.abs(-60 + 10 * time) - 5.0, 0.0)
    np.testing.assert_array_equal(context["car_left"][free <= 5.0], 1.0)
    np.testing.assert_array_equal(context["car_left"][free >= 15.0], 0.0)
    np.testing.assert_allclose(context["car_left"], np.interp(free, [5.0, 15.0], [1.0, 0.0]), atol=0.1)
    assert np.isposinf(context["lead_distance"]).all()


@pytest.mark.parametrize(("rule", "outer"), [("RHT", "right"), ("LHT", "left")])
def test_a_lane_with_nobody_in_it_is_told_from_no_lane(tmp_path: Path, rule: str, outer: str) -> None:
    network = two_roads(tmp_path, rule=rule)
    inner = {"right": "left", "left": "right"}[outer]
    for lane in (-3, 3):
        own = drive(network, entity("own"), lane=lane, start=100.0)
        context = entity_context(together(own), network, 0, GRID)
        assert np.isnan(context[f"{outer}_distance"]).all()
        assert np.isposinf(context[f"{inner}_distance"]).all()


def test_oncoming_traffic_comes_into_sight_and_is_gone_within_forty_metres(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    own = drive(network, entity("own"), lane=-1, start=100.0)
    other = drive(network, entity("other"), lane=1, start=800.0)
    context = entity_context(together(own, other), network, 0, GRID)
    apart = 200.0 - 60.0 * own.time[GRID] - 2 * 1.4
    near, distance = (apart > -5.0) & (apart < 155.0), context["oncoming_distance"]
    np.testing.assert_allclose(distance[near], np.maximum(apart[near] - 5.0, 0.0), atol=1e-6)
    np.testing.assert_array_equal(context["oncoming_distance_fades"][near], 1.0)
    assert np.isnan(distance[apart < -45.0]).all() and not context["oncoming_distance_fades"][apart < -45.0].any()


@pytest.mark.parametrize(
    "shape", [{"kind": "linear"}, {"kind": "proximity", "scale": 40.0}, {"kind": "nearness", "scale": 40.0}]
)
def test_who_responds_to_oncoming_traffic_does_not_jump(tmp_path: Path, shape: dict[str, object]) -> None:
    """Two of them at 5 m/s against 5 m/s, half a second between rows: 5 m, of distances up to 200 m in all."""
    network = two_roads(tmp_path)
    own = drive(network, entity("own"), lane=-1, start=100.0, speed=5.0, duration=60.0)
    others = [
        drive(network, entity(f"other {k}"), lane=1, start=start, speed=5.0, duration=60.0)
        for k, start in enumerate((740.0, 660.0))
    ]
    values = {**shape, "acts": "location", "column": "oncoming_distance"}
    effect = effect_from_dict({**values, "coefficients": [1.0], "errors": [0.0], "reference": [0.0]})
    assert isinstance(effect, ColumnEffect)
    grid = np.arange(0, len(own.time), 5)
    found = effect.known(entity_context(together(own, *others), network, 0, grid))[:, 0]
    assert np.abs(np.diff(found)).max() < 0.3 * np.ptp(found)
    assert found[-1] == pytest.approx(0.0), "both have passed"


def test_against_the_lanes_traffic_everything_is_seen_the_other_way_round(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    own = drive(network, entity("own"), lane=-3, start=550.0)
    others = [
        drive(network, entity("inner"), lane=-2, start=550.0),
        drive(network, entity("behind"), lane=-3, start=600.0),
        drive(network, entity("same way"), lane=-3, start=500.0),
    ]
    turned = {"heading_relative": np.full(len(own), np.pi)}
    own, others[0], others[2] = (one.having(**turned) for one in (own, others[0], others[2]))
    context = entity_context(together(own, *others), network, 0, GRID)
    assert set(context["right_distance"]) == {0.0} and set(context["lane_index"]) == {2.0}
    assert np.isnan(context["left_distance"]).all()
    np.testing.assert_allclose(context["lead_distance"], 45.0, atol=1e-6)
    assert np.isnan(context["oncoming_distance"]).all()  # it has passed
    np.testing.assert_allclose(context["curvature"], -1.0 / (RADIUS + 2.5 * LANE_WIDTH), rtol=1e-9)


def test_weather_holds_from_the_time_of_its_action_and_wind_is_relative_to_travel(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    place = Place("made", 1, "Environment")
    weather = Weather(
        wind_speed=12.0,
        wind_direction=np.pi / 2,
        precipitation_type="rain",
        precipitation_intensity=4.0,
        illuminance=900.0,
    )
    clock = TimeOfDay(datetime(2026, 1, 1, 6, 30), animation=True)
    environment = Environment("storm", place=place, time_of_day=clock, weather=weather, friction_scale_factor=0.7)
    content = Action("weather", EnvironmentAction(environment, place=place), place, is_private=False)
    action = PlayedAction(content, None, ("Init",), 4.0, 4.0)
    motion = together(drive(network, entity(), lane=-2, start=0.0), actions=(action,))
    context = entity_context(motion, network, 0, GRID)
    since = motion.entities[0].time[GRID] >= 4.0
    assert np.isnan(context["wind_speed"][~since]).all()
    assert set(context["wind_speed"][since]) == {12.0}
    np.testing.assert_allclose(context["wind_direction"][since], 90.0)  # to the left of travel along x
    assert set(context["rain"][since]) == {4.0}
    np.testing.assert_allclose(context["time_of_day"][since][0], 6.5, atol=1e-4)
    against = entity_context(
        together(drive(network, entity(), lane=2, start=650.0), actions=(action,)), network, 0, GRID
    )
    np.testing.assert_allclose(against["wind_direction"][since], 270.0)
    own = drive(network, entity(), lane=-2, start=0.0)
    turned = together(own.having(heading=np.full(len(own), np.radians(30.0))), actions=(action,))
    np.testing.assert_allclose(entity_context(turned, network, 0, GRID)["wind_direction"][since], 60.0)


def test_a_scenario_without_weather_supplies_none(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    assert "rain" not in entity_context(together(drive(network, entity())), network, 0, GRID)


def _changing(network: RoadNetwork, who: Entity, lane: int, to_left: float, start: float) -> EntityMotion:
    """A change to the next lane of travel on the left (1) or right (-1), a second and a half long, from 4 s on."""
    time = drive(network, who, lane=lane, start=start).time
    u = np.clip((time - 4.0) / 1.5, 0.0, 1.0)
    across = to_left * LANE_WIDTH * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    inward = 1 if lane < 0 else -1  # the next lane to the left of travel has an id nearer to 0
    beyond = np.abs(across) > 0.5 * LANE_WIDTH
    motion = drive(network, who, lane=lane, start=start, offset=across)
    lanes = np.where(beyond, lane + inward * int(to_left), lane).astype(np.int32)
    return motion.having(lane=lanes, offset=np.where(beyond, across - to_left * LANE_WIDTH, across))


@pytest.mark.parametrize("lane", [-2, 2])
@pytest.mark.parametrize("who", ["other", "own"])
@pytest.mark.parametrize("to_left", [1.0, -1.0])
def test_neighbours_come_and_go_as_the_lane_change_does(tmp_path: Path, lane: int, who: str, to_left: float) -> None:
    network = two_roads(tmp_path)
    still = drive(network, entity("still"), lane=lane, start=120.0)
    moving = _changing(network, entity("moving", TRUCK), lane, to_left, 100.0)
    motion = together(*((still, moving) if who == "other" else (moving, still)))
    context = entity_context(motion, network, 0, GRID)
    near = {
        side: np.exp(-np.nan_to_num(context[f"{side}_distance"], nan=np.inf) / INFLUENCE_DISTANCE)
        for side in ("lead", "left", "right")
    }
    # who goes to the left has the other on the right afterwards
    side = "left" if (to_left > 0) == (who == "other") else "right"
    other = {"left": "right", "right": "left"}[side]
    np.testing.assert_allclose(near[side][[0, -1]], [0.0, np.exp(-15.0 / INFLUENCE_DISTANCE)], atol=1e-9)
    assert not near[other].any()
    assert (np.diff(near[side]) >= -1e-12).all()
    rate = np.abs(np.diff([near["lead"], near[side]], axis=1)).max()
    assert rate < 0.35, "a lane change of 1.5 s crosses in several steps of 0.2 s"
    assert context["lane_index"][0] == pytest.approx(1.0, abs=1e-3)
    assert np.abs(np.diff(context["lane_index"])).max() < 0.1


def test_a_step_of_the_road_is_seen_over_the_way_around_it(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    context = entity_context(together(drive(network, entity(), start=380.0)), network, 0, GRID)
    curve = context["curvature"] * (RADIUS + 1.5 * LANE_WIDTH)
    middle = float(np.interp(0.5, curve, 0.2 * np.arange(len(GRID))))
    assert middle == pytest.approx(4.0, abs=0.11)
    assert np.diff(curve).max() < 0.2 / np.sqrt(2.0 * np.pi) / STEERING_DURATION * 1.01
