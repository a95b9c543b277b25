"""Scenarios written for CARLA: a description that starts with "CARLA:" means the simulator's own, left-handed axes.

Their y points to the right, headings turn clockwise, pitch raises the nose; lane offsets and road `t` count to the
right. Everything else here is right-handed: such positions are mirrored when read, and trajectories when written. As in
the simulator's own reader, positions relative to an object are along the world's axes, not the object's.
"""

from __future__ import annotations

from typing import TypeVar

from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.world.scenario.place import Unsupported
from xosc_lateral.world.scenario.position import (
    Clothoid,
    ClothoidSpline,
    ClothoidSplineSegment,
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

S = TypeVar("S", bound=Struct)

_SIDEWAYS: dict[type[Struct], tuple[str, ...]] = {
    WorldPosition: ("y", "h", "p"),
    RelativeWorldPosition: ("dy",),
    RoadPosition: ("t",),
    TrajectoryPosition: ("t",),
    RelativeRoadPosition: ("dt",),
    RelativeLanePosition: ("offset",),
    Orientation: ("h", "p"),
    Clothoid: ("curvature", "curvature_prime"),
    ClothoidSplineSegment: ("curvature_start", "curvature_end", "h_offset"),
}
"""What changes its sign."""


def mirrored(position: Position) -> Position:
    """A position as written for CARLA, in right-handed coordinates; routes and trajectories in it already are."""
    if isinstance(position, Unsupported):
        return position
    if isinstance(position, RelativeObjectPosition):
        along = position.dx, position.dy, position.dz
        position = RelativeWorldPosition(position.entity_ref, *along, position.orientation, place=position.place)
    if isinstance(position, LanePosition) and position.lane_id < 0:
        # To the right of the lane's own direction: the road's +t for lanes that go against it.
        position = replace(position, offset=-position.offset)
    position = _negated(position)
    if isinstance(position, WorldPosition) or position.orientation is None:
        return position
    return replace(position, orientation=_negated(position.orientation))


def mirrored_shape(shape: Shape) -> Shape:
    """A trajectory's shape, whose positions are mirrored already: its curvatures."""
    if isinstance(shape, ClothoidSpline):
        return replace(shape, segments=tuple(map(_negated, shape.segments)))
    return _negated(shape)


def _negated(struct: S) -> S:
    values = {name: getattr(struct, name) for name in _SIDEWAYS.get(type(struct), ())}
    return replace(struct, **{name: None if value is None else -value for name, value in values.items()})
