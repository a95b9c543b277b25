"""All positions that can be played: what the file says -> a place in the world."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, nan, sin
from typing import Any

from xosc_lateral.errors import UnsupportedElementError
from xosc_lateral.playback.distances import Spot
from xosc_lateral.playback.paths.registry import path_of
from xosc_lateral.playback.positions.geo import geo_position
from xosc_lateral.playback.positions.on_road import (
    heading_of,
    is_absolute,
    lane_placement,
    moved_along,
    on_road,
    pose_at,
    road_index,
    road_placement,
    tilted_or_road,
)
from xosc_lateral.playback.positions.route import route_position
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import NOWHERE, EntityState, Placement, RouteGuide, free, guide, locate
from xosc_lateral.road import Pose
from xosc_lateral.scenario import Unsupported
from xosc_lateral.scenario.position import (
    GeoPosition,
    LanePosition,
    Position,
    RelativeLanePosition,
    RelativeObjectPosition,
    RelativeRoadPosition,
    RelativeWorldPosition,
    RoadPosition,
    Route,
    RoutePosition,
    TrajectoryPosition,
    WorldPosition,
)

_FIXED = (GeoPosition, LanePosition, RoadPosition, WorldPosition)
"""Positions that no entity has an influence on."""


def resolve(position: Position, simulation: Simulation, *, route: RouteGuide | None = None) -> Placement:
    """The place that a position means now; raises `PlaybackError` where there is no such place.

    `route` is that of the entity which is to go there: a way along the road from another entity follows it, or else the
    route of that other one.
    """
    if isinstance(position, Unsupported):
        where = position.place
        raise UnsupportedElementError(
            position.reason or f"{position.kind} can't be played",
            path=where.path,
            line=where.line,
            element=where.element,
        )
    if isinstance(position, RelativeLanePosition):
        return relative_lane_position(position, simulation, route)
    if isinstance(position, RelativeRoadPosition):
        return relative_road_position(position, simulation, route)
    return POSITIONS[type(position)](position, simulation)


def spot_at(position: Position, simulation: Simulation) -> Callable[[], Spot]:
    """A position to measure distances to, found anew each time only if it may move."""
    if isinstance(position, _FIXED):
        fixed = _spot(resolve(position, simulation), simulation)
        return lambda: fixed
    return lambda: _spot(resolve(position, simulation), simulation)


def pose_of(position: Position, simulation: Simulation) -> Pose:
    """World pose of a position now. z, pitch and roll are the road's where none are given. [m], [rad]"""
    if isinstance(position, WorldPosition) and None not in (position.z, position.p, position.r):
        return _world_pose(position)  # nothing of it is the road's, which need not be looked for
    return pose_at(resolve(position, simulation), simulation)


def route_guide(route_: Route, simulation: Simulation) -> RouteGuide | None:
    """The way over a route's waypoints; None: no way leads along it."""
    return guide(simulation.network, [resolve(waypoint.position, simulation) for waypoint in route_.waypoints])


def _spot(place: Placement, simulation: Simulation) -> Spot:
    scout = EntityState(simulation.entities[0].entity, simulation.network)
    scout.put(place)
    pose = scout.pose
    if place.road == NOWHERE:
        return Spot(pose.x, pose.y)
    return Spot(pose.x, pose.y, place.road, place.lane, place.s, scout.t)


def _route_position(position: RoutePosition, simulation: Simulation) -> Placement:
    return route_position(position, simulation, route_guide)


def lane_position(position: LanePosition, simulation: Simulation) -> Placement:
    """Without an orientation, in the lane's direction of travel."""
    road = road_index(simulation, position.road_id, position.place)
    return lane_placement(
        simulation, road, position.lane_id, position.s, position.offset, position.orientation, position.place
    )


def road_position(position: RoadPosition, simulation: Simulation) -> Placement:
    """Without an orientation, along s."""
    road = road_index(simulation, position.road_id, position.place)
    return road_placement(simulation, road, position.s, position.t, position.orientation, position.place)


def _world_pose(position: WorldPosition) -> Pose:
    """Heading 0 where none is given; z, pitch and roll, where none are given, are NaN: the road's."""
    return free(
        position.x,
        position.y,
        position.h or 0.0,
        nan if position.z is None else position.z,
        nan if position.p is None else position.p,
        nan if position.r is None else position.r,
    )


def world_position(position: WorldPosition, simulation: Simulation) -> Placement:
    """Under the pose."""
    return locate(simulation.network, _world_pose(position))


def relative_lane_position(
    position: RelativeLanePosition, simulation: Simulation, route: RouteGuide | None = None
) -> Placement:
    """`ds` goes along the road's s and counts lanes and offset along +t; `dsLane` goes along the lane's direction of
    travel and counts them to the left of it.
    """
    state = on_road(simulation, position.entity_ref, position.place)
    network = simulation.network
    if position.ds_lane is None:
        there = moved_along(state, position.ds or 0.0, 1, route)
        side = 1
    else:
        there = moved_along(state, position.ds_lane, network.travel_direction(state.road, state.lane), route)
        side = network.travel_direction(there.road, there.lane)
    lane = beside(there.lane, side * position.d_lane)
    if simulation.scenario.header.is_left_handed:  # the offset counts from the lane's direction, with `ds` too
        offset = position.offset * network.travel_direction(there.road, lane)
    else:
        offset = position.offset * side
    along_lane = position.ds_lane is not None
    return lane_placement(
        simulation,
        there.road,
        lane,
        there.s,
        offset,
        position.orientation,
        position.place,
        along_lane=along_lane,
    )


def beside(lane: int, lanes: int) -> int:
    """The lane `lanes` further along +t; there is no lane 0 to drive on."""
    target = lane + lanes
    if lane != 0 and (target == 0 or (target > 0) != (lane > 0)):
        target += 1 if lanes > 0 else -1
    return target


def relative_road_position(
    position: RelativeRoadPosition, simulation: Simulation, route: RouteGuide | None = None
) -> Placement:
    """`ds` and `dt` along the road's axes; the way goes on over linked roads."""
    state = on_road(simulation, position.entity_ref, position.place)
    there = moved_along(state, position.ds, 1, route)
    t = simulation.network.lane_state_at(there.road, there.lane, there.s).centre_t + there.offset_t
    return road_placement(simulation, there.road, there.s, t + position.dt, position.orientation, position.place)


def relative_object_position(position: RelativeObjectPosition, simulation: Simulation) -> Placement:
    """Relative headings count from the entity's; its pitch and roll tilt the way there."""
    pose = simulation.entity(position.entity_ref, position.place).pose
    heading = heading_of(position.orientation)
    if not is_absolute(position.orientation, simulation):
        heading += pose.heading
    c, s = cos(pose.heading), sin(pose.heading)
    ahead, left, up = position.dx, position.dy, position.dz or 0.0
    flat_ahead = ahead * cos(pose.pitch) + (left * sin(pose.roll) + up * cos(pose.roll)) * sin(pose.pitch)
    flat_left = left * cos(pose.roll) - up * sin(pose.roll)
    rise = (left * sin(pose.roll) + up * cos(pose.roll)) * cos(pose.pitch) - ahead * sin(pose.pitch)
    x = pose.x + flat_ahead * c - flat_left * s
    y = pose.y + flat_ahead * s + flat_left * c
    z = nan if position.dz is None else pose.z + rise
    return locate(simulation.network, free(x, y, heading, z, *tilted_or_road(position.orientation, pose, simulation)))


def relative_world_position(position: RelativeWorldPosition, simulation: Simulation) -> Placement:
    """Relative headings count from the entity's."""
    pose = simulation.entity(position.entity_ref, position.place).pose
    heading = heading_of(position.orientation)
    if not is_absolute(position.orientation, simulation):
        heading += pose.heading
    dx, dy = simulation.network.header_offset.turned_back(position.dx, position.dy)
    z = nan if position.dz is None else pose.z + position.dz
    tilt = tilted_or_road(position.orientation, pose, simulation)
    return locate(simulation.network, free(pose.x + dx, pose.y + dy, heading, z, *tilt))


def trajectory_position(position: TrajectoryPosition, simulation: Simulation) -> Placement:
    """Relative headings count from the trajectory's."""
    point = path_of(position.trajectory, simulation, pose_of).at(position.s)
    heading = heading_of(position.orientation)
    if not is_absolute(position.orientation, simulation):
        heading += point.heading
    x = point.x - position.t * sin(point.heading)
    y = point.y + position.t * cos(point.heading)
    return locate(simulation.network, free(x, y, heading, point.z))


POSITIONS: dict[type, Callable[[Any, Simulation], Placement]] = {
    GeoPosition: geo_position,
    LanePosition: lane_position,
    RelativeLanePosition: relative_lane_position,
    RelativeObjectPosition: relative_object_position,
    RelativeRoadPosition: relative_road_position,
    RelativeWorldPosition: relative_world_position,
    RoadPosition: road_position,
    RoutePosition: _route_position,
    TrajectoryPosition: trajectory_position,
    WorldPosition: world_position,
}
