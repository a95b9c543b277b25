"""All conditions that can be played: what the file says -> how it is checked."""

from __future__ import annotations

from xosc_lateral.world.player.conditions import (
    angle,
    distance,
    motion,
    relative_clearance,
    storyboard_element_state,
    value,
)
from xosc_lateral.world.player.conditions.base import EntityCheck, EntityChecks, ValueChecks
from xosc_lateral.world.player.conditions.storyboard_element_state import StateWatch
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.player.trigger import Check, RunningCondition, RunningTrigger
from xosc_lateral.world.scenario import Condition, Trigger, Unsupported
from xosc_lateral.world.scenario.enums import TriggeringEntitiesRule

ENTITY_CHECKS: EntityChecks = {
    content: check
    for family in (angle, distance, motion, relative_clearance)
    for content, check in family.CHECKS.items()
}
VALUE_CHECKS: ValueChecks = {
    content: check for family in (storyboard_element_state, value) for content, check in family.CHECKS.items()
}


def prepare_trigger(trigger: Trigger, simulation: Simulation, *, when_empty: bool) -> RunningTrigger:
    """A trigger ready to be evaluated frame by frame."""
    groups = tuple(tuple(_prepare(condition, simulation) for condition in group.conditions) for group in trigger.groups)
    return RunningTrigger(groups, when_empty=when_empty)


def _prepare(condition: Condition, simulation: Simulation) -> RunningCondition:
    check = _check(condition, simulation)
    watch = check if isinstance(check, StateWatch) else None
    return RunningCondition(check, condition.edge, condition.delay, watch)


def _check(condition: Condition, simulation: Simulation) -> Check:
    content = condition.content
    if isinstance(content, Unsupported):
        simulation.note(content.reason or f"{content.kind} can't be played: the condition stays false", content.place)
        return lambda: False
    if type(content) in VALUE_CHECKS:
        return VALUE_CHECKS[type(content)](content, simulation)
    check = ENTITY_CHECKS[type(content)](content, simulation)
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
