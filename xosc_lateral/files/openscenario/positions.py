"""Positions, routes and trajectories: they refer to one another, so they are read in one place."""

from __future__ import annotations

import math
from typing import Any, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.files.openscenario.context import Context, Reader, declared, read_struct
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.world.scenario import position as places
from xosc_lateral.world.scenario.place import Unsupported
from xosc_lateral.world.scenario.position import Position, Route, Shape, Trajectory


def read_position(owner: XmlElement, context: Context) -> Position:
    """The position inside an element of type Position (``Position``, ``TargetPosition`` ...)."""
    position: Position = _choice(owner, "position", _POSITIONS, context)
    return mirrored(position) if context.left_handed else position


def _choice(owner: XmlElement, what: str, readers: dict[str, Reader], context: Context) -> Any:
    """The only child; one that nobody reads is unsupported."""
    content = owner.child()
    if content is None:
        owner.fail(f"contains no {what}")
    reader = readers.get(content.tag)
    return Unsupported(content.tag, content.place()) if reader is None else context.nested(content, reader)


def read_route(owner: XmlElement, context: Context) -> Route:
    """Route, given inline or from a catalog, inside `owner`."""
    return read_struct(Route, context.inline_or_entry(owner, "Route"), context)


def read_trajectory(owner: XmlElement, context: Context) -> Trajectory:
    """Trajectory, given inline, in a TrajectoryRef (1.1) or from a catalog, inside `owner`."""
    inside = context.inline_or_entry(owner.child("TrajectoryRef") or owner, "Trajectory")
    return read_struct(Trajectory, inside, context)


def _shape(owner: XmlElement, context: Context) -> Shape:
    shape: Shape = _choice(owner, "shape", _SHAPES, context)
    return mirrored_shape(shape) if context.left_handed else shape


def _relative_lane(e: XmlElement, context: Context) -> places.RelativeLanePosition:
    ds, lanes = e.optional_number("ds"), e.optional("dLane", int)
    if ds is None and e.optional_number("dsLane") is None:
        ds = _number_or_zero(e, "ds", context)
    if lanes is None:
        context.note(e, "dLane is missing: taken as 0, the same lane")
    return read_struct(places.RelativeLanePosition, e, context, d_lane=lanes or 0, ds=ds)


def _relative_road(e: XmlElement, context: Context) -> places.RelativeRoadPosition:
    ds, dt = (_number_or_zero(e, name, context) for name in ("ds", "dt"))
    return read_struct(places.RelativeRoadPosition, e, context, ds=ds, dt=dt)


def _number_or_zero(e: XmlElement, name: str, context: Context) -> float:
    """A way from the reference entity; where the file has none it is 0, which is said. [m]"""
    value = e.optional_number(name)
    if value is None:
        context.note(e, f"{name} is missing: taken as 0 m")
    return value or 0.0


def _route(e: XmlElement, context: Context) -> places.RoutePosition:
    reference, owner = e.child("RouteRef"), e.child("InRoutePosition")
    route = read_route(reference, context) if reference is not None else None
    content = owner.child() if owner is not None else None
    reader = None if content is None else _IN_ROUTE.get(content.tag)
    if content is not None and reader is None:
        context.note(content)
    place = None if content is None or reader is None else reader(content, context)
    return read_struct(places.RoutePosition, e, context, route=route, in_route=place)


_IN_ROUTE = declared(places.FromCurrentEntity, places.FromRoadCoordinates, places.FromLaneCoordinates)


def _geo(e: XmlElement, context: Context) -> places.GeoPosition:
    latitude, longitude = e.optional_number("latitude"), e.optional_number("longitude")
    if latitude is None or longitude is None:
        latitude, longitude = math.radians(e.number("latitudeDeg")), math.radians(e.number("longitudeDeg"))
    return read_struct(places.GeoPosition, e, context, latitude=latitude, longitude=longitude)


_POSITIONS: dict[str, Reader] = {
    **declared(places.WorldPosition, places.RelativeWorldPosition, places.RelativeObjectPosition),
    **declared(places.RoadPosition, places.LanePosition, places.TrajectoryPosition),
    "RelativeLanePosition": _relative_lane,
    "RelativeRoadPosition": _relative_road,
    "RoutePosition": _route,
    "GeoPosition": _geo,
}


def _nurbs(e: XmlElement, context: Context) -> places.Nurbs:
    return read_struct(places.Nurbs, e, context, knots=tuple(knot.number("value") for knot in e.children("Knot")))


_SHAPES: dict[str, Reader] = {**declared(places.Clothoid, places.Polyline, places.ClothoidSpline), "Nurbs": _nurbs}

READERS: dict[object, Reader] = {Position: read_position, Shape: _shape, Route: read_route, Trajectory: read_trajectory}


# ---- scenarios written for CARLA: y points right, and headings turn clockwise ----
# Their y points to the right, headings turn clockwise, pitch raises the nose; lane offsets and road `t` count to the
# right. Everything else here is right-handed: such positions are mirrored when read, and trajectories when written. As
# in the simulator's own reader, positions relative to an object are along the world's axes, not the object's.

S = TypeVar("S", bound=Struct)

_SIDEWAYS: dict[type[Struct], tuple[str, ...]] = {
    places.WorldPosition: ("y", "h", "p"),
    places.RelativeWorldPosition: ("dy",),
    places.RoadPosition: ("t",),
    places.TrajectoryPosition: ("t",),
    places.RelativeRoadPosition: ("dt",),
    places.RelativeLanePosition: ("offset",),
    places.Orientation: ("h", "p"),
    places.Clothoid: ("curvature", "curvature_prime"),
    places.ClothoidSplineSegment: ("curvature_start", "curvature_end", "h_offset"),
}
"""What changes its sign."""


def mirrored(position: Position) -> Position:
    """A position as written for CARLA, in right-handed coordinates; routes and trajectories in it already are."""
    if isinstance(position, Unsupported):
        return position
    if isinstance(position, places.RelativeObjectPosition):
        along = position.dx, position.dy, position.dz
        position = places.RelativeWorldPosition(
            position.entity_ref, *along, orientation=position.orientation, place=position.place
        )
    if isinstance(position, places.LanePosition) and position.lane_id < 0:
        # To the right of the lane's own direction: the road's +t for lanes that go against it.
        position = replace(position, offset=-position.offset)
    position = _negated(position)
    if isinstance(position, places.WorldPosition) or position.orientation is None:
        return position
    return replace(position, orientation=_negated(position.orientation))


def mirrored_shape(shape: Shape) -> Shape:
    """A trajectory's shape, whose positions are mirrored already: its curvatures."""
    if isinstance(shape, places.ClothoidSpline):
        return replace(shape, segments=tuple(map(_negated, shape.segments)))
    return _negated(shape)


def _negated(struct: S) -> S:
    values = {name: getattr(struct, name) for name in _SIDEWAYS.get(type(struct), ())}
    return replace(struct, **{name: None if value is None else -value for name, value in values.items()})
