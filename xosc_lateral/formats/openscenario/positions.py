"""Positions, routes and trajectories: they refer to one another, so they are read in one place."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

from xosc_lateral.formats.openscenario.context import Context
from xosc_lateral.formats.openscenario.declarations import local_scope
from xosc_lateral.formats.openscenario.element import XmlElement
from xosc_lateral.formats.openscenario.left_handed import mirrored, mirrored_shape
from xosc_lateral.scenario.enums import ReferenceContext, RouteStrategy
from xosc_lateral.scenario.place import Unsupported
from xosc_lateral.scenario.position import (
    Clothoid,
    ClothoidSpline,
    ClothoidSplineSegment,
    ControlPoint,
    FromCurrentEntity,
    FromLaneCoordinates,
    FromRoadCoordinates,
    GeoPosition,
    InRoutePosition,
    LanePosition,
    Nurbs,
    Orientation,
    Polyline,
    Position,
    RelativeLanePosition,
    RelativeObjectPosition,
    RelativeRoadPosition,
    RelativeWorldPosition,
    RoadPosition,
    Route,
    RoutePosition,
    Shape,
    Trajectory,
    TrajectoryPosition,
    Vertex,
    Waypoint,
    WorldPosition,
)


def read_position(owner: XmlElement, context: Context) -> Position:
    """The position inside an element of type Position (``Position``, ``TargetPosition`` ...)."""
    content = owner.child()
    if content is None:
        owner.fail("contains no position")
    reader = _POSITIONS.get(content.tag)
    if reader is None:
        return Unsupported(content.tag, content.place())
    context.enter(content)
    position = reader(content, context)
    context.leave()
    return mirrored(position) if context.left_handed else position


def read_position_in(owner: XmlElement, context: Context) -> Position:
    """The position in the ``Position`` child of an element."""
    return read_position(owner.required("Position"), context)


def read_route(owner: XmlElement, context: Context) -> Route:
    """Route, given inline or from a catalog, inside `owner`."""
    route = _inline_or_entry(owner, "Route", context)
    waypoints = tuple(
        Waypoint(
            read_position_in(waypoint, context),
            waypoint.choice("routeStrategy", RouteStrategy, RouteStrategy.SHORTEST),
        )
        for waypoint in route.children("Waypoint")
    )
    if len(waypoints) < 2:
        route.fail(f"a route needs at least 2 waypoints, this one has {len(waypoints)}")
    return Route(route.text("name", ""), waypoints, route.boolean("closed", False), route.place())


def read_trajectory(owner: XmlElement, context: Context) -> Trajectory:
    """Trajectory, given inline, in a TrajectoryRef (1.1) or from a catalog, inside `owner`."""
    reference = owner.child("TrajectoryRef")
    trajectory = _inline_or_entry(reference or owner, "Trajectory", context)
    shape_owner = trajectory.required("Shape")
    content = shape_owner.child()
    if content is None:
        shape_owner.fail("contains no shape")
    reader = _SHAPES.get(content.tag)
    context.enter(content)
    shape = Unsupported(content.tag, content.place()) if reader is None else reader(content, context)
    context.leave()
    if context.left_handed:
        shape = mirrored_shape(shape)
    return Trajectory(trajectory.text("name", ""), shape, trajectory.boolean("closed", False), trajectory.place())


def _inline_or_entry(owner: XmlElement, tag: str, context: Context) -> XmlElement:
    """In the scope of its own parameters; in a catalog, what the reference assigns comes before what is declared."""
    inline = owner.child(tag)
    if inline is not None:
        return inline.within(local_scope(inline))
    entry = context.catalogs.entry(owner.required("CatalogReference"))
    if entry.tag != tag:
        owner.fail(f"catalog entry '{entry.raw('name')}' is a {entry.tag}, not a {tag}")
    return entry


def _orientation(owner: XmlElement) -> Orientation | None:
    element = owner.child("Orientation")
    if element is None:
        return None
    return Orientation(
        element.optional_number("h"),
        element.optional_number("p"),
        element.optional_number("r"),
        element.optional_choice("type", ReferenceContext),
    )


def _world(e: XmlElement, _: Context) -> Position:
    return WorldPosition(
        e.number("x"),
        e.number("y"),
        e.place(),
        e.optional_number("z"),
        e.optional_number("h"),
        e.optional_number("p"),
        e.optional_number("r"),
    )


def _relative_world(e: XmlElement, context: Context) -> Position:
    x, y, z = e.number("dx", 0.0), e.number("dy", 0.0), e.optional_number("dz")
    return RelativeWorldPosition(context.entity(e), x, y, e.place(), z, _orientation(e))


def _relative_object(e: XmlElement, context: Context) -> Position:
    x, y, z = e.number("dx", 0.0), e.number("dy", 0.0), e.optional_number("dz")
    return RelativeObjectPosition(context.entity(e), x, y, e.place(), z, _orientation(e))


def _road(e: XmlElement, _: Context) -> Position:
    return RoadPosition(_road_id(e), e.number("s"), e.number("t", 0.0), e.place(), _orientation(e))


def _relative_road(e: XmlElement, context: Context) -> Position:
    return RelativeRoadPosition(context.entity(e), e.number("ds"), e.number("dt"), e.place(), _orientation(e))


def _lane(e: XmlElement, _: Context) -> Position:
    return LanePosition(
        _road_id(e), e.integer("laneId"), e.number("s"), e.place(), e.number("offset", 0.0), _orientation(e)
    )


def _relative_lane(e: XmlElement, context: Context) -> Position:
    ds, ds_lane = e.optional_number("ds"), e.optional_number("dsLane")
    if ds is None and ds_lane is None:
        ds = 0.0
    lanes = e.optional_integer("dLane")
    if lanes is None:
        context.remark(e, "dLane is missing: taken as 0, the same lane")
    return RelativeLanePosition(
        context.entity(e), lanes or 0, e.place(), ds, ds_lane, e.number("offset", 0.0), _orientation(e)
    )


def _route(e: XmlElement, context: Context) -> Position:
    reference = e.child("RouteRef")
    route = read_route(reference, context) if reference is not None else None
    owner = e.child("InRoutePosition")
    content = owner.child() if owner is not None else None
    return RoutePosition(route, _in_route(content, context) if content else None, e.place(), _orientation(e))


def _in_route(e: XmlElement, context: Context) -> InRoutePosition | None:
    if e.tag == "FromCurrentEntity":
        return FromCurrentEntity(context.entity(e))
    if e.tag == "FromRoadCoordinates":
        return FromRoadCoordinates(e.number("pathS"), e.number("t", 0.0))
    if e.tag == "FromLaneCoordinates":
        return FromLaneCoordinates(e.number("pathS"), e.integer("laneId"), e.number("laneOffset", 0.0))
    context.remark(e)
    return None


def _trajectory(e: XmlElement, context: Context) -> Position:
    return TrajectoryPosition(
        read_trajectory(e, context), e.number("s"), e.place(), e.number("t", 0.0), _orientation(e)
    )


def _geo(e: XmlElement, _: Context) -> Position:
    latitude, longitude = e.optional_number("latitude"), e.optional_number("longitude")
    if latitude is None or longitude is None:
        latitude, longitude = math.radians(e.number("latitudeDeg")), math.radians(e.number("longitudeDeg"))
    altitude = e.optional_number("altitude")
    if altitude is None:
        altitude = e.optional_number("height")
    return GeoPosition(latitude, longitude, e.place(), altitude, _orientation(e))


def _road_id(e: XmlElement) -> str:
    """Road ids are text; one that came out of an expression or a number parameter gets its plain form back."""
    text = e.text("roadId")
    if text.endswith(".0000000000") and text[:-11].lstrip("-").isdigit():
        return text[:-11]
    return text


_POSITIONS: dict[str, Callable[[XmlElement, Context], Position]] = {
    "WorldPosition": _world,
    "RelativeWorldPosition": _relative_world,
    "RelativeObjectPosition": _relative_object,
    "RoadPosition": _road,
    "RelativeRoadPosition": _relative_road,
    "LanePosition": _lane,
    "RelativeLanePosition": _relative_lane,
    "RoutePosition": _route,
    "TrajectoryPosition": _trajectory,
    "GeoPosition": _geo,
}


def _polyline(e: XmlElement, context: Context) -> Shape:
    vertices = tuple(Vertex(read_position_in(v, context), v.optional_number("time")) for v in e.children("Vertex"))
    if len(vertices) < 2:
        e.fail(f"a polyline needs at least 2 vertices, this one has {len(vertices)}")
    return Polyline(vertices)


def _clothoid(e: XmlElement, context: Context) -> Shape:
    prime = e.optional_number("curvaturePrime")
    return Clothoid(
        read_position_in(e, context),
        e.number("curvature"),
        e.number("curvatureDot", 0.0) if prime is None else prime,  # the name of 1.0
        e.number("length"),
        e.optional_number("startTime"),
        e.optional_number("stopTime"),
    )


def _clothoid_spline(e: XmlElement, context: Context) -> Shape:
    segments = []
    for piece in e.children("ClothoidSplineSegment"):
        start = piece.child("PositionStart")
        segments.append(
            ClothoidSplineSegment(
                piece.number("curvatureStart"),
                piece.number("curvatureEnd"),
                piece.number("length"),
                piece.number("hOffset", 0.0),
                piece.optional_number("timeStart"),
                read_position(start, context) if start is not None else None,
            )
        )
    if not segments:
        e.fail("a clothoid spline needs a segment")
    return ClothoidSpline(tuple(segments), e.optional_number("timeEnd"))


def _nurbs(e: XmlElement, context: Context) -> Shape:
    order = e.integer("order")
    points = tuple(
        ControlPoint(read_position_in(p, context), p.optional_number("time"), p.number("weight", 1.0))
        for p in e.children("ControlPoint")
    )
    knots = tuple(knot.number("value") for knot in e.children("Knot"))
    if order < 2 or len(points) < order:
        e.fail(f"order {order} with {len(points)} control points")
    if len(knots) != len(points) + order:
        e.fail(f"{len(knots)} knots, {len(points)} control points and order {order} need {len(points) + order}")
    if any(after < before for before, after in pairwise(knots)):
        e.fail("knots decrease")
    if knots[order - 1] >= knots[len(points)]:
        e.fail("the knots span no curve")
    if any(point.weight <= 0 for point in points):
        e.fail("a weight is not positive")
    return Nurbs(order, points, knots)


_SHAPES: dict[str, Callable[[XmlElement, Context], Shape]] = {
    "Polyline": _polyline,
    "Clothoid": _clothoid,
    "ClothoidSpline": _clothoid_spline,
    "Nurbs": _nurbs,
}
