"""RelativeClearanceCondition: nobody in a range of lanes and distances around the entity."""

from __future__ import annotations

from xosc_lateral.world.player.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.world.player.distances import free_road_gap, road_gap, spot_of
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import NO_ROAD, EntityState
from xosc_lateral.world.road.network import DRIVING
from xosc_lateral.world.scenario.conditions import RelativeClearanceCondition

_MANY_LANES = 1000
"""Wider than any road: an open end of a lane range."""


def prepare(content: RelativeClearanceCondition, simulation: Simulation) -> EntityCheck:
    """True when the lanes of the range exist and hold nobody between `-distance_backward` and `distance_forward`. [m]

    Lanes count along the road's lane ids, without lane 0, as in the reference player.
    """
    ranges = tuple(
        (
            -_MANY_LANES if lanes.from_lane is None else lanes.from_lane,
            _MANY_LANES if lanes.to_lane is None else lanes.to_lane,
        )
        for lanes in content.lane_ranges
    ) or ((-_MANY_LANES, _MANY_LANES),)
    names = content.entity_refs
    others = tuple(simulation.entity(name, content.place) for name in names) if names else simulation.everybody()
    reach = max(content.distance_forward, content.distance_backward)

    def in_range(lanes: int) -> bool:
        return any(low <= lanes <= high for low, high in ranges)

    def occupied(state: EntityState, other: EntityState) -> bool:
        if content.freespace:
            gap = free_road_gap(state, other, limit=reach + 100.0)
        else:
            gap = road_gap(state, spot_of(other), limit=reach + 100.0)
        return (
            gap is not None
            and -content.distance_backward <= gap.ds <= content.distance_forward
            and in_range(gap.lanes)
            and (content.opposite_lanes or not gap.opposite)
        )

    def check(state: EntityState) -> bool:
        state.locate()
        if state.road == NO_ROAD:
            return False
        if any(other is not state and other.active and occupied(state, other) for other in others):
            return False
        return any(
            info.type in DRIVING
            and in_range(_lanes_between(state.lane, info.id))
            and (content.opposite_lanes or info.id * state.lane > 0)
            for info in simulation.network.lanes_at(state.road, state.s)
        )

    return check


def _lanes_between(lane: int, other: int) -> int:
    difference = other - lane
    return difference - (1 if difference > 0 else -1) if lane * other < 0 else difference


CHECKS: EntityChecks = {RelativeClearanceCondition: prepare}
