"""Scenarios written for CARLA: a description that starts with "CARLA:" means the simulator's own, left-handed axes.

Their y points to the right, headings turn clockwise, pitch raises the nose; lane offsets and road `t` count to the
right. Everything else here is right-handed: such positions are mirrored when read, and trajectories when written. As in
the simulator's own reader, positions relative to an object are along the world's axes, not the object's.
"""

from __future__ import annotations

from msgspec.structs import replace

from xosc_lateral.scenario.place import Unsupported
from xosc_lateral.scenario.position import (
    Clothoid,
    ClothoidSpline,
    LanePosition,
    Orientation,
    Position,
    RelativeLanePosition,
    RelativeObjectPosition,
    RelativeRoadPosition,
    RelativeWorldPosition,
    RoadPosition,
    Shape,
    TrajectoryPosition,
    WorldPosition,
)


def mirrored(position: Position) -> Position:
    """A position as written for CARLA, in right-handed coordinates; routes and trajectories in it already are."""
    match position:
        case WorldPosition():
            return replace(position, y=-position.y, h=_negative(position.h), p=_negative(position.p))
        case RelativeObjectPosition():
            turned = _turned(position.orientation)
            x, y, z = position.dx, -position.dy, position.dz
            return RelativeWorldPosition(position.entity_ref, x, y, z, turned, place=position.place)
        case RelativeWorldPosition():
            return replace(position, dy=-position.dy, orientation=_turned(position.orientation))
        case RoadPosition() | TrajectoryPosition():
            return replace(position, t=-position.t, orientation=_turned(position.orientation))
        case RelativeRoadPosition():
            return replace(position, dt=-position.dt, orientation=_turned(position.orientation))
        case LanePosition():
            # To the right of the lane's own direction: the road's +t for lanes that go against it.
            offset = -position.offset if position.lane_id < 0 else position.offset
            return replace(position, offset=offset, orientation=_turned(position.orientation))
        case RelativeLanePosition():
            return replace(position, offset=-position.offset, orientation=_turned(position.orientation))
        case Unsupported():
            return position
        case _:
            return replace(position, orientation=_turned(position.orientation))


def mirrored_shape(shape: Shape) -> Shape:
    """A trajectory's shape, whose positions are mirrored already: its curvatures."""
    match shape:
        case Clothoid():
            return replace(shape, curvature=-shape.curvature, curvature_prime=-shape.curvature_prime)
        case ClothoidSpline():
            segments = tuple(
                replace(
                    piece,
                    curvature_start=-piece.curvature_start,
                    curvature_end=-piece.curvature_end,
                    h_offset=-piece.h_offset,
                )
                for piece in shape.segments
            )
            return replace(shape, segments=segments)
        case _:
            return shape


def _turned(orientation: Orientation | None) -> Orientation | None:
    if orientation is None:
        return None
    return replace(orientation, h=_negative(orientation.h), p=_negative(orientation.p))


def _negative(angle: float | None) -> float | None:
    return None if angle is None else -angle
