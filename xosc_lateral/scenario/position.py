"""Positions, routes and trajectories, which are made of one another.

Lane `offset` and road `t` are here as written: along the road's t-axis (the road network converts).
"""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.enums import ReferenceContext, RouteStrategy
from xosc_lateral.scenario.place import Place, Unsupported


@dataclass(frozen=True, slots=True)
class Orientation:
    """Heading, pitch, roll [rad]; None: not stated. `type` None: omitted (its default depends on the version)."""

    h: float | None = None
    p: float | None = None
    r: float | None = None
    type: ReferenceContext | None = None


@dataclass(frozen=True, slots=True)
class WorldPosition:
    """In world coordinates [m], [rad]; None where the file has none."""

    x: float
    y: float
    place: Place
    z: float | None = None
    h: float | None = None
    p: float | None = None
    r: float | None = None


@dataclass(frozen=True, slots=True)
class RelativeWorldPosition:
    """World axes, from an entity's reference point; without dz, on the road. [m]"""

    entity_ref: str
    dx: float
    dy: float
    place: Place
    dz: float | None = None
    orientation: Orientation | None = None


@dataclass(frozen=True, slots=True)
class RelativeObjectPosition:
    """The entity's own axes, from its reference point; without dz, on the road. [m]"""

    entity_ref: str
    dx: float
    dy: float
    place: Place
    dz: float | None = None
    orientation: Orientation | None = None


@dataclass(frozen=True, slots=True)
class RoadPosition:
    """Road coordinates. [m]"""

    road_id: str
    s: float
    t: float
    place: Place
    orientation: Orientation | None = None


@dataclass(frozen=True, slots=True)
class RelativeRoadPosition:
    """Road coordinates from an entity's. [m]"""

    entity_ref: str
    ds: float
    dt: float
    place: Place
    orientation: Orientation | None = None


@dataclass(frozen=True, slots=True)
class LanePosition:
    """Lane coordinates; `offset` along +t as the standard has it. [m]"""

    road_id: str
    lane_id: int
    s: float
    place: Place
    offset: float = 0.0
    orientation: Orientation | None = None


@dataclass(frozen=True, slots=True)
class RelativeLanePosition:
    """Lane coordinates from an entity's: `d_lane` lanes, and `ds` along the road or `ds_lane` along its lane. [m]"""

    entity_ref: str
    d_lane: int
    place: Place
    ds: float | None = None
    ds_lane: float | None = None
    offset: float = 0.0
    orientation: Orientation | None = None


@dataclass(frozen=True, slots=True)
class FromCurrentEntity:
    """On the route, where that entity is."""

    entity_ref: str


@dataclass(frozen=True, slots=True)
class FromRoadCoordinates:
    """On the route, in road coordinates. [m]"""

    path_s: float
    t: float


@dataclass(frozen=True, slots=True)
class FromLaneCoordinates:
    """On the route, in lane coordinates. [m]"""

    path_s: float
    lane_id: int
    lane_offset: float = 0.0


InRoutePosition = FromCurrentEntity | FromRoadCoordinates | FromLaneCoordinates


@dataclass(frozen=True, slots=True)
class RoutePosition:
    """On a route. `route` None: the reference is missing (an error of the file that the player names)."""

    route: Route | None
    in_route: InRoutePosition | None
    place: Place
    orientation: Orientation | None = None


@dataclass(frozen=True, slots=True)
class TrajectoryPosition:
    """On a trajectory. [m]"""

    trajectory: Trajectory
    s: float
    place: Place
    t: float = 0.0
    orientation: Orientation | None = None


@dataclass(frozen=True, slots=True)
class GeoPosition:
    """Latitude and longitude [rad] (degree attributes of 1.2 are converted), height [m]."""

    latitude: float
    longitude: float
    place: Place
    altitude: float | None = None
    orientation: Orientation | None = None


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


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A place to pass, and how to come to it."""

    position: Position
    strategy: RouteStrategy


@dataclass(frozen=True, slots=True)
class Route:
    """At least two waypoints."""

    name: str
    waypoints: tuple[Waypoint, ...]
    closed: bool
    place: Place


@dataclass(frozen=True, slots=True)
class Vertex:
    """Corner of a polyline; `time` [s] or None."""

    position: Position
    time: float | None


@dataclass(frozen=True, slots=True)
class Polyline:
    """Straight pieces between vertices."""

    vertices: tuple[Vertex, ...]


@dataclass(frozen=True, slots=True)
class Clothoid:
    """Curvature changes linearly: start [1/m], change per length [1/m2], length [m], times [s]."""

    position: Position
    curvature: float
    curvature_prime: float
    length: float
    start_time: float | None = None
    stop_time: float | None = None


@dataclass(frozen=True, slots=True)
class ClothoidSplineSegment:
    """Piece of a clothoid spline; without a position it goes on from the one before, turned by `h_offset` [rad]."""

    curvature_start: float
    curvature_end: float
    length: float
    h_offset: float = 0.0
    time_start: float | None = None
    position_start: Position | None = None


@dataclass(frozen=True, slots=True)
class ClothoidSpline:
    """Clothoid pieces one after another."""

    segments: tuple[ClothoidSplineSegment, ...]
    time_end: float | None = None


@dataclass(frozen=True, slots=True)
class ControlPoint:
    """Of a NURBS curve."""

    position: Position
    time: float | None = None
    weight: float = 1.0


@dataclass(frozen=True, slots=True)
class Nurbs:
    """Rational B-spline; `order` is degree + 1."""

    order: int
    control_points: tuple[ControlPoint, ...]
    knots: tuple[float, ...]


Shape = Polyline | Clothoid | ClothoidSpline | Nurbs | Unsupported


@dataclass(frozen=True, slots=True)
class Trajectory:
    """A named path, with or without times."""

    name: str
    shape: Shape
    closed: bool
    place: Place


@dataclass(frozen=True, slots=True)
class Timing:
    """Trajectory times to scenario time: ``time * scale + offset`` [s], absolute or from the action's start."""

    domain: ReferenceContext
    scale: float
    offset: float
