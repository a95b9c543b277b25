"""All positions that can be played: what the file says -> a place in the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import groupby
from math import cos, nan, pi, sin
from typing import Any

import numpy as np

from xosc_lateral.base.errors import PlaybackError, UnsupportedElementError
from xosc_lateral.world.player.distances import Spot
from xosc_lateral.world.player.drive import travel
from xosc_lateral.world.player.paths.registry import path_of
from xosc_lateral.world.player.positions.geo import ProjectionError, project
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import NO_ROAD, EntityState, Placement, RouteGuide, free, guide, locate, world_pose
from xosc_lateral.world.road.lanes import beside
from xosc_lateral.world.road.positions import Pose, is_forward
from xosc_lateral.world.scenario import position as positions
from xosc_lateral.world.scenario.enums import ReferenceContext
from xosc_lateral.world.scenario.place import Unsupported

RelativeOnRoad = positions.RelativeLanePosition | positions.RelativeRoadPosition
OnRoad = positions.LanePosition | positions.RoadPosition | RelativeOnRoad | positions.RoutePosition

_LENGTH_TOLERANCE = 0.01
"""Roads are written a little shorter or longer than they are. [m]"""

_RELATIVE_SINCE = (1, 3)
"""Version from which an orientation without a type is relative; before, it was absolute."""

_FIXED_POSITIONS = (positions.GeoPosition, positions.LanePosition, positions.RoadPosition, positions.WorldPosition)
"""Positions that no entity has an influence on."""


def resolve(position: positions.Position, simulation: Simulation, *, route: RouteGuide | None = None) -> Placement:
    """The place that a position means now; raises `PlaybackError` where there is no such place.

    `route` is that of the entity which is to go there: a way along the road from another entity follows it, or else the
    route of that other one.
    """
    if isinstance(position, Unsupported):
        raise position.place.error(position.reason or f"{position.kind} can't be played", UnsupportedElementError)
    if isinstance(position, RelativeOnRoad):
        return POSITIONS[type(position)](position, simulation, route)
    return POSITIONS[type(position)](position, simulation)


def spot_at(position: positions.Position, simulation: Simulation) -> Callable[[], Spot]:
    """A position to measure distances to, found anew each time only if it may move."""
    if isinstance(position, _FIXED_POSITIONS):
        fixed = _spot(resolve(position, simulation), simulation)
        return lambda: fixed
    return lambda: _spot(resolve(position, simulation), simulation)


def pose_of(position: positions.Position, simulation: Simulation) -> Pose:
    """World pose of a position now. z, pitch and roll are the road's where none are given. [m], [rad]"""
    if isinstance(position, positions.WorldPosition) and None not in (position.z, position.p, position.r):
        return _world_pose(position)  # nothing of it is the road's, which need not be looked for
    return world_pose(simulation.network, resolve(position, simulation))


def poses_of(places: Sequence[positions.Position], simulation: Simulation) -> list[Pose]:
    """World poses of many positions now; those in turn beside one entity are found on one way along the road."""
    poses = list[Pose]()
    for name, some in groupby(places, _follows):
        group = list(some)
        poses += _poses_beside(group, simulation) if name else [pose_of(place, simulation) for place in group]
    return poses


def _follows(place: positions.Position) -> str | None:
    """The entity beside whose way along the road a position is, turned as the road is."""
    return place.entity_ref if isinstance(place, positions.RelativeRoadPosition) and place.orientation is None else None


def _poses_beside(places: Sequence[Any], simulation: Simulation) -> list[Pose]:
    """As `relative_road_position` has each."""
    scout = _scout(entity_on_road(places[0], simulation))
    way, driven, rows = 1, 0.0, list[tuple[int, float, float]]()
    for place in places:
        before = scout.is_forward
        travel(scout, way, place.ds - driven)
        driven, way = place.ds, way if scout.is_forward is before else -way
        rows.append((scout.road, scout.s, scout.t + place.dt))
    road, s, t = (np.array(column) for column in zip(*rows, strict=True))
    poses = simulation.network.road_to_world(road, s, t)
    columns = (poses.x, poses.y, poses.z, poses.heading, poses.pitch, poses.roll)
    return [Pose(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]


def route_guide(route_: positions.Route, simulation: Simulation) -> RouteGuide | None:
    """The way over a route's waypoints; None: no way leads along it."""
    return guide(simulation.network, [resolve(waypoint.position, simulation) for waypoint in route_.waypoints])


def _spot(place: Placement, simulation: Simulation) -> Spot:
    network = simulation.network
    pose = world_pose(network, place)
    if place.road == NO_ROAD:
        return Spot(pose.x, pose.y)
    t = network.lane_state_at(place.road, place.lane, place.s).centre_t + place.offset_t
    return Spot(pose.x, pose.y, place.road, place.lane, place.s, t)


def lane_position(position: positions.LanePosition, simulation: Simulation) -> Placement:
    """Without an orientation, in the lane's direction of travel."""
    road, lane = road_index(position, simulation), position.lane_id
    return lane_placement(position, simulation, road, lane, position.s, position.offset)


def road_position(position: positions.RoadPosition, simulation: Simulation) -> Placement:
    """Without an orientation, along s."""
    return road_placement(position, simulation, road_index(position, simulation), position.s, position.t)


def _world_pose(position: positions.WorldPosition) -> Pose:
    """Heading 0 where none is given; z, pitch and roll, where none are given, are NaN: the road's."""
    return free(
        position.x,
        position.y,
        position.h or 0.0,
        nan if position.z is None else position.z,
        nan if position.p is None else position.p,
        nan if position.r is None else position.r,
    )


def world_position(position: positions.WorldPosition, simulation: Simulation) -> Placement:
    """Under the pose."""
    return locate(simulation.network, _world_pose(position))


def relative_lane_position(
    position: positions.RelativeLanePosition, simulation: Simulation, route: RouteGuide | None
) -> Placement:
    """`ds` goes along s of the reference's road and counts lanes and offset along its +t; `dsLane` goes along the
    direction of travel of the lane and counts them to the left of it.
    """
    state = entity_on_road(position, simulation)
    network = simulation.network
    along_lane = position.ds_lane is not None
    if position.ds_lane is None:
        there = moved_along(state, position.ds or 0.0, 1, route)
        # Beyond a joint with a road whose s runs the other way, the reference's own count of lanes goes on.
        along_lane = is_forward(there.relative_heading) is not state.is_forward
        side = -1 if along_lane else 1
    else:
        there = moved_along(state, position.ds_lane, network.travel_direction(state.road, state.lane), route)
        side = network.travel_direction(there.road, there.lane)
    lane = beside(there.lane, side * position.d_lane)
    if simulation.scenario.header.is_left_handed:  # the offset counts from the lane's direction, with `ds` too
        offset = position.offset * network.travel_direction(there.road, lane)
    else:
        offset = position.offset * side
    return lane_placement(position, simulation, there.road, lane, there.s, offset, along_lane=along_lane)


def relative_road_position(
    position: positions.RelativeRoadPosition, simulation: Simulation, route: RouteGuide | None
) -> Placement:
    """`ds` and `dt` along the road's axes; the way goes on over linked roads."""
    there = moved_along(entity_on_road(position, simulation), position.ds, 1, route)
    t = simulation.network.lane_state_at(there.road, there.lane, there.s).centre_t + there.offset_t
    return road_placement(position, simulation, there.road, there.s, t + position.dt)


def relative_object_position(position: positions.RelativeObjectPosition, simulation: Simulation) -> Placement:
    """Along the entity's own axes; its pitch and roll tilt the way there."""
    pose = simulation.entity(position.entity_ref, position.place).pose
    c, s = cos(pose.heading), sin(pose.heading)
    ahead, left, up = position.dx, position.dy, position.dz or 0.0
    flat_ahead = ahead * cos(pose.pitch) + (left * sin(pose.roll) + up * cos(pose.roll)) * sin(pose.pitch)
    flat_left = left * cos(pose.roll) - up * sin(pose.roll)
    rise = (left * sin(pose.roll) + up * cos(pose.roll)) * cos(pose.pitch) - ahead * sin(pose.pitch)
    x = pose.x + flat_ahead * c - flat_left * s
    y = pose.y + flat_ahead * s + flat_left * c
    return _nearby_place(position, simulation, pose, x, y, pose.z + rise)


def relative_world_position(position: positions.RelativeWorldPosition, simulation: Simulation) -> Placement:
    """Along the world's axes."""
    pose = simulation.entity(position.entity_ref, position.place).pose
    dx, dy = simulation.network.header_offset.turned_back(position.dx, position.dy)
    return _nearby_place(position, simulation, pose, pose.x + dx, pose.y + dy, pose.z + (position.dz or 0.0))


def _nearby_place(
    position: positions.RelativeObjectPosition | positions.RelativeWorldPosition,
    simulation: Simulation,
    pose: Pose,
    x: float,
    y: float,
    z: float,
) -> Placement:
    """There, at that height if the file gives one; relative angles count from the entity's pose."""
    heading = headed(position.orientation, pose.heading, simulation)
    tilt = _tilted(position.orientation, pose, simulation)
    return locate(simulation.network, free(x, y, heading, nan if position.dz is None else z, *tilt))


def trajectory_position(position: positions.TrajectoryPosition, simulation: Simulation) -> Placement:
    """Relative headings count from the trajectory's."""
    point = path_of(position.trajectory, simulation, poses_of).at(position.s)
    heading = headed(position.orientation, point.heading, simulation)
    x = point.x - position.t * sin(point.heading)
    y = point.y + position.t * cos(point.heading)
    return locate(simulation.network, free(x, y, heading, point.z))


def route_position(position: positions.RoutePosition, simulation: Simulation) -> Placement:
    """The way along the route counts from its first waypoint; an entity on it is where it is."""
    network, where = simulation.network, position.in_route
    if position.route is None or where is None:
        raise position.place.error("names no route or no place on it", PlaybackError)
    if isinstance(where, positions.FromCurrentEntity):
        state = simulation.entity(where.entity_ref, position.place)
        state.locate()
        return state.place._replace(pose=state.pose if state.road == NO_ROAD else None)
    route = route_guide(position.route, simulation)
    if route is None:
        raise position.place.error(f"no way leads along route '{position.route.name}'", PlaybackError)
    road, s, direction = route.at(where.path_s)
    if not -_LENGTH_TOLERANCE <= where.path_s <= route.length + _LENGTH_TOLERANCE:
        there = f"taken as its {'start' if where.path_s < 0.0 else 'end'}, road '{network.road_ids[road]}', s = {s:g} m"
        what = f"pathS = {where.path_s:g} m is not on the route, which is {route.length:.1f} m long: {there}"
        simulation.note(what, position.place, is_doubt=True)
    if direction < 0:
        simulation.note(
            "the route runs against s here: lanes, offset and heading count along it "
            "(in esmini only with --align_routepositions)",
            position.place,
        )
    if isinstance(where, positions.FromLaneCoordinates):
        turned = _is_turned(simulation, road, where.lane_id, direction)
        lane, offset = (-where.lane_id, -where.lane_offset) if turned else (where.lane_id, where.lane_offset)
        return lane_placement(position, simulation, road, lane, s, offset)
    t = -where.t if _is_turned(simulation, road, network.lane_at(road, s, where.t).lane, direction) else where.t
    place = road_placement(position, simulation, road, s, t)
    if position.orientation is not None or direction > 0:
        return place
    return place._replace(relative_heading=place.relative_heading + pi)  # along the route


def _is_turned(simulation: Simulation, road: int, lane: int, direction: int) -> bool:
    """Where the route runs against s, a lane that is driven against the route was counted from it: its twin is meant.

    Files do both: ids as the road has them, and ids as if each road ran along the route. Along s these are the same.
    """
    network = simulation.network
    if direction > 0 or lane == 0 or network.travel_direction(road, lane) == direction:
        return False
    return any(-lane in section.by_id for section in network.roads[road].sections)


def geo_position(position: positions.GeoPosition, simulation: Simulation) -> Placement:
    """Needs the road network's geoReference."""
    try:
        x, y = project(simulation.network.geo_reference, position.latitude, position.longitude)
    except ProjectionError as error:
        raise position.place.error(str(error), PlaybackError) from error
    offset = simulation.network.header_offset
    x, y = offset.undo(x, y)
    z = nan if position.altitude is None else position.altitude - offset.z
    return locate(simulation.network, free(x, y, headed(position.orientation, 0.0, simulation) - offset.heading, z))


# ---- from road coordinates, orientations, and beside an entity ----


def road_index(position: positions.LanePosition | positions.RoadPosition, simulation: Simulation) -> int:
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
    if not -_LENGTH_TOLERANCE <= s <= length + _LENGTH_TOLERANCE:
        simulation.note(
            f"s = {s:g} m is beyond the road's {length:g} m: taken as its end", position.place, is_doubt=True
        )
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
def headed(orientation: positions.Orientation | None, heading: float, simulation: Simulation) -> float:
    """That of the reference plus what is given, or what is given alone where it is absolute. [rad]"""
    turn = 0.0 if orientation is None or orientation.h is None else orientation.h
    return turn if _is_absolute(orientation, simulation) else turn + heading


def _tilted(orientation: positions.Orientation | None, pose: Pose, simulation: Simulation) -> tuple[float, float]:
    """Pitch and roll, as `headed`; NaN (those of the road) where none are given. [rad]"""
    if orientation is None or (orientation.p is None and orientation.r is None):
        return nan, nan
    p, r = orientation.p or 0.0, orientation.r or 0.0
    return (p, r) if _is_absolute(orientation, simulation) else (pose.pitch + p, pose.roll + r)


def _is_absolute(orientation: positions.Orientation | None, simulation: Simulation) -> bool:
    """Whether it is meant in the world; no orientation at all is relative (along the road, like the entity)."""
    if orientation is None:
        return False
    if orientation.type is None:
        return simulation.scenario.header.version < _RELATIVE_SINCE
    return orientation.type is ReferenceContext.ABSOLUTE


# ---- beside an entity ------------------------------------------------------------------------------------------------
def entity_on_road(position: RelativeOnRoad, simulation: Simulation) -> EntityState:
    """The entity that it refers to, with its road coordinates; raises `PlaybackError` if it is on no road."""
    state = simulation.entity(position.entity_ref, position.place)
    state.locate()
    if state.road == NO_ROAD:
        what = f"'{state.name}' is on no road, so there is no place beside it in road coordinates"
        raise position.place.error(what, PlaybackError)
    return state


def moved_along(state: EntityState, distance: float, way: int, route: RouteGuide | None = None) -> Placement:
    """Where an entity would be after a way along the road, on `route` or else its own; `way` +1: along s. [m]"""
    scout = _scout(state, route)
    travel(scout, way, distance)
    return scout.place


def _scout(state: EntityState, route: RouteGuide | None = None) -> EntityState:
    """One that can go ahead of an entity."""
    scout = EntityState(state.entity, state.network, route=route or state.route)
    scout.put(state.place._replace(pose=None))
    return scout


POSITIONS: dict[type, Callable[..., Placement]] = {
    positions.GeoPosition: geo_position,
    positions.LanePosition: lane_position,
    positions.RelativeLanePosition: relative_lane_position,
    positions.RelativeObjectPosition: relative_object_position,
    positions.RelativeRoadPosition: relative_road_position,
    positions.RelativeWorldPosition: relative_world_position,
    positions.RoadPosition: road_position,
    positions.RoutePosition: route_position,
    positions.TrajectoryPosition: trajectory_position,
    positions.WorldPosition: world_position,
}
