"""RoadPosition."""

from __future__ import annotations

from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.on_road import road_index, road_placement
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario.position import RoadPosition


def resolve(position: RoadPosition, simulation: Simulation) -> Placement:
    """Without an orientation, along s."""
    road = road_index(simulation, position.road_id, position.place)
    return road_placement(simulation, road, position.s, position.t, position.orientation, position.place)
