"""Conditions on how an entity moves: speed, acceleration, distance travelled, standstill, off the road."""

from __future__ import annotations

from math import copysign, hypot, pi

from xosc_lateral.world.player.simulation import Simulation, holds
from xosc_lateral.world.player.state import NO_ROAD, EntityState
from xosc_lateral.world.player.storyboard import EntityCheck, EntityChecks
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.positions import difference
from xosc_lateral.world.scenario import conditions
from xosc_lateral.world.scenario.enums import AngleType, CoordinateSystem, DirectionalDimension

_AXES = tuple(DirectionalDimension)


def component(vector: tuple[float, float, float], direction: DirectionalDimension) -> float:
    """Of a vector in the entity's frame (ahead, left, up)."""
    return vector[_AXES.index(direction)]


def watch_motion(simulation: Simulation, direction: DirectionalDimension | None = None) -> None:
    """Have velocities and accelerations worked out in every frame."""
    simulation.derives_motion = True
    if direction is DirectionalDimension.VERTICAL:
        simulation.derives_height = True


def prepare_speed(content: conditions.SpeedCondition, simulation: Simulation) -> EntityCheck:
    """Without a direction, the signed scalar speed. [m/s]"""
    direction = content.direction
    if direction is None:
        return lambda state: holds(state.speed, content.rule, content.value)
    watch_motion(simulation, direction)
    return lambda state: holds(component(state.body_frame(state.velocity), direction), content.rule, content.value)


def prepare_relative_speed(content: conditions.RelativeSpeedCondition, simulation: Simulation) -> EntityCheck:
    """Without a direction, the difference of the scalar speeds; else of the velocities, in the OTHER's frame. [m/s]"""
    other = simulation.entity(content.entity_ref, content.place)
    direction = content.direction
    if direction is None:
        return lambda state: other.active and holds(state.speed - other.speed, content.rule, content.value)
    watch_motion(simulation, direction)

    def check(state: EntityState) -> bool:
        a, b = state.velocity, other.velocity
        relative = other.body_frame((a[0] - b[0], a[1] - b[1], a[2] - b[2]))
        return other.active and holds(component(relative, direction), content.rule, content.value)

    return check


def prepare_acceleration(content: conditions.AccelerationCondition, simulation: Simulation) -> EntityCheck:
    """Finite difference of velocities. Without a direction: its length, negative when it points backwards. [m/s2]"""
    direction = content.direction
    watch_motion(simulation, direction)

    def check(state: EntityState) -> bool:
        ahead, left, up = state.body_frame(state.acceleration)
        value = copysign(hypot(ahead, left), ahead) if direction is None else component((ahead, left, up), direction)
        return holds(value, content.rule, content.value)

    return check


def prepare_traveled_distance(content: conditions.TraveledDistanceCondition, simulation: Simulation) -> EntityCheck:
    """Teleports don't count. [m]"""
    simulation.derives_motion = True
    return lambda state: state.odometer >= content.value


def prepare_stand_still(content: conditions.StandStillCondition, simulation: Simulation) -> EntityCheck:
    """Under 1 mm/s for longer than the duration, counted from the row in which it came to a stand. [s]"""
    simulation.derives_states = True
    return lambda state: state.standing_since is not None and simulation.time - state.standing_since > content.duration


def prepare_end_of_road(content: conditions.EndOfRoadCondition, simulation: Simulation) -> EntityCheck:
    """At the end of its road for at least the duration. [s]"""
    simulation.derives_states = True
    least = content.duration - EPSILON
    return lambda state: state.road_end_since is not None and simulation.time - state.road_end_since >= least


def prepare_offroad(content: conditions.OffroadCondition, simulation: Simulation) -> EntityCheck:
    """Beside the road for longer than the duration. [s]"""
    simulation.derives_states = simulation.derives_off_road = True
    return lambda state: state.off_road_since is not None and simulation.time - state.off_road_since > content.duration


# ---- AngleCondition ----
def prepare_angle(content: conditions.AngleCondition, simulation: Simulation) -> EntityCheck:
    """Own angle in the world or to road, lane or trajectory, perhaps minus another entity's to its own. [rad]"""
    system, other = content.coordinate_system or CoordinateSystem.WORLD, None
    if isinstance(content, conditions.RelativeAngleCondition):
        other = simulation.entity(content.entity_ref, content.place)
        if system is CoordinateSystem.ENTITY:
            system = CoordinateSystem.WORLD  # the difference of two angles is the same in either
    if not _is_played(content, system, simulation):
        return lambda state: False

    def check(state: EntityState) -> bool:
        if other is not None and not other.active:
            return False
        angle = _angle(state, content.angle_type, system, simulation)
        its = 0.0 if other is None else _angle(other, content.angle_type, system, simulation)
        if angle is None or its is None:
            return False
        return abs(difference(angle - its, content.angle)) < content.tolerance + EPSILON

    return check


def _is_played(content: conditions.AngleCondition, system: CoordinateSystem, simulation: Simulation) -> bool:
    """Pitch and roll are not known relative to a trajectory: it has none of its own."""
    if system is not CoordinateSystem.TRAJECTORY or content.angle_type is AngleType.HEADING:
        return True
    simulation.note(
        f"{content.angle_type} relative to a trajectory can't be played: the condition stays false", content.place
    )
    return False


def _angle(state: EntityState, kind: AngleType, system: CoordinateSystem, simulation: Simulation) -> float | None:
    """Angle of an entity in a coordinate system; None: it follows no trajectory. [rad]"""
    if system is CoordinateSystem.ENTITY:
        return 0.0
    if system is CoordinateSystem.TRAJECTORY:
        return None if state.path is None else state.plane.heading - state.path.path.at(state.path.s).tangent
    actual: float = getattr(state.pose, kind)
    if system is CoordinateSystem.WORLD:
        return actual + simulation.network.header_offset.heading if kind is AngleType.HEADING else actual
    return actual - _reference(state, kind, system)


def _reference(state: EntityState, kind: AngleType, system: CoordinateSystem) -> float:
    """Angle of the road's s-axis, or of the direction in which the lane is driven. [rad]"""
    state.locate()
    against = (
        system is CoordinateSystem.LANE
        and state.road != NO_ROAD
        and state.network.travel_direction(state.road, state.lane) < 0
    )
    if kind is AngleType.HEADING:
        return state.road_heading() + (pi if against else 0.0)
    if state.road == NO_ROAD:
        return 0.0
    angle: float = getattr(state.network.road_pose_at(state.road, state.s, state.t), kind)
    return -angle if against else angle


CHECKS: EntityChecks = {
    conditions.SpeedCondition: prepare_speed,
    conditions.RelativeSpeedCondition: prepare_relative_speed,
    conditions.AccelerationCondition: prepare_acceleration,
    conditions.TraveledDistanceCondition: prepare_traveled_distance,
    conditions.EndOfRoadCondition: prepare_end_of_road,
    conditions.OffroadCondition: prepare_offroad,
    conditions.StandStillCondition: prepare_stand_still,
    conditions.AngleCondition: prepare_angle,
    conditions.RelativeAngleCondition: prepare_angle,
}
