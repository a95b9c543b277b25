"""What relative positions need of the entity that they refer to."""

from __future__ import annotations

from xosc_lateral.errors import PlaybackError
from xosc_lateral.motion.drive import travel
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import NOWHERE, EntityState, Placement
from xosc_lateral.scenario import Place


def on_road(run: Run, name: str, place: Place) -> EntityState:
    """The entity, with its road coordinates; raises `PlaybackError` if it is on no road."""
    state = run.entity(name, place)
    state.locate()
    if state.road == NOWHERE:
        raise PlaybackError(
            f"'{name}' is on no road, so there is no place beside it in road coordinates",
            path=place.path,
            line=place.line,
            element=place.element,
        )
    return state


def moved_along(state: EntityState, distance: float, way: int) -> Placement:
    """Where an entity would be after a way along the road; `way` +1: along s. [m]"""
    scout = EntityState(state.entity, state.network)
    scout.put(Placement(state.road, state.lane, state.s, state.offset_t, state.relative_heading))
    scout.route = state.route
    travel(scout, way, distance)
    return Placement(scout.road, scout.lane, scout.s, scout.offset_t, scout.relative_heading)
