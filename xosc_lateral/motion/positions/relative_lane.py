"""RelativeLanePosition: from where an entity is, in lane coordinates."""

from __future__ import annotations

from xosc_lateral.motion.positions.on_road import lane_placement
from xosc_lateral.motion.positions.reference import moved_along, on_road
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import Placement
from xosc_lateral.scenario.position import RelativeLanePosition


def resolve(position: RelativeLanePosition, run: Run) -> Placement:
    """`ds` goes along the road's s and counts lanes and offset along +t; `dsLane` goes along the lane's direction of
    travel and counts them to the left of it.
    """
    state = on_road(run, position.entity_ref, position.place)
    network = run.network
    if position.ds_lane is None:
        there = moved_along(state, position.ds or 0.0, 1)
        side = 1
    else:
        there = moved_along(state, position.ds_lane, network.travel_direction(state.road, state.lane))
        side = network.travel_direction(there.road, there.lane)
    lane = beside(there.lane, side * position.d_lane)
    along_lane = position.ds_lane is not None
    return lane_placement(
        run,
        there.road,
        lane,
        there.s,
        side * position.offset,
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
