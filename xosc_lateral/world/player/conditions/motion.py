"""Conditions on how an entity moves: speed, acceleration, distance travelled, standstill, off the road."""

from __future__ import annotations

from math import copysign, hypot, pi

from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import NO_ROAD, EntityState
from xosc_lateral.world.player.storyboard import EntityCheck, EntityChecks
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.player.values import holds
from xosc_lateral.world.road import Pose
from xosc_lateral.world.road.positions import difference
from xosc_lateral.world.scenario.conditions import (
    AccelerationCondition,
    AngleCondition,
    EndOfRoadCondition,
    OffroadCondition,
    RelativeAngleCondition,
    RelativeSpeedCondition,
    SpeedCondition,
    StandStillCondition,
    TraveledDistanceCondition,
)
from xosc_lateral.world.scenario.enums import AngleType, CoordinateSystem, DirectionalDimension

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


# ---- AngleCondition ----
def prepare_angle(content: AngleCondition, simulation: Simulation) -> EntityCheck:
    """Own angle in the world, or relative to road, lane or trajectory. [rad]"""
    system = content.coordinate_system or CoordinateSystem.WORLD
    if not _is_played(content, system, simulation):
        return lambda state: False

    def check(state: EntityState) -> bool:
        value = _angle(state, content.angle_type, system, simulation)
        return value is not None and abs(difference(value, content.angle)) < content.tolerance + EPSILON

    return check


def prepare_relative_angle(content: RelativeAngleCondition, simulation: Simulation) -> EntityCheck:
    """Own angle minus that of another entity, each relative to its own road, lane or trajectory. [rad]"""
    other = simulation.entity(content.entity_ref, content.place)
    system = content.coordinate_system or CoordinateSystem.ENTITY
    if not _is_played(content, system, simulation):
        return lambda state: False
    if system is CoordinateSystem.ENTITY:
        system = CoordinateSystem.WORLD  # the difference of two angles is the same in either

    def check(state: EntityState) -> bool:
        if not other.active:
            return False
        angle_here, its = (_angle(entity, content.angle_type, system, simulation) for entity in (state, other))
        if angle_here is None or its is None:
            return False
        return abs(difference(angle_here - its, content.angle)) < content.tolerance + EPSILON

    return check


def _is_played(
    content: AngleCondition | RelativeAngleCondition, system: CoordinateSystem, simulation: Simulation
) -> bool:
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
        if state.path is None:
            return None
        return state.plane.heading - state.path.path.at(state.path.s).tangent
    actual = _of_kind(state.pose, kind)
    if system is CoordinateSystem.WORLD:
        return actual + simulation.network.header_offset.heading if kind is AngleType.HEADING else actual
    return actual - _reference(state, kind, system)


def _reference(state: EntityState, kind: AngleType, system: CoordinateSystem) -> float:
    """Angle of the road's s-axis, or of the direction in which the lane is driven. [rad]"""
    if kind is AngleType.HEADING:
        against = system is CoordinateSystem.LANE and _is_against(state)
        return state.road_heading() + (pi if against else 0.0)
    state.locate()
    if state.road == NO_ROAD:
        return 0.0
    road = state.network.road_pose_at(state.road, state.s, state.t)
    sign = -1.0 if system is CoordinateSystem.LANE and _is_against(state) else 1.0
    return sign * _of_kind(road, kind)


def _is_against(state: EntityState) -> bool:
    state.locate()
    return state.road != NO_ROAD and state.network.travel_direction(state.road, state.lane) < 0


def _of_kind(pose: Pose, kind: AngleType) -> float:
    if kind is AngleType.HEADING:
        return pose.heading
    return pose.pitch if kind is AngleType.PITCH else pose.roll


CHECKS: EntityChecks = {
    SpeedCondition: prepare_speed,
    RelativeSpeedCondition: prepare_relative_speed,
    AccelerationCondition: prepare_acceleration,
    TraveledDistanceCondition: prepare_traveled_distance,
    EndOfRoadCondition: prepare_end_of_road,
    OffroadCondition: prepare_offroad,
    StandStillCondition: prepare_stand_still,
    AngleCondition: prepare_angle,
    RelativeAngleCondition: prepare_relative_angle,
}
