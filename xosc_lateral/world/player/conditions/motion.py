"""Conditions on how an entity moves: speed, acceleration, distance travelled, standstill, off the road."""

from __future__ import annotations

from math import copysign, hypot

from xosc_lateral.world.player.conditions.base import EntityCheck, EntityChecks
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.player.values import holds
from xosc_lateral.world.scenario.conditions import (
    AccelerationCondition,
    EndOfRoadCondition,
    OffroadCondition,
    RelativeSpeedCondition,
    SpeedCondition,
    StandStillCondition,
    TraveledDistanceCondition,
)
from xosc_lateral.world.scenario.enums import DirectionalDimension

_AXES = (DirectionalDimension.LONGITUDINAL, DirectionalDimension.LATERAL, DirectionalDimension.VERTICAL)


def component(vector: tuple[float, float, float], direction: DirectionalDimension) -> float:
    """Of a vector in the entity's frame (ahead, left, up)."""
    return vector[_AXES.index(direction)]


def watch_motion(simulation: Simulation, direction: DirectionalDimension | None = None) -> None:
    """Have velocities and accelerations worked out in every frame."""
    simulation.derives_motion = True
    if direction is DirectionalDimension.VERTICAL:
        simulation.derives_height = True


def prepare_speed(content: SpeedCondition, simulation: Simulation) -> EntityCheck:
    """Without a direction, the signed scalar speed. [m/s]"""
    direction = content.direction
    if direction is None:
        return lambda state: holds(state.speed, content.rule, content.value)
    watch_motion(simulation, direction)

    def check(state: EntityState) -> bool:
        return holds(component(state.body_frame(state.velocity), direction), content.rule, content.value)

    return check


def prepare_relative_speed(content: RelativeSpeedCondition, simulation: Simulation) -> EntityCheck:
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


def prepare_acceleration(content: AccelerationCondition, simulation: Simulation) -> EntityCheck:
    """Finite difference of velocities. Without a direction: its length, negative when it points backwards. [m/s2]"""
    direction = content.direction
    watch_motion(simulation, direction)

    def check(state: EntityState) -> bool:
        ahead, left, up = state.body_frame(state.acceleration)
        value = copysign(hypot(ahead, left), ahead) if direction is None else component((ahead, left, up), direction)
        return holds(value, content.rule, content.value)

    return check


def prepare_traveled_distance(content: TraveledDistanceCondition, simulation: Simulation) -> EntityCheck:
    """Teleports don't count. [m]"""
    simulation.derives_motion = True
    return lambda state: state.odometer >= content.value


def prepare_stand_still(content: StandStillCondition, simulation: Simulation) -> EntityCheck:
    """Under 1 mm/s for longer than the duration, counted from the row in which it came to a stand. [s]"""
    simulation.derives_states = True
    return lambda state: state.standing_since is not None and simulation.time - state.standing_since > content.duration


def prepare_end_of_road(content: EndOfRoadCondition, simulation: Simulation) -> EntityCheck:
    """At the end of its road for at least the duration. [s]"""
    simulation.derives_states = True
    least = content.duration - EPSILON
    return lambda state: state.road_end_since is not None and simulation.time - state.road_end_since >= least


def prepare_offroad(content: OffroadCondition, simulation: Simulation) -> EntityCheck:
    """Beside the road for longer than the duration. [s]"""
    simulation.derives_states = simulation.derives_off_road = True
    return lambda state: state.off_road_since is not None and simulation.time - state.off_road_since > content.duration


CHECKS: EntityChecks = {
    SpeedCondition: prepare_speed,
    RelativeSpeedCondition: prepare_relative_speed,
    AccelerationCondition: prepare_acceleration,
    TraveledDistanceCondition: prepare_traveled_distance,
    EndOfRoadCondition: prepare_end_of_road,
    OffroadCondition: prepare_offroad,
    StandStillCondition: prepare_stand_still,
}
