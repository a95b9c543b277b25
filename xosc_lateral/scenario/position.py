"""Positions. Lane `offset` and road `t` are here as written: along the road's t-axis (the road network converts)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from xosc_lateral.scenario.enums import ReferenceContext
from xosc_lateral.scenario.place import Place, Unsupported

if TYPE_CHECKING:
    from xosc_lateral.scenario.route import Route
    from xosc_lateral.scenario.trajectory import Trajectory


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
    """World axes, from an entity's reference point. [m]"""

    entity_ref: str
    dx: float
    dy: float
    place: Place
    dz: float = 0.0
    orientation: Orientation | None = None


@dataclass(frozen=True, slots=True)
class RelativeObjectPosition:
    """The entity's own axes, from its reference point. [m]"""

    entity_ref: str
    dx: float
    dy: float
    place: Place
    dz: float = 0.0
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
