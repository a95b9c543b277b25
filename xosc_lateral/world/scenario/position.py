"""Positions, routes and trajectories, which are made of one another.

Lane `offset` and road `t` are here as written: along the road's t-axis (the road network converts).
"""

from __future__ import annotations

from typing import Annotated

from msgspec import Struct

from xosc_lateral.world.scenario.enums import ReferenceContext, RouteStrategy
from xosc_lateral.world.scenario.place import Content, EntityRef, Name, No, RoadId, Unsupported, Xml, Zero, called


class Orientation(Struct, frozen=True):
    """Heading, pitch, roll [rad]; None: not stated. `type` None: omitted (its default depends on the version)."""

    h: float | None = None
    p: float | None = None
    r: float | None = None
    type: ReferenceContext | None = None


class Oriented(Content, frozen=True, kw_only=True):
    """A place with an orientation; None: as the road, or the entity, there."""

    orientation: Orientation | None = None


class WorldPosition(Content, frozen=True):
    """In world coordinates [m], [rad]; None where the file has none."""

    x: float
    y: float
    z: float | None = None
    h: float | None = None
    p: float | None = None
    r: float | None = None


class FromEntity(Oriented, frozen=True):
    """From an entity's reference point; without dz, on the road. [m]"""

    entity_ref: EntityRef
    dx: Zero
    dy: Zero
    dz: float | None = None


class RelativeWorldPosition(FromEntity, frozen=True):
    """Along the world's axes."""


class RelativeObjectPosition(FromEntity, frozen=True):
    """Along the entity's own axes."""


class RoadPosition(Oriented, frozen=True):
    """Road coordinates. [m]"""

    road_id: RoadId
    s: float
    t: Zero


class RelativeRoadPosition(Oriented, frozen=True):
    """Road coordinates from an entity's. [m]"""

    entity_ref: EntityRef
    ds: float
    dt: float


class LanePosition(Oriented, frozen=True):
    """Lane coordinates; `offset` along +t as the standard has it. [m]"""

    road_id: RoadId
    lane_id: int
    s: float
    offset: float = 0.0


class RelativeLanePosition(Oriented, frozen=True):
    """Lane coordinates from an entity's: `d_lane` lanes, and `ds` along the road or `ds_lane` along its lane. [m]"""

    entity_ref: EntityRef
    d_lane: int
    ds: float | None = None
    ds_lane: float | None = None
    offset: float = 0.0


class FromCurrentEntity(Struct, frozen=True):
    """On the route, where that entity is."""

    entity_ref: EntityRef


class FromRoadCoordinates(Struct, frozen=True):
    """On the route, in road coordinates. [m]"""

    path_s: float
    t: Zero


class FromLaneCoordinates(Struct, frozen=True):
    """On the route, in lane coordinates. [m]"""

    path_s: float
    lane_id: int
    lane_offset: float = 0.0


InRoutePosition = FromCurrentEntity | FromRoadCoordinates | FromLaneCoordinates


class RoutePosition(Oriented, frozen=True):
    """On a route. `route` None: the reference is missing (an error of the file that the player names)."""

    route: Route | None
    in_route: InRoutePosition | None


class TrajectoryPosition(Oriented, frozen=True):
    """On a trajectory. [m]"""

    trajectory: Annotated[Trajectory, called("")]
    s: float
    t: float = 0.0


class GeoPosition(Oriented, frozen=True):
    """Latitude and longitude [rad] (degree attributes of 1.2 are converted), height [m]."""

    latitude: float
    longitude: float
    altitude: Annotated[float | None, called("altitude", "height")] = None


Position = (
    WorldPosition
    | RelativeWorldPosition
    | RelativeObjectPosition
    | RoadPosition
    | RelativeRoadPosition
    | LanePosition
    | RelativeLanePosition
    | RoutePosition
    | TrajectoryPosition
    | GeoPosition
    | Unsupported
)


def reference_of(position: Position) -> str | None:
    """Name of the entity that a position refers to; None: it is absolute."""
    if isinstance(position, RoutePosition):
        where = position.in_route
        return where.entity_ref if isinstance(where, FromCurrentEntity) else None
    name: str | None = getattr(position, "entity_ref", None)
    return name


class Waypoint(Struct, frozen=True):
    """A place to pass, and how to come to it."""

    position: Position
    strategy: Annotated[RouteStrategy, called("routeStrategy", default=RouteStrategy.SHORTEST)]


class Route(Content, frozen=True):
    """At least two waypoints."""

    name: Name
    waypoints: tuple[Waypoint, ...]
    closed: No

    def __post_init__(self) -> None:
        if len(self.waypoints) < 2:
            raise ValueError(f"a route needs at least 2 waypoints, this one has {len(self.waypoints)}")


class Vertex(Struct, frozen=True):
    """Corner of a polyline; `time` [s] or None."""

    position: Position
    time: float | None


class Polyline(Struct, frozen=True):
    """Straight pieces between vertices."""

    vertices: tuple[Vertex, ...]

    def __post_init__(self) -> None:
        if len(self.vertices) < 2:
            raise ValueError(f"a polyline needs at least 2 vertices, this one has {len(self.vertices)}")


class Clothoid(Struct, frozen=True):
    """Curvature changes linearly: start [1/m], change per length [1/m2], length [m], times [s]."""

    position: Position
    curvature: float
    curvature_prime: Annotated[float, called("curvaturePrime", "curvatureDot", default=0.0)]  # the name of 1.0
    length: float
    start_time: float | None = None
    stop_time: float | None = None


class ClothoidSplineSegment(Struct, frozen=True):
    """Piece of a clothoid spline; without a position it goes on from the one before, turned by `h_offset` [rad]."""

    curvature_start: float
    curvature_end: float
    length: float
    h_offset: float = 0.0
    time_start: float | None = None
    position_start: Annotated[Position | None, called("PositionStart")] = None


class ClothoidSpline(Struct, frozen=True):
    """Clothoid pieces one after another."""

    segments: tuple[ClothoidSplineSegment, ...]
    time_end: float | None = None

    def __post_init__(self) -> None:
        if not self.segments:
            raise ValueError("a clothoid spline needs a segment")


class ControlPoint(Struct, frozen=True):
    """Of a NURBS curve."""

    position: Position
    time: float | None = None
    weight: float = 1.0


class Nurbs(Struct, frozen=True):
    """Rational B-spline; `order` is degree + 1."""

    order: int
    control_points: tuple[ControlPoint, ...]
    knots: tuple[float, ...]

    def __post_init__(self) -> None:
        order, count, knots = self.order, len(self.control_points), list(self.knots)
        if order < 2 or count < order:
            raise ValueError(f"order {order} with {count} control points")
        if len(knots) != count + order:
            raise ValueError(f"{len(knots)} knots, {count} control points and order {order} need {count + order}")
        if knots != sorted(knots):
            raise ValueError("knots decrease")
        if knots[order - 1] >= knots[count]:
            raise ValueError("the knots span no curve")
        if any(point.weight <= 0 for point in self.control_points):
            raise ValueError("a weight is not positive")


Shape = Polyline | Clothoid | ClothoidSpline | Nurbs | Unsupported


class Trajectory(Content, frozen=True):
    """A named path, with or without times."""

    name: Name
    shape: Shape
    closed: No


class Timing(Struct, frozen=True):
    """Trajectory times to scenario time: ``time * scale + offset`` [s], absolute or from the action's start."""

    domain: Annotated[ReferenceContext, called("domainAbsoluteRelative", default=ReferenceContext.ABSOLUTE)]
    scale: Annotated[float, Xml(default=1.0)]
    offset: Zero
