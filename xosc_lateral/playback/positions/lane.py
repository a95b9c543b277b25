"""LanePosition."""

from __future__ import annotations

from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.on_road import lane_placement, road_index
from xosc_lateral.playback.run import Run
from xosc_lateral.scenario.position import LanePosition


def resolve(position: LanePosition, run: Run) -> Placement:
    """Without an orientation, in the lane's direction of travel."""
    road = road_index(run, position.road_id, position.place)
    return lane_placement(
        run, road, position.lane_id, position.s, position.offset, position.orientation, position.place
    )
