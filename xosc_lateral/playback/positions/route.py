"""RoutePosition: somewhere on a route."""

from __future__ import annotations

from collections.abc import Callable
from math import pi

from xosc_lateral.errors import PlaybackError
from xosc_lateral.playback.positions.on_road import lane_placement, road_placement
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import NOWHERE, Placement, RouteGuide
from xosc_lateral.scenario.position import (
    FromCurrentEntity,
    FromLaneCoordinates,
    FromRoadCoordinates,
    Route,
    RoutePosition,
)


def route_position(
    position: RoutePosition, simulation: Simulation, route_guide: Callable[[Route, Simulation], RouteGuide | None]
) -> Placement:
    """The way along the route counts from its first waypoint; an entity on it is where it is."""
    place = position.place
    where = position.in_route
    if position.route is None or where is None:
        raise PlaybackError("names no route or no place on it", path=place.path, line=place.line, element=place.element)
    if isinstance(where, FromCurrentEntity):
        state = simulation.entity(where.entity_ref, place)
        state.locate()
        pose = state.pose if state.road == NOWHERE else None
        return Placement(state.road, state.lane, state.s, state.offset_t, state.relative_heading, pose)
    route = route_guide(position.route, simulation)
    if route is None:
        raise PlaybackError(
            f"no way leads along route '{position.route.name}'", path=place.path, line=place.line, element=place.element
        )
    road, s, direction = route.at(where.path_s)
    if direction < 0:
        simulation.note(
            "the route runs against s here: lanes, offset and heading count along it "
            "(in esmini only with --align_routepositions)",
            place,
        )
    return _on_route(position, where, simulation, road, s, direction)


def _on_route(
    position: RoutePosition,
    where: FromLaneCoordinates | FromRoadCoordinates,
    simulation: Simulation,
    road: int,
    s: float,
    direction: int,
) -> Placement:
    """A lane and an offset, or t, as the route counts them, where it is at `s` [m] of a road."""
    place = position.place
    if isinstance(where, FromLaneCoordinates):
        lane, offset = _with_route(simulation, road, where.lane_id, where.lane_offset, direction)
        return lane_placement(simulation, road, lane, s, offset, position.orientation, place)
    t = where.t
    lane_at_t = simulation.network.lane_at(road, s, t).lane
    if _with_route(simulation, road, lane_at_t, 0.0, direction)[0] != lane_at_t:
        t = -t
    return _headed(simulation, road_placement(simulation, road, s, t, position.orientation, place), direction, position)


def _with_route(simulation: Simulation, road: int, lane: int, offset: float, direction: int) -> tuple[int, float]:
    """Where the route runs against s, a lane that is driven against the route was counted from it: its twin.

    Files do both: ids as the road has them, and ids as if each road ran along the route. Along s these are the same.
    """
    network = simulation.network
    if direction > 0 or lane == 0 or network.travel_direction(road, lane) == direction:
        return lane, offset
    twin_exists = any(-lane in section.by_id for section in network.roads[road].sections)
    return (-lane, -offset) if twin_exists else (lane, offset)


def _headed(simulation: Simulation, place: Placement, direction: int, position: RoutePosition) -> Placement:
    """Without an orientation, along the route."""
    if position.orientation is not None or direction > 0:
        return place
    return place._replace(relative_heading=place.relative_heading + pi)
