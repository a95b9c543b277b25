"""LanePosition."""

from __future__ import annotations

from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.on_road import lane_placement, road_index
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario.position import LanePosition


def resolve(position: LanePosition, simulation: Simulation) -> Placement:
    """Without an orientation, in the lane's direction of travel."""
    road = road_index(simulation, position.road_id, position.place)
    return lane_placement(
        simulation, road, position.lane_id, position.s, position.offset, position.orientation, position.place
    )
