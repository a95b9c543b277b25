"""What relative positions need of the entity that they refer to."""

from __future__ import annotations

from xosc_lateral.errors import PlaybackError
from xosc_lateral.playback.drive import travel
from xosc_lateral.playback.placement import NOWHERE, Placement
from xosc_lateral.playback.routes import RouteGuide
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.road import Pose
from xosc_lateral.scenario import Place
from xosc_lateral.scenario.position import FromCurrentEntity, Position, RoutePosition


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
