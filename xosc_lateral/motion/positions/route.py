"""RoutePosition: somewhere on a route."""

from __future__ import annotations

from xosc_lateral.errors import PlaybackError
from xosc_lateral.motion.positions.on_road import lane_placement, road_placement
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import NOWHERE, Placement
from xosc_lateral.scenario.position import FromCurrentEntity, FromLaneCoordinates, RoutePosition


def resolve(position: RoutePosition, run: Run) -> Placement:
    """The way along the route counts from its first waypoint; an entity on it is where it is."""
    from xosc_lateral.motion.positions.resolve import route_guide

    place = position.place
    where = position.in_route
    if position.route is None or where is None:
        raise PlaybackError("names no route or no place on it", path=place.path, line=place.line, element=place.element)
    if isinstance(where, FromCurrentEntity):
        state = run.entity(where.entity_ref, place)
        state.locate()
        pose = state.pose if state.road == NOWHERE else None
        return Placement(state.road, state.lane, state.s, state.offset_t, state.relative_heading, pose)
    route = route_guide(position.route, run)
    if route is None:
        raise PlaybackError(
            f"no way leads along route '{position.route.name}'", path=place.path, line=place.line, element=place.element
        )
    road, s, _ = route.at(where.path_s)
    if isinstance(where, FromLaneCoordinates):
        return lane_placement(run, road, where.lane_id, s, where.lane_offset, position.orientation, place)
    return road_placement(run, road, s, where.t, position.orientation, place)
