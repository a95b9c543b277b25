"""Places on a road from road coordinates, orientations, and places relative to an entity."""

from __future__ import annotations

from math import nan, pi

from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.world.player.drive import travel
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import NO_ROAD, EntityState, Placement, RouteGuide, world_pose
from xosc_lateral.world.road.positions import Pose
from xosc_lateral.world.scenario.enums import ReferenceContext
from xosc_lateral.world.scenario.position import (
    FromCurrentEntity,
    LanePosition,
    Orientation,
    Position,
    RelativeLanePosition,
    RelativeRoadPosition,
    RoadPosition,
    RoutePosition,
)

OnRoad = LanePosition | RelativeLanePosition | RoadPosition | RelativeRoadPosition | RoutePosition

_SLACK = 0.01
"""Roads are written a little shorter or longer than they are. [m]"""

_RELATIVE_SINCE = (1, 3)
"""Version from which an orientation without a type is relative; before, it was absolute."""


def road_index(position: LanePosition | RoadPosition, simulation: Simulation) -> int:
    """Index of its road; raises `PlaybackError` if that is not there."""
    ids = simulation.network.road_ids
    if position.road_id not in ids:
        known = ", ".join(ids[:8]) or "none"
        raise position.place.error(f"there is no road '{position.road_id}' (roads: {known})", PlaybackError)
    return simulation.network.index_of(position.road_id)


def lane_placement(
    position: OnRoad,
    simulation: Simulation,
    road: int,
    lane: int,
    s: float,
    offset_t: float,
    *,
    along_lane: bool = True,
) -> Placement:
    """A place on a lane. Relative headings count from the lane's direction of travel, or else from s. [m], [rad]"""
    network = simulation.network
    s = _on(position, simulation, road, s)
    if not network.has_lane_at(road, lane, s):
        there = ", ".join(str(info.id) for info in network.lanes_at(road, s))
        what = f"road '{network.road_ids[road]}' has no lane {lane} at s = {s:g} m (lanes: {there})"
        raise position.place.error(what, PlaybackError)
    against = along_lane and network.travel_direction(road, lane) < 0
    return _placement(position, simulation, road, lane, s, offset_t, against=against)


def road_placement(position: OnRoad, simulation: Simulation, road: int, s: float, t: float) -> Placement:
    """A place beside the reference line; relative headings count from s. [m], [rad]"""
    network = simulation.network
    s = _on(position, simulation, road, s)
    lane = network.lane_at(road, s, t).lane
    offset_t = t - network.lane_state_at(road, lane, s).centre_t
    return _placement(position, simulation, road, lane, s, offset_t, against=False)


def _on(position: OnRoad, simulation: Simulation, road: int, s: float) -> float:
    """s on the road. [m]"""
    length = simulation.network.roads[road].length
    if not -_SLACK <= s <= length + _SLACK:
        simulation.note(f"s = {s:g} m is beyond the road's {length:g} m: taken as its end", position.place)
    return min(max(s, 0.0), length)


def _placement(
    position: OnRoad, simulation: Simulation, road: int, lane: int, s: float, offset_t: float, *, against: bool
) -> Placement:
    """With the orientation; pitch and roll that are given hold until the entity drives on."""
    network, orientation = simulation.network, position.orientation
    heading = headed(orientation, pi if against else 0.0, simulation)
    if _is_absolute(orientation, simulation):
        heading -= network.pose_at(road, lane, s).heading
        heading += 0.0 if network.travel_direction(road, lane) > 0 else pi
    place = Placement(road, lane, s, offset_t, heading)
    if orientation is None or not (orientation.p or orientation.r):
        return place
    pose = world_pose(network, place)
    pitch, roll = _tilted(orientation, pose, simulation)
    return place._replace(pose=pose._replace(pitch=pitch, roll=roll))


# ---- orientations ----------------------------------------------------------------------------------------------------
def headed(orientation: Orientation | None, heading: float, simulation: Simulation) -> float:
    """That of the reference plus what is given, or what is given alone where it is absolute. [rad]"""
    turn = 0.0 if orientation is None or orientation.h is None else orientation.h
    return turn if _is_absolute(orientation, simulation) else turn + heading


def tilted_or_road(orientation: Orientation | None, pose: Pose, simulation: Simulation) -> tuple[float, float]:
    """Pitch and roll beside an entity; NaN (those of the road) where none are given. [rad]"""
    if orientation is None or (orientation.p is None and orientation.r is None):
        return nan, nan
    return _tilted(orientation, pose, simulation)


def _tilted(orientation: Orientation, pose: Pose, simulation: Simulation) -> tuple[float, float]:
    """Pitch and roll, as `headed`. [rad]"""
    p, r = orientation.p or 0.0, orientation.r or 0.0
    return (p, r) if _is_absolute(orientation, simulation) else (pose.pitch + p, pose.roll + r)


def _is_absolute(orientation: Orientation | None, simulation: Simulation) -> bool:
    """Whether it is meant in the world; no orientation at all is relative (along the road, like the entity)."""
    if orientation is None:
        return False
    if orientation.type is None:
        return simulation.scenario.header.version < _RELATIVE_SINCE
    return orientation.type is ReferenceContext.ABSOLUTE


# ---- beside an entity ------------------------------------------------------------------------------------------------
def on_road(position: RelativeLanePosition | RelativeRoadPosition, simulation: Simulation) -> EntityState:
    """The entity that it refers to, with its road coordinates; raises `PlaybackError` if it is on no road."""
    state = simulation.entity(position.entity_ref, position.place)
    state.locate()
    if state.road == NO_ROAD:
        what = f"'{state.name}' is on no road, so there is no place beside it in road coordinates"
        raise position.place.error(what, PlaybackError)
    return state


def reference_of(position: Position) -> str | None:
    """Name of the entity that a position refers to; None: it is absolute."""
    if isinstance(position, RoutePosition):
        where = position.in_route
        return where.entity_ref if isinstance(where, FromCurrentEntity) else None
    name: str | None = getattr(position, "entity_ref", None)
    return name


def moved_along(state: EntityState, distance: float, way: int, route: RouteGuide | None = None) -> Placement:
    """Where an entity would be after a way along the road, on `route` or else its own; `way` +1: along s. [m]"""
    scout = EntityState(state.entity, state.network, route=route or state.route)
    scout.put(state.place._replace(pose=None))
    travel(scout, way, distance)
    return scout.place
