"""SpeedCondition: own speed, or its component along an axis of the entity."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.conditions.direction import component, watch_motion
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.values import holds
from xosc_lateral.scenario.conditions.entity import SpeedCondition


def prepare(content: SpeedCondition, simulation: Simulation) -> EntityCheck:
    """Without a direction, the signed scalar speed. [m/s]"""
    direction = content.direction
    if direction is None:
        return lambda state: holds(state.speed, content.rule, content.value)
    watch_motion(simulation, direction)

    def check(state: EntityState) -> bool:
        return holds(component(state.body_frame(state.velocity), direction), content.rule, content.value)

    return check


CHECKS: EntityChecks = {SpeedCondition: prepare}
