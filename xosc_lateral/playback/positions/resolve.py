"""All positions that can be played: what the file says -> a place in the world."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from xosc_lateral.errors import UnsupportedElementError
from xosc_lateral.playback.distances import Spot
from xosc_lateral.playback.placement import NOWHERE, Placement
from xosc_lateral.playback.positions import (
    geo,
    lane,
    relative_lane,
    relative_object,
    relative_road,
    relative_world,
    road,
    route,
    trajectory,
    world,
)
from xosc_lateral.playback.positions.reference import pose_at
from xosc_lateral.playback.routes import RouteGuide, guide
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.road import Pose
from xosc_lateral.scenario import Unsupported
from xosc_lateral.scenario import position as written
from xosc_lateral.scenario.position import Route

POSITIONS: tuple[tuple[type, Callable[[Any, Simulation], Placement]], ...] = (
    (written.GeoPosition, geo.resolve),
    (written.LanePosition, lane.resolve),
    (written.RelativeLanePosition, relative_lane.resolve),
    (written.RelativeObjectPosition, relative_object.resolve),
    (written.RelativeRoadPosition, relative_road.resolve),
    (written.RelativeWorldPosition, relative_world.resolve),
    (written.RoadPosition, road.resolve),
    (written.RoutePosition, lambda position, simulation: route.resolve(position, simulation, route_guide)),
    (written.TrajectoryPosition, lambda position, simulation: trajectory.resolve(position, simulation, pose_of)),
    (written.WorldPosition, world.resolve),
)

_RESOLVERS = dict(POSITIONS)
_FIXED = (written.GeoPosition, written.LanePosition, written.RoadPosition, written.WorldPosition)
"""Positions that no entity has an influence on."""


def resolve(position: written.Position, simulation: Simulation, *, route: RouteGuide | None = None) -> Placement:
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
    if isinstance(position, written.RelativeLanePosition):
        return relative_lane.resolve(position, simulation, route)
    if isinstance(position, written.RelativeRoadPosition):
        return relative_road.resolve(position, simulation, route)
    return _RESOLVERS[type(position)](position, simulation)


def spot_at(position: written.Position, simulation: Simulation) -> Callable[[], Spot]:
    """A position to measure distances to, found anew each time only if it may move."""
    if isinstance(position, _FIXED):
        fixed = _spot(resolve(position, simulation), simulation)
        return lambda: fixed
    return lambda: _spot(resolve(position, simulation), simulation)


def pose_of(position: written.Position, simulation: Simulation) -> Pose:
    """World pose of a position now. z, pitch and roll are the road's where none are given. [m], [rad]"""
    if isinstance(position, written.WorldPosition) and None not in (position.z, position.p, position.r):
        return world.pose_of(position)  # nothing of it is the road's, which need not be looked for
    return pose_at(resolve(position, simulation), simulation)


def route_guide(route_: Route, simulation: Simulation) -> RouteGuide | None:
    """The way over a route's waypoints; None: no way leads along it."""
    return guide(simulation.network, [resolve(waypoint.position, simulation) for waypoint in route_.waypoints])


def _spot(place: Placement, simulation: Simulation) -> Spot:
    scout = EntityState(simulation.entities[0].entity, simulation.network)
    scout.put(place)
    pose = scout.pose
    if place.road == NOWHERE:
        return Spot(pose.x, pose.y, NOWHERE, 0, 0.0, 0.0)
    return Spot(pose.x, pose.y, place.road, place.lane, place.s, scout.t)
