"""Distances in every frame that a condition may ask for, on roads where a ruler gives them; and trailers."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, pi, sin
from pathlib import Path

import numpy as np
import pytest

from tests.kit.stage import Stage, arc, car, line, map_of, road
from xosc_lateral.world.player.distances import (
    Measure,
    RoadGap,
    Spot,
    ahead_and_left,
    apart,
    free_road_gap,
    road_gap,
    spot_of,
    straight_distance,
)
from xosc_lateral.world.player.drive import align_trailers, connect, disconnect, pull_trailers
from xosc_lateral.world.player.paths.base import Path as Curve
from xosc_lateral.world.player.paths.base import PathPoint, PathProgress
from xosc_lateral.world.player.state import EntityState, free
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.enums import CoordinateSystem, RelativeDistanceType

ENTITY, LANE, ROAD, WORLD = (
    CoordinateSystem.ENTITY,
    CoordinateSystem.LANE,
    CoordinateSystem.ROAD,
    CoordinateSystem.WORLD,
)
STRAIGHT_WAY, AHEAD, ASIDE = (
    RelativeDistanceType.EUCLIDIAN,
    RelativeDistanceType.LONGITUDINAL,
    RelativeDistanceType.LATERAL,
)
RADIUS = 100.0
TWO_ROADS = map_of(
    road("1", line(), 1000.0),
    road("2", line(y=100.0), 1000.0),
    road("3", arc(1.0 / RADIUS, y=-300.0, length=300.0), 300.0),
)


@dataclass
class World:
    network: RoadNetwork
    cars: list[EntityState]

    def put(self, index: int, lane: int, s: float, offset_t: float = 0.0, *, on: int = 0) -> EntityState:
        """Facing the way that its lane is driven."""
        state = self.cars[index]
        state.move_to(on, lane, s, offset_t)
        state.turn(0.0 if lane < 0 else pi)
        return state


@pytest.fixture
def world(tmp_path: Path) -> World:
    played = Stage(tmp_path, TWO_ROADS).play(entities=(car("Ego"), car("A"), car("B")), start={}, last=0.0)
    return World(played.network, [EntityState(one, played.network) for one in played.scenario.entities])


def distance(world: World, own: EntityState, other: EntityState, system, kind, *, freespace: bool = False):
    return Measure(system, kind, freespace).to_entity(own, other)


@pytest.mark.parametrize("freespace", [False, True])
def test_what_is_far_need_not_be_exact_and_what_may_be_near_is(world: World, freespace: bool) -> None:
    """Cars on an arc that drive, turn and are put elsewhere at random, beside the same measured each time."""
    rng, kept = np.random.default_rng(1), Measure(ROAD, AHEAD, freespace)
    own, other = world.put(0, -1, 100.0, on=2), world.put(1, -1, 180.0, on=2)
    measured = 0
    for k in range(3000):
        for car_, speed in ((own, 0.4), (other, 0.3)):
            s = (car_.s + speed * rng.uniform(0.0, 1.0)) % 300.0
            offset = float(np.clip(car_.offset_t + 0.05 * rng.standard_normal(), -1.5, 1.5))
            anew = rng.uniform() < 0.003
            car_.move_to(2, car_.lane, float(rng.uniform(0.0, 300.0)) if anew else s, offset)
            car_.turn(0.2 * np.sin(0.01 * k))
        enough = float(rng.choice([0.0, 5.0, 20.0, 60.0]))
        exact = distance(world, own, other, ROAD, AHEAD, freespace=freespace)
        gap = kept.to_entity(own, other, enough=enough)
        assert gap == exact if abs(exact) <= enough else abs(gap) > enough
        amount = abs(kept.to_entity(own, other, enough=enough, near=enough))
        assert (amount < enough, amount > enough) == (abs(exact) < enough, abs(exact) > enough)
        measured += gap == exact
    assert measured < 1500


# ---- in the entity's own frame ---------------------------------------------------------------------------------------
def test_ahead_and_left_turn_with_the_entity(world: World) -> None:
    own = world.cars[0]
    own.put_in_world(free(10.0, 5.0, pi / 2.0))
    assert ahead_and_left(own, 10.0, 8.0) == pytest.approx((3.0, 0.0))
    assert ahead_and_left(own, 6.0, 5.0) == pytest.approx((0.0, 4.0))
    assert apart(own, 13.0, 9.0) == 5.0
    assert straight_distance(own, 13.0, 9.0) == 5.0
    assert straight_distance(own, 13.0, 1.0) == -5.0  # behind


@pytest.mark.parametrize(("lane", "sign"), [(-1, 1.0), (1, -1.0)])
def test_ahead_is_positive_the_way_that_an_entity_drives(world: World, lane: int, sign: float) -> None:
    own, other = world.put(0, lane, 100.0), world.put(1, lane, 140.0)
    for system in (ENTITY, ROAD, LANE):
        assert distance(world, own, other, system, AHEAD) == pytest.approx(sign * 40.0)
        assert distance(world, other, own, system, AHEAD) == pytest.approx(-sign * 40.0)
    assert distance(world, own, other, WORLD, AHEAD) == pytest.approx(40.0)  # along x, whoever drives where


def test_aside_is_to_the_left_in_the_entity_s_frame_and_along_t_on_the_road(world: World) -> None:
    """Lanes of 3.5 m: from -2 (t = -5.25) to -1 (t = -1.75) and, driving against s, from 1 to 2."""
    own, other = world.put(0, -2, 100.0), world.put(1, -1, 100.0)
    assert distance(world, own, other, ENTITY, ASIDE) == pytest.approx(3.5)
    assert distance(world, own, other, ROAD, ASIDE) == pytest.approx(3.5)
    own, other = world.put(0, 1, 100.0), world.put(1, 2, 100.0)
    assert distance(world, own, other, ENTITY, ASIDE) == pytest.approx(-3.5)  # to its right
    assert distance(world, own, other, ROAD, ASIDE) == pytest.approx(3.5)
    assert distance(world, own, other, WORLD, ASIDE) == pytest.approx(3.5)


@dataclass
class Circle(Curve):
    """About the origin, to the left, from (radius, 0) on."""

    radius: float

    def __post_init__(self) -> None:
        super().__init__((0.0, 1.5 * pi * self.radius), (0.0, 1.0))

    def at(self, s: float) -> PathPoint:
        angle = s / self.radius
        return PathPoint(self.radius * cos(angle), self.radius * sin(angle), 0.0, 0.0, 0.0, 0.0, angle + pi / 2.0)


@pytest.mark.parametrize("radius", [20.0, 60.0])
@pytest.mark.parametrize(("angle", "inwards"), [(0.3, 2.0), (2.0, -3.0), (4.0, 0.0)])
def test_along_a_trajectory_ahead_is_its_length_and_aside_is_square_to_it(
    world: World, radius: float, angle: float, inwards: float
) -> None:
    """On a circle to the left, inside is left: what lies so far from its middle is so far aside, wherever it is."""
    own, other = world.put(0, -1, 100.0), world.cars[1]
    own.path = PathProgress(Circle(radius), 0.5 * radius)
    other.put_in_world(free((radius - inwards) * cos(angle), (radius - inwards) * sin(angle), 0.0))
    along, aside = (distance(world, own, other, CoordinateSystem.TRAJECTORY, kind) for kind in (AHEAD, ASIDE))
    assert along == pytest.approx((angle - 0.5) * radius, abs=1e-4)
    assert aside == pytest.approx(inwards, abs=1e-4)
    own.path = None
    straight = distance(world, own, other, CoordinateSystem.TRAJECTORY, ASIDE)
    assert abs(straight) == pytest.approx(hypot(own.plane.x - other.plane.x, own.plane.y - other.plane.y))


# ---- along the road --------------------------------------------------------------------------------------------------
def test_along_a_curve_metres_are_those_of_the_reference_line(world: World) -> None:
    own, other = world.put(0, -1, 20.0, on=2), world.put(1, -1, 120.0, on=2)
    assert distance(world, own, other, ROAD, AHEAD) == pytest.approx(100.0)
    chord = 2.0 * (RADIUS + 1.75) * sin(0.5)
    assert distance(world, own, other, ENTITY, STRAIGHT_WAY) == pytest.approx(chord)
    assert distance(world, own, other, ENTITY, AHEAD) == pytest.approx((RADIUS + 1.75) * sin(1.0))
    assert distance(world, own, other, ENTITY, ASIDE) == pytest.approx((RADIUS + 1.75) * (1.0 - cos(1.0)))


def test_there_is_no_way_between_roads_that_are_not_linked(world: World) -> None:
    own, other = world.put(0, -1, 100.0), world.put(1, -1, 100.0, on=1)
    assert distance(world, own, other, ROAD, AHEAD) is None
    assert distance(world, own, other, ENTITY, STRAIGHT_WAY) == pytest.approx(-100.0)  # abreast counts as behind
    assert road_gap(own, spot_of(other)) is None


def test_who_is_beside_the_road_is_seen_from_its_nearest_place(world: World) -> None:
    own, other = world.put(0, -1, 100.0), world.cars[1]
    other.put_in_world(free(150.0, -20.0, 0.0))
    assert distance(world, own, other, ROAD, AHEAD) == pytest.approx(50.0)
    assert distance(world, own, other, ROAD, ASIDE) == pytest.approx(-20.0 + 1.75)


def test_lanes_are_counted_without_the_middle_one(world: World) -> None:
    own = world.put(0, -1, 100.0)
    assert road_gap(own, spot_of(world.put(1, -2, 130.0))) == RoadGap(30.0, -3.5, -1, False)
    across = road_gap(own, spot_of(world.put(1, 1, 130.0)))
    assert across == RoadGap(30.0, 3.5, 1, True)
    far = road_gap(own, spot_of(world.put(1, 2, 70.0)))
    assert far == RoadGap(-30.0, 7.0, 2, True)


@pytest.mark.parametrize(("offset_t", "lanes"), [(0.0, 0), (-0.7, 0), (-0.8, -1)])
def test_with_free_space_lanes_are_those_of_front_right_corners(world: World, offset_t: float, lanes: int) -> None:
    """Cars of 2 m in lanes of 3.5 m: 0.75 m to the right of the middle, a corner is in the next lane."""
    own = world.put(0, -1, 100.0)
    gap = free_road_gap(own, world.put(1, -1, 130.0, offset_t))
    assert gap is not None
    assert (gap.ds, gap.lanes) == (pytest.approx(25.0), lanes)
    touching = free_road_gap(own, world.put(1, -1, 102.0, offset_t))
    assert touching == RoadGap(0.0, 0.0, 0, False)


# ---- between boxes ---------------------------------------------------------------------------------------------------
def test_free_space_is_from_bumper_to_bumper(world: World) -> None:
    """Cars of 5 m by 2 m; the middle is 1.5 m ahead of the rear axle."""
    own, other = world.put(0, -1, 100.0), world.put(1, -1, 140.0)
    for system in (ENTITY, ROAD, WORLD):
        assert distance(world, own, other, system, AHEAD, freespace=True) == pytest.approx(35.0, abs=1e-6)
        assert distance(world, other, own, system, AHEAD, freespace=True) == pytest.approx(-35.0, abs=1e-6)
    aside = world.put(1, -2, 140.0)
    assert distance(world, own, aside, ENTITY, ASIDE, freespace=True) == pytest.approx(-1.5)
    assert distance(world, own, aside, ROAD, ASIDE, freespace=True) == pytest.approx(-1.5, abs=1e-6)
    assert distance(world, own, aside, ENTITY, STRAIGHT_WAY, freespace=True) == pytest.approx(hypot(35.0, 1.5))


@pytest.mark.parametrize("system", [ENTITY, ROAD, WORLD])
@pytest.mark.parametrize("kind", [STRAIGHT_WAY, AHEAD, ASIDE])
def test_cars_that_touch_have_no_free_space(world: World, system: CoordinateSystem, kind: RelativeDistanceType) -> None:
    own, other = world.put(0, -1, 100.0), world.put(1, -1, 103.0, 1.0)
    assert distance(world, own, other, system, kind, freespace=True) == 0.0


def _point(state: EntityState) -> Spot:
    return Spot(state.pose.x, state.pose.y, state.road, state.lane, state.s, state.t)


def test_free_space_to_a_point(world: World) -> None:
    own, spot = world.put(0, -1, 100.0), _point(world.put(1, -1, 140.0))
    assert Measure(ENTITY, AHEAD, freespace=True).to_spot(own, spot) == pytest.approx(36.0)
    assert Measure(ROAD, AHEAD, freespace=True).to_spot(own, spot) == pytest.approx(36.0, abs=1e-6)
    inside = _point(world.put(1, -1, 101.0))
    assert Measure(ENTITY, STRAIGHT_WAY, freespace=True).to_spot(own, inside) == 0.0


# ---- trailers --------------------------------------------------------------------------------------------------------
def test_a_trailer_stands_straight_behind_its_tractor(world: World) -> None:
    tow, trailer = world.cars[:2]
    tow.put_in_world(free(10.0, 20.0, pi / 2.0))
    tow.set_speed(7.0)
    connect(tow, trailer)
    align_trailers(tow)
    assert trailer.plane.heading == pytest.approx(pi / 2.0)
    assert trailer.plane.x == pytest.approx(10.0)
    assert trailer.plane.y < 20.0
    assert trailer.speed == 7.0


def test_a_trailer_that_is_pulled_round_keeps_its_drawbar_s_length(world: World) -> None:
    tow, trailer = world.cars[:2]
    tow.put_in_world(free(0.0, 0.0, 0.0))
    connect(tow, trailer)
    align_trailers(tow)

    def drawbar() -> float:
        return hypot(trailer.plane.x - tow.plane.x, trailer.plane.y - tow.plane.y)

    straight = drawbar()
    angle, away = 0.0, 0.0
    for _ in range(2000):
        angle += 0.1 / 30.0
        tow.put_in_world(free(30.0 * sin(angle), 30.0 * (1.0 - cos(angle)), angle))
        pull_trailers([tow])
        away = max(away, drawbar())
    assert away <= straight + 1e-9  # the hitch is behind the axle: folded, reference points come nearer
    # a steady circle: the trailer turns as fast as its tractor, its heading behind by a constant angle
    lag = (tow.plane.heading - trailer.plane.heading) % (2.0 * pi)
    assert 0.0 < lag < 0.5


def test_a_trailer_is_let_go_of_by_whoever_had_it(world: World) -> None:
    first, second, trailer = world.cars
    connect(first, trailer)
    connect(second, trailer)
    assert first.trailer is None
    assert (second.trailer, trailer.tow) == (trailer, second)
    disconnect(second)
    assert second.trailer is None
    assert trailer.tow is None
    disconnect(second)  # nothing there: nothing happens
