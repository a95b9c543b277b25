"""AccelerationCondition."""

from __future__ import annotations

from math import copysign, hypot

from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.conditions.direction import component, watch_motion
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.values import holds
from xosc_lateral.scenario.conditions.entity import AccelerationCondition


def prepare(content: AccelerationCondition, simulation: Simulation) -> EntityCheck:
    """Finite difference of velocities. Without a direction: its length, negative when it points backwards. [m/s2]"""
    direction = content.direction
    watch_motion(simulation, direction)

    def check(state: EntityState) -> bool:
        ahead, left, up = state.body_frame(state.acceleration)
        value = copysign(hypot(ahead, left), ahead) if direction is None else component((ahead, left, up), direction)
        return holds(value, content.rule, content.value)

    return check


CHECKS: EntityChecks = {AccelerationCondition: prepare}
