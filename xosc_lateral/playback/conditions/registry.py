"""All conditions that can be played: what the file says -> how it is checked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from xosc_lateral.playback.conditions import (
    acceleration,
    angle,
    collision,
    distance,
    lasting,
    parameter,
    reach_position,
    relative_clearance,
    relative_distance,
    relative_speed,
    simulation_time,
    speed,
    storyboard_element_state,
    time_headway,
    time_of_day,
    time_to_collision,
    traffic_signal,
    traveled_distance,
    user_defined,
    variable,
)
from xosc_lateral.playback.conditions.base import EntityCheck
from xosc_lateral.playback.conditions.storyboard_element_state import StateWatch
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.trigger import Check, RunningCondition, RunningTrigger
from xosc_lateral.scenario import Condition, Trigger, Unsupported
from xosc_lateral.scenario import conditions as written
from xosc_lateral.scenario.enums import TriggeringEntitiesRule

ENTITY_CONDITIONS: tuple[tuple[type, Callable[[Any, Simulation], EntityCheck]], ...] = (
    (written.AccelerationCondition, acceleration.prepare),
    (written.AngleCondition, angle.prepare_angle),
    (written.CollisionCondition, collision.prepare),
    (written.DistanceCondition, distance.prepare),
    (written.EndOfRoadCondition, lasting.prepare_end_of_road),
    (written.OffroadCondition, lasting.prepare_offroad),
    (written.ReachPositionCondition, reach_position.prepare),
    (written.RelativeAngleCondition, angle.prepare_relative_angle),
    (written.RelativeClearanceCondition, relative_clearance.prepare),
    (written.RelativeDistanceCondition, relative_distance.prepare),
    (written.RelativeSpeedCondition, relative_speed.prepare),
    (written.SpeedCondition, speed.prepare),
    (written.StandStillCondition, lasting.prepare_stand_still),
    (written.TimeHeadwayCondition, time_headway.prepare),
    (written.TimeToCollisionCondition, time_to_collision.prepare),
    (written.TraveledDistanceCondition, traveled_distance.prepare),
)
VALUE_CONDITIONS: tuple[tuple[type, Callable[[Any, Simulation], Check]], ...] = (
    (written.ParameterCondition, parameter.prepare),
    (written.SimulationTimeCondition, simulation_time.prepare),
    (written.StoryboardElementStateCondition, storyboard_element_state.prepare),
    (written.TimeOfDayCondition, time_of_day.prepare),
    (written.TrafficSignalCondition, traffic_signal.prepare_signal),
    (written.TrafficSignalControllerCondition, traffic_signal.prepare_controller),
    (written.UserDefinedValueCondition, user_defined.prepare),
    (written.VariableCondition, variable.prepare),
)

_ENTITY = dict(ENTITY_CONDITIONS)
_VALUE = dict(VALUE_CONDITIONS)


def prepare_trigger(trigger: Trigger, simulation: Simulation, *, when_empty: bool) -> RunningTrigger:
    """A trigger ready to be evaluated frame by frame."""
    groups = tuple(tuple(_prepare(condition, simulation) for condition in group.conditions) for group in trigger.groups)
    return RunningTrigger(groups, when_empty=when_empty)


def _prepare(condition: Condition, simulation: Simulation) -> RunningCondition:
    check = _check(condition, simulation)
    forget = check.forget if isinstance(check, StateWatch) else None
    return RunningCondition(check, condition.edge, condition.delay, forget)


def _check(condition: Condition, simulation: Simulation) -> Check:
    content = condition.content
    if isinstance(content, Unsupported):
        simulation.note(content.reason or f"{content.kind} can't be played: the condition stays false", content.place)
        return lambda: False
    if type(content) in _VALUE:
        return _VALUE[type(content)](content, simulation)
    check = _ENTITY[type(content)](content, simulation)
    who = condition.triggering_entities
    states = () if who is None else tuple(simulation.entity(name, condition.place) for name in who.entity_refs)
    if who is not None and who.rule is TriggeringEntitiesRule.ALL:
        return lambda: _all(check, states)
    if len(states) == 1:
        only = states[0]
        return lambda: only.active and check(only)
    return lambda: any(state.active and check(state) for state in states)


def _all(check: EntityCheck, states: tuple[EntityState, ...]) -> bool:
    """Entities that don't exist are passed over; without any that does, nothing holds."""
    active = [state for state in states if state.active]
    return bool(active) and all(check(state) for state in active)
