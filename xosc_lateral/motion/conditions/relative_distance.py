"""RelativeDistanceCondition: distance to another entity."""

from __future__ import annotations

from xosc_lateral.motion.conditions.base import EntityCheck
from xosc_lateral.motion.distances import FAR, apart, entity_distance
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import EntityState
from xosc_lateral.motion.values import holds
from xosc_lateral.scenario.conditions import RelativeDistanceCondition
from xosc_lateral.scenario.enums import CoordinateSystem, RelativeDistanceType


def prepare(content: RelativeDistanceCondition, run: Run) -> EntityCheck:
    """Its amount counts; where no road leads there, it is huge. [m]"""
    other = run.entity(content.entity_ref, content.place)
    system = content.coordinate_system or CoordinateSystem.ENTITY
    straight = content.distance_type is RelativeDistanceType.EUCLIDIAN and not content.freespace

    def check(state: EntityState) -> bool:
        if not other.active:
            return False
        if straight:
            place = other.plane
            return holds(apart(state, place.x, place.y), content.rule, content.value)
        distance = entity_distance(
            run.network, state, other, system, content.distance_type, freespace=content.freespace
        )
        return holds(FAR if distance is None else abs(distance), content.rule, content.value)

    return check
