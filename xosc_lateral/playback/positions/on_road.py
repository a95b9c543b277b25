"""Places on a road from road coordinates, orientations, and places relative to an entity."""

from __future__ import annotations

from math import nan, pi

from xosc_lateral.errors import PlaybackError
from xosc_lateral.playback.drive import travel
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import NOWHERE, EntityState, Placement, RouteGuide
from xosc_lateral.road import Pose
from xosc_lateral.scenario import Place
from xosc_lateral.scenario.enums import ReferenceContext
from xosc_lateral.scenario.position import FromCurrentEntity, Orientation, Position, RoutePosition


def road_index(simulation: Simulation, road_id: str, place: Place) -> int:
    """Index of a road; raises `PlaybackError` at `place` if it is not there."""
    if road_id not in simulation.network.road_ids:
        known = ", ".join(simulation.network.road_ids[:8]) or "none"
        raise _error(f"there is no road '{road_id}' (roads: {known})", place)
    return simulation.network.index_of(road_id)


def lane_placement(
    simulation: Simulation,
    road: int,
    lane: int,
    s: float,
    offset_t: float,
    orientation: Orientation | None,
    place: Place,
    *,
    along_lane: bool = True,
) -> Placement:
    """A place on a lane. Relative headings count from the lane's direction of travel, or else from s. [m], [rad]"""
    network = simulation.network
    length = network.roads[road].length
    if not -_SLACK <= s <= length + _SLACK:
        simulation.note(f"s = {s:g} m is beyond the road's {length:g} m: taken as its end", place)
    s = min(max(s, 0.0), length)
    if not network.has_lane_at(road, lane, s):
        there = ", ".join(str(info.id) for info in network.lanes_at(road, s))
        raise _error(f"road '{network.road_ids[road]}' has no lane {lane} at s = {s:g} m (lanes: {there})", place)
    against = along_lane and network.travel_direction(road, lane) < 0
    relative = _relative(simulation, road, lane, s, orientation, against=against)
    return _tilt(Placement(road, lane, s, offset_t, relative), orientation, simulation)


def road_placement(
    simulation: Simulation, road: int, s: float, t: float, orientation: Orientation | None, place: Place
) -> Placement:
    """A place beside the reference line; relative headings count from s. [m], [rad]"""
    network = simulation.network
    length = network.roads[road].length
    if not -_SLACK <= s <= length + _SLACK:
        simulation.note(f"s = {s:g} m is beyond the road's {length:g} m: taken as its end", place)
    s = min(max(s, 0.0), length)
    found = network.lane_at(road, s, t)
    offset_t = t - network.lane_state_at(road, found.lane, s).centre_t
    relative = _relative(simulation, road, found.lane, s, orientation, against=False)
    return _tilt(Placement(road, found.lane, s, offset_t, relative), orientation, simulation)


def _tilt(place: Placement, orientation: Orientation | None, simulation: Simulation) -> Placement:
    """Pitch and roll that are given hold until the entity drives on."""
    if orientation is None or not (orientation.p or orientation.r):
        return place
    scout = EntityState(simulation.entities[0].entity, simulation.network)
    scout.put(place)
    pitch, roll = tilted(orientation, scout.pose.pitch, scout.pose.roll, simulation)
    return place._replace(pose=scout.pose._replace(pitch=pitch, roll=roll))


def _relative(
    simulation: Simulation, road: int, lane: int, s: float, orientation: Orientation | None, *, against: bool
) -> float:
    heading = heading_of(orientation)
    if not is_absolute(orientation, simulation):
        return heading + (pi if against else 0.0)
    lane_heading = simulation.network.pose_at(road, lane, s).heading
    return heading - lane_heading + (0.0 if simulation.network.travel_direction(road, lane) > 0 else pi)


_SLACK = 0.01
"""Roads are written a little shorter or longer than they are. [m]"""


def _error(what: str, place: Place) -> PlaybackError:
    return PlaybackError(what, path=place.path, line=place.line, element=place.element)


_RELATIVE_SINCE = (1, 3)
"""Version from which an orientation without a type is relative; before, it was absolute."""


def is_absolute(orientation: Orientation | None, simulation: Simulation) -> bool:
    """Whether it is meant in the world; no orientation at all is relative (along the road, like the entity)."""
    if orientation is None:
        return False
    if orientation.type is None:
        return simulation.scenario.header.version < _RELATIVE_SINCE
    return orientation.type is ReferenceContext.ABSOLUTE


def tilted(orientation: Orientation | None, pitch: float, roll: float, simulation: Simulation) -> tuple[float, float]:
    """Pitch and roll: those of the reference plus what is given, or what is given alone where it is absolute. [rad]"""
    p, r = (0.0, 0.0) if orientation is None else (orientation.p or 0.0, orientation.r or 0.0)
    return (p, r) if is_absolute(orientation, simulation) else (pitch + p, roll + r)


def tilted_or_road(orientation: Orientation | None, pose: Pose, simulation: Simulation) -> tuple[float, float]:
    """Pitch and roll beside an entity; NaN (those of the road) where none are given. [rad]"""
    if orientation is None or (orientation.p is None and orientation.r is None):
        return nan, nan
    return tilted(orientation, pose.pitch, pose.roll, simulation)


def heading_of(orientation: Orientation | None) -> float:
    """Its heading; 0 where none is given. [rad]"""
    return 0.0 if orientation is None or orientation.h is None else orientation.h


def on_road(simulation: Simulation, name: str, place: Place) -> EntityState:
    """The entity, with its road coordinates; raises `PlaybackError` if it is on no road."""
    state = simulation.entity(name, place)
    state.locate()
    if state.road == NOWHERE:
        raise PlaybackError(
            f"'{name}' is on no road, so there is no place beside it in road coordinates",
            path=place.path,
            line=place.line,
            element=place.element,
        )
    return state


def reference_of(position: Position) -> str | None:
    """Name of the entity that a position refers to; None: it is absolute."""
    if isinstance(position, RoutePosition):
        where = position.in_route
        return where.entity_ref if isinstance(where, FromCurrentEntity) else None
    name: str | None = getattr(position, "entity_ref", None)
    return name


def pose_at(place: Placement, simulation: Simulation) -> Pose:
    """World pose of a place. [m], [rad]"""
    scout = EntityState(simulation.entities[0].entity, simulation.network)
    scout.put(place)
    return scout.pose


def moved_along(state: EntityState, distance: float, way: int, route: RouteGuide | None = None) -> Placement:
    """Where an entity would be after a way along the road, on `route` or else its own; `way` +1: along s. [m]"""
    scout = EntityState(state.entity, state.network)
    scout.put(Placement(state.road, state.lane, state.s, state.offset_t, state.relative_heading))
    scout.route = route or state.route
    travel(scout, way, distance)
    return Placement(scout.road, scout.lane, scout.s, scout.offset_t, scout.relative_heading)
