"""DistanceCondition: distance to a position."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.conditions.measure import measure_of
from xosc_lateral.playback.distances import FAR, apart, spot_distance
from xosc_lateral.playback.positions.resolve import spot_at
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.values import holds
from xosc_lateral.scenario.conditions.entity import DistanceCondition
from xosc_lateral.scenario.enums import RelativeDistanceType


def prepare(content: DistanceCondition, simulation: Simulation) -> EntityCheck:
    """Its amount counts; where no road leads there, it is huge. [m]"""
    system, kind = measure_of(content, simulation)
    spot = spot_at(content.position, simulation)

    if kind is RelativeDistanceType.EUCLIDIAN and not content.freespace:

        def check_straight(state: EntityState) -> bool:
            target = spot()
            return holds(apart(state, target.x, target.y), content.rule, content.value)

        return check_straight

    def check(state: EntityState) -> bool:
        distance = spot_distance(simulation.network, state, spot(), system, kind, freespace=content.freespace)
        return holds(FAR if distance is None else abs(distance), content.rule, content.value)

    return check


CHECKS: EntityChecks = {DistanceCondition: prepare}
