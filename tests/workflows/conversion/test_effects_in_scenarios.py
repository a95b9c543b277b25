"""An effect of a profile comes out in the scenario with its size, look-ahead and response time: closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from msgspec.structs import replace

from tests.kit.motion import RADIUS, drive, entity, together, two_roads
from tests.kit.profiles import simulated_profile
from xosc_lateral.drivers.model.effects import Acts, Effect, Factor, Form, Linear, Product
from xosc_lateral.workflows.conversion.enrich import SegmentedRun, enrich
from xosc_lateral.workflows.conversion.result import Neighbours
from xosc_lateral.world.motion.nominal import NominalMotion, PlayedAction
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.enums import VehicleCategory
from xosc_lateral.world.scenario.global_actions import Environment, EnvironmentAction, Weather
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.scenario import Action
from xosc_lateral.world.surroundings.context import STEERING_DURATION

PROFILE = Neighbours.PROFILE

SIZE, LOOK_AHEAD, RESPONSE = 0.3, 1.2, 2.0


def _effect_alone(motion: NominalMotion, network: RoadNetwork, effect: Effect) -> tuple[np.ndarray, np.ndarray]:
    """Time and what the effect adds to the first vehicle's offset: the same seed with and without it."""
    base = simulated_profile()
    name = motion.entities[0].name
    without = enrich(SegmentedRun(motion, network, neighbours=PROFILE), {name: base}, seed=4).entity(name)
    with_it = enrich(
        SegmentedRun(motion, network, neighbours=PROFILE), {name: replace(base, effects=(effect,))}, seed=4
    ).entity(name)
    assert not with_it.neutral
    (plain,), (changed,) = without.segments, with_it.segments
    return changed.time, changed.offset - plain.offset


def _risen(time: np.ndarray, begin: float) -> np.ndarray:
    """Answer of a first-order lag to a unit step at `begin`."""
    return np.where(time > begin, 1.0 - np.exp(-np.maximum(time - begin, 0.0) / RESPONSE), 0.0)


def test_a_curve_cutter_moves_to_the_inside_ahead_of_the_curve(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    curvature = 1.0 / (RADIUS + 1.5 * 3.5)
    effect = Linear(
        column="curvature",
        acts=Acts.LOCATION,
        coefficients=(SIZE / curvature,),
        errors=(0.0,),
        reference=(0.0,),
        lag_s=-LOOK_AHEAD,
        response_s=RESPONSE,
    )
    motion = together(drive(network, entity(), start=260.0, speed=30.0, duration=20.0))
    time, moved = _effect_alone(motion, network, effect)
    # the curve begins at once, and is seen over a second or two: a response to a normal distribution of beginnings
    share = np.linspace(-4.0, 4.0, 401)
    seen = np.exp(-0.5 * share**2) / np.exp(-0.5 * share**2).sum()
    risen = sum(
        part * _risen(time, 8.0 - LOOK_AHEAD + STEERING_DURATION * when) for part, when in zip(seen, share, strict=True)
    )
    expected = SIZE * risen
    np.testing.assert_allclose(moved, expected, atol=0.06 * SIZE)  # 5 Hz: the step is known to a sample


def test_who_avoids_trucks_keeps_left_while_one_is_alongside(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    effect = Linear(
        column="truck_right",
        acts=Acts.LOCATION,
        coefficients=(SIZE,),
        errors=(0.0,),
        reference=(0.0,),
        response_s=RESPONSE,
    )
    own = drive(network, entity("own"), lane=-2, start=20.0, speed=35.0, duration=12.0)
    truck = drive(network, entity("truck", VehicleCategory.TRUCK, 15.0), lane=-3, start=71.0, speed=25.0, duration=12.0)
    time, moved = _effect_alone(together(own, truck), network, effect)
    # alongside: at most 10 m of free space between boxes of 5 m and 15 m with their centres at the same height
    begin, end = (51.0 - 20.0) / 10.0, (51.0 + 20.0) / 10.0
    expected = SIZE * (_risen(time, begin) - _risen(time, end))
    np.testing.assert_allclose(moved, expected, atol=0.06 * SIZE)


def test_side_wind_of_the_scenarios_weather_pushes_to_its_own_side(tmp_path: Path) -> None:
    network = two_roads(tmp_path)
    speed = 10.0
    effect = Product(
        acts=Acts.LOCATION,
        coefficients=(SIZE / speed,),
        errors=(0.0,),
        reference=(0.0,),
        factors=(Factor(column="wind_speed"), Factor(column="wind_direction", form=Form.SINE, at=360.0)),
    )
    place = Place("made", 1, "Environment")
    blows_along_y = Environment("wind", place=place, weather=Weather(wind_speed=speed, wind_direction=np.pi / 2))
    content = Action("weather", EnvironmentAction(blows_along_y, place=place), place, is_private=False)
    weather = PlayedAction(content, None, ("Init",), 0.0, 0.0)
    for lane, start, side in ((-2, 50.0, 1.0), (2, 650.0, -1.0)):
        motion = together(drive(network, entity(), lane=lane, start=start), actions=(weather,))
        _, moved = _effect_alone(motion, network, effect)
        np.testing.assert_allclose(moved, side * SIZE, atol=1e-9)
