"""AngleCondition and RelativeAngleCondition."""

from __future__ import annotations

from xosc_lateral.motion.angles import difference
from xosc_lateral.motion.conditions.base import EntityCheck
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import EntityState
from xosc_lateral.scenario.conditions import AngleCondition, RelativeAngleCondition
from xosc_lateral.scenario.enums import AngleType, CoordinateSystem


def prepare_angle(content: AngleCondition, run: Run) -> EntityCheck:
    """Own angle, in the world or relative to road or lane. [rad]"""
    on_road = content.coordinate_system in (CoordinateSystem.ROAD, CoordinateSystem.LANE)

    def check(state: EntityState) -> bool:
        value = _angle(state, content.angle_type)
        if on_road and content.angle_type is AngleType.HEADING:
            value -= _reference_heading(state, content.coordinate_system)
        return abs(difference(value, content.angle)) <= content.tolerance

    return check


def prepare_relative_angle(content: RelativeAngleCondition, run: Run) -> EntityCheck:
    """Own angle minus that of another entity. [rad]"""
    other = run.entity(content.entity_ref, content.place)

    def check(state: EntityState) -> bool:
        if not other.active:
            return False
        value = _angle(state, content.angle_type) - _angle(other, content.angle_type)
        return abs(difference(value, content.angle)) <= content.tolerance

    return check


def _angle(state: EntityState, kind: AngleType) -> float:
    pose = state.pose
    if kind is AngleType.HEADING:
        return pose.heading
    return pose.pitch if kind is AngleType.PITCH else pose.roll


def _reference_heading(state: EntityState, system: CoordinateSystem | None) -> float:
    """Direction of the road's s-axis, or that in which the lane is driven. [rad]"""
    from math import pi

    heading = state.road_heading()
    if (
        system is CoordinateSystem.LANE
        and state.road >= 0
        and state.network.travel_direction(state.road, state.lane) < 0
    ):
        heading += pi
    return heading
