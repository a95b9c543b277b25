"""RelativeLanePosition: from where an entity is, in lane coordinates."""

from __future__ import annotations

from xosc_lateral.playback.placement import Placement
from xosc_lateral.playback.positions.on_road import lane_placement
from xosc_lateral.playback.positions.reference import moved_along, on_road
from xosc_lateral.playback.routes import RouteGuide
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.scenario.position import RelativeLanePosition


def resolve(position: RelativeLanePosition, simulation: Simulation, route: RouteGuide | None = None) -> Placement:
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
