"""TimeToCollisionCondition: distance over closing speed.

References
----------
.. [1] J. C. Hayward, "Near-miss determination through use of a scale of danger", Highway Research Record 384, 1972.
"""

from __future__ import annotations

from math import copysign, hypot

from xosc_lateral.playback.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.playback.conditions.distance import measure_of
from xosc_lateral.playback.distances import FAR
from xosc_lateral.playback.positions.resolve import spot_at
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.transition import EPSILON
from xosc_lateral.playback.values import holds
from xosc_lateral.scenario.conditions import TimeToCollisionCondition


def prepare(content: TimeToCollisionCondition, simulation: Simulation) -> EntityCheck:
    """Not defined, hence false, when they don't come closer. [s]"""
    measure, target = measure_of(content, simulation), content.target
    if isinstance(target, str):
        other = simulation.entity(target, content.place)
        simulation.derives_motion = True
        return lambda state: (
            other.active and _holds(measure.between(state, other), _closing_speed(state, other), content)
        )
    spot = spot_at(target, simulation)
    return lambda state: _holds(measure.between(state, spot()), state.speed, content)


def _holds(distance: float | None, closing: float, content: TimeToCollisionCondition) -> bool:
    distance = FAR if distance is None else distance
    if abs(distance) < EPSILON or abs(closing) < EPSILON or distance / closing < 0.0:
        return False
    return holds(distance / closing, content.rule, content.value)


def _closing_speed(state: EntityState, other: EntityState) -> float:
    """Own velocity along the other's velocity, minus the other's speed; own speed when the other stands. [m/s]"""
    vx, vy, _ = other.velocity
    if abs(vx) < EPSILON and abs(vy) < EPSILON:
        return state.speed
    along = (state.velocity[0] * vx + state.velocity[1] * vy) / hypot(vx, vy)
    return copysign(1.0, state.speed) * copysign(1.0, along) * (along - abs(other.speed))


CHECKS: EntityChecks = {TimeToCollisionCondition: prepare}
