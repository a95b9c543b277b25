"""RelativeDistanceCondition: distance to another entity."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.conditions.measure import measure_of
from xosc_lateral.playback.distances import FAR, apart, train_distance
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.values import holds
from xosc_lateral.scenario.conditions.entity import RelativeDistanceCondition
from xosc_lateral.scenario.enums import RelativeDistanceType


def prepare(content: RelativeDistanceCondition, simulation: Simulation) -> EntityCheck:
    """Its amount counts; where no road leads there, it is huge. [m]"""
    other = simulation.entity(content.entity_ref, content.place)
    system, kind = measure_of(content, simulation)
    straight = kind is RelativeDistanceType.EUCLIDIAN and not content.freespace

    def check(state: EntityState) -> bool:
        if not other.active:
            return False
        if straight:
            place = other.plane
            return holds(apart(state, place.x, place.y), content.rule, content.value)
        distance = train_distance(simulation.network, state, other, system, kind, freespace=content.freespace)
        return holds(FAR if distance is None else abs(distance), content.rule, content.value)

    return check


CHECKS: EntityChecks = {RelativeDistanceCondition: prepare}
