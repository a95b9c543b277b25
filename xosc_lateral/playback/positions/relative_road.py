"""RelativeRoadPosition: from where an entity is, in road coordinates."""

from __future__ import annotations

from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.on_road import road_placement
from xosc_lateral.playback.positions.reference import moved_along, on_road
from xosc_lateral.playback.routes import RouteGuide
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario.position import RelativeRoadPosition


def resolve(position: RelativeRoadPosition, simulation: Simulation, route: RouteGuide | None = None) -> Placement:
    """`ds` and `dt` along the road's axes; the way goes on over linked roads."""
    state = on_road(simulation, position.entity_ref, position.place)
    there = moved_along(state, position.ds, 1, route)
    t = simulation.network.lane_state_at(there.road, there.lane, there.s).centre_t + there.offset_t
    return road_placement(simulation, there.road, there.s, t + position.dt, position.orientation, position.place)
