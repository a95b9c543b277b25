"""Positions in CARLA's left-handed axes: what was to the right is to the right, and twice mirrored is as before."""

from __future__ import annotations

from pathlib import Path

import pytest

from xosc_lateral.files.openscenario.positions import mirrored, mirrored_shape
from xosc_lateral.world.scenario.place import Place, Unsupported
from xosc_lateral.world.scenario.position import (
    Clothoid,
    ClothoidSpline,
    ClothoidSplineSegment,
    GeoPosition,
    LanePosition,
    Orientation,
    Polyline,
    Position,
    RelativeLanePosition,
    RelativeObjectPosition,
    RelativeRoadPosition,
    RelativeWorldPosition,
    RoadPosition,
    RoutePosition,
    Trajectory,
    TrajectoryPosition,
    Vertex,
    WorldPosition,
)

HERE = Place(str(Path("x.xosc")), 1, "X")
LINE = Polyline(tuple(Vertex(WorldPosition(x, 0.0, place=HERE), None) for x in (0.0, 9.0)))
TURN = Orientation(h=0.3, p=0.1, r=0.05)
TURNED = Orientation(h=-0.3, p=-0.1, r=0.05)

POSITIONS: list[tuple[Position, Position]] = [
    (
        WorldPosition(1.0, 2.0, z=3.0, h=0.3, p=0.1, r=0.05, place=HERE),
        WorldPosition(1.0, -2.0, z=3.0, h=-0.3, p=-0.1, r=0.05, place=HERE),
    ),
    (
        RelativeWorldPosition("A", 1.0, 2.0, 3.0, orientation=TURN, place=HERE),
        RelativeWorldPosition("A", 1.0, -2.0, 3.0, orientation=TURNED, place=HERE),
    ),
    (
        RoadPosition("r", 5.0, 2.0, orientation=TURN, place=HERE),
        RoadPosition("r", 5.0, -2.0, orientation=TURNED, place=HERE),
    ),
    (
        RelativeRoadPosition("A", 5.0, 2.0, orientation=TURN, place=HERE),
        RelativeRoadPosition("A", 5.0, -2.0, orientation=TURNED, place=HERE),
    ),
    (
        RelativeLanePosition("A", 1, ds=5.0, offset=0.4, place=HERE),
        RelativeLanePosition("A", 1, ds=5.0, offset=-0.4, place=HERE),
    ),
    (GeoPosition(48.0, 9.0, orientation=TURN, place=HERE), GeoPosition(48.0, 9.0, orientation=TURNED, place=HERE)),
    (
        RoutePosition(None, None, orientation=TURN, place=HERE),
        RoutePosition(None, None, orientation=TURNED, place=HERE),
    ),
    (
        TrajectoryPosition(Trajectory("t", LINE, False, place=HERE), 5.0, 2.0, orientation=TURN, place=HERE),
        TrajectoryPosition(Trajectory("t", LINE, False, place=HERE), 5.0, -2.0, orientation=TURNED, place=HERE),
    ),
]


@pytest.mark.parametrize(("position", "expected"), POSITIONS, ids=[type(one).__name__ for one, _ in POSITIONS])
def test_what_points_sideways_turns_its_sign_and_nothing_else_does(position: Position, expected: Position) -> None:
    assert mirrored(position) == expected
    assert mirrored(mirrored(position)) == position


@pytest.mark.parametrize(
    ("lane", "offset", "expected"), [(-1, 0.4, -0.4), (-3, -0.4, 0.4), (1, 0.4, 0.4), (2, -0.4, -0.4)]
)
def test_a_lane_offset_counts_to_the_right_of_the_lane_s_own_direction(
    lane: int, offset: float, expected: float
) -> None:
    """A lane of positive id goes against s: to the right of its direction is the road's +t already."""
    position = LanePosition("r", lane, 5.0, offset, place=HERE)
    assert mirrored(position) == LanePosition("r", lane, 5.0, expected, place=HERE)


def test_relative_to_an_object_is_along_the_world_s_axes_there() -> None:
    assert mirrored(RelativeObjectPosition("A", 1.0, 2.0, 3.0, orientation=TURN, place=HERE)) == RelativeWorldPosition(
        "A", 1.0, -2.0, 3.0, orientation=TURNED, place=HERE
    )


def test_angles_that_are_not_given_stay_so() -> None:
    assert mirrored(WorldPosition(0.0, 0.0, place=HERE)) == WorldPosition(0.0, 0.0, place=HERE)
    assert mirrored(RoadPosition("r", 0.0, 0.0, place=HERE)) == RoadPosition("r", 0.0, 0.0, place=HERE)


def test_what_is_not_known_is_left_alone() -> None:
    unknown = Unsupported("SomethingPosition", HERE, "")
    assert mirrored(unknown) is unknown


def test_curves_bend_to_the_other_side() -> None:
    there = WorldPosition(0.0, 0.0, place=HERE)
    clothoid = Clothoid(there, 0.01, 0.002, 50.0)
    assert mirrored_shape(clothoid) == Clothoid(there, -0.01, -0.002, 50.0)
    spline = ClothoidSpline((ClothoidSplineSegment(0.01, -0.02, 30.0, 0.1), ClothoidSplineSegment(0.0, 0.03, 20.0)))
    turned = ClothoidSpline((ClothoidSplineSegment(-0.01, 0.02, 30.0, -0.1), ClothoidSplineSegment(0.0, -0.03, 20.0)))
    assert mirrored_shape(spline) == turned
    assert mirrored_shape(mirrored_shape(spline)) == spline

    assert mirrored_shape(LINE) == LINE
