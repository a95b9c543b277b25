"""RelativeSpeedCondition: own speed minus that of another entity."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.conditions.direction import component, watch_motion
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.values import holds
from xosc_lateral.scenario.conditions.entity import RelativeSpeedCondition


def prepare(content: RelativeSpeedCondition, simulation: Simulation) -> EntityCheck:
    """Without a direction, the difference of the scalar speeds; else of the velocities, in the OTHER's frame. [m/s]"""
    other = simulation.entity(content.entity_ref, content.place)
    direction = content.direction
    if direction is not None:
        watch_motion(simulation, direction)

    def check(state: EntityState) -> bool:
        if not other.active:
            return False
        if direction is None:
            value = state.speed - other.speed
        else:
            a, b = state.velocity, other.velocity
            value = component(other.body_frame((a[0] - b[0], a[1] - b[1], a[2] - b[2])), direction)
        return holds(value, content.rule, content.value)

    return check


CHECKS: EntityChecks = {RelativeSpeedCondition: prepare}
