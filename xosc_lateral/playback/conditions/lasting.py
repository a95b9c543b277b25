"""StandStillCondition, EndOfRoadCondition, OffroadCondition: something has gone on for a while."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.transition import EPSILON
from xosc_lateral.scenario.conditions.entity import EndOfRoadCondition, OffroadCondition, StandStillCondition


def prepare_stand_still(content: StandStillCondition, simulation: Simulation) -> EntityCheck:
    """Under 1 mm/s for longer than the duration, counted from the row in which it came to a stand. [s]"""
    simulation.derives_states = True
    return lambda state: state.standing_since is not None and simulation.time - state.standing_since > content.duration


def prepare_end_of_road(content: EndOfRoadCondition, simulation: Simulation) -> EntityCheck:
    """At the end of its road for at least the duration. [s]"""
    simulation.derives_states = True

    def check_since(since: float | None) -> bool:
        return since is not None and simulation.time - since >= content.duration - EPSILON

    return lambda state: check_since(state.road_end_since)


def prepare_offroad(content: OffroadCondition, simulation: Simulation) -> EntityCheck:
    """Beside the road for longer than the duration. [s]"""
    simulation.derives_states = simulation.derives_off_road = True
    return lambda state: state.off_road_since is not None and simulation.time - state.off_road_since > content.duration


CHECKS: EntityChecks = {
    EndOfRoadCondition: prepare_end_of_road,
    OffroadCondition: prepare_offroad,
    StandStillCondition: prepare_stand_still,
}
