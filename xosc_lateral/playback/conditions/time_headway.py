"""TimeHeadwayCondition: distance to another entity over own speed."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.conditions.measure import measure_of
from xosc_lateral.playback.distances import FAR, train_distance
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.transition import EPSILON
from xosc_lateral.playback.values import holds
from xosc_lateral.scenario.conditions.entity import TimeHeadwayCondition


def prepare(content: TimeHeadwayCondition, simulation: Simulation) -> EntityCheck:
    """Not defined, hence false, when the other is behind or the entity does not move forward. [s]"""
    other = simulation.entity(content.entity_ref, content.place)
    system, kind = measure_of(content, simulation)

    def check(state: EntityState) -> bool:
        if not other.active or state.speed < EPSILON:
            return False
        distance = train_distance(simulation.network, state, other, system, kind, freespace=content.freespace)
        distance = FAR if distance is None else distance
        return distance >= 0.0 and holds(distance / state.speed, content.rule, content.value)

    return check


CHECKS: EntityChecks = {TimeHeadwayCondition: prepare}
