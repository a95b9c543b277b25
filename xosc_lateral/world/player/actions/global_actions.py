"""Global actions: environment, parameters, variables and signals, entities that come and go, and what is not played."""

from __future__ import annotations

from xosc_lateral.world.motion.nominal import Activity
from xosc_lateral.world.player.actions.base import AtOnce, Maker, at_once
from xosc_lateral.world.player.positions.resolve import resolve
from xosc_lateral.world.player.trailers import disconnect
from xosc_lateral.world.player.values import Values
from xosc_lateral.world.scenario import Unsupported
from xosc_lateral.world.scenario.global_actions import (
    AddEntityAction,
    DeleteEntityAction,
    EnvironmentAction,
    ParameterModifyAction,
    ParameterSetAction,
    SetMonitorAction,
    TrafficAction,
    TrafficSignalControllerAction,
    TrafficSignalStateAction,
    UserDefinedAction,
    VariableModifyAction,
    VariableSetAction,
)


def environment(content: EnvironmentAction, action: AtOnce) -> None:
    """Only the time of day matters to playback; the rest is recorded with the start of the action."""
    clock = content.environment.time_of_day
    if clock is not None:
        action.simulation.time_of_day = (clock.date_time, clock.animation, action.simulation.time)


def set_value(content: ParameterSetAction | VariableSetAction, action: AtOnce) -> None:
    """Conditions see the new value from now on; what was read from the file before does not change."""
    kind, values, name = _values(content, action)
    if name in values:
        values.set(name, content.value)
    else:
        action.note(f"{kind} '{name}' is not declared: nothing is set")


def modify_value(content: ParameterModifyAction | VariableModifyAction, action: AtOnce) -> None:
    """Add to a value, or multiply it."""
    kind, values, name = _values(content, action)
    if name not in values:
        action.note(f"{kind} '{name}' is not declared: nothing is modified")
    elif not values.modify(name, content.operation, content.value):
        action.note(f"{kind} '{name}' is not a number: nothing is modified")


def _values(
    content: ParameterSetAction | ParameterModifyAction | VariableSetAction | VariableModifyAction, action: AtOnce
) -> tuple[str, Values, str]:
    """What it is called in notes, all of its kind, and its name."""
    if isinstance(content, ParameterSetAction | ParameterModifyAction):
        return "parameter", action.simulation.parameters, content.parameter_ref
    return "variable", action.simulation.variables, content.variable_ref


def signal_state(content: TrafficSignalStateAction, action: AtOnce) -> None:
    """A signal shows a state from now on."""
    action.simulation.signals.set_state(content.name, content.state, action.simulation.time)


def signal_phase(content: TrafficSignalControllerAction, action: AtOnce) -> None:
    """A signal controller goes to a phase."""
    controller, phase = content.controller_ref, content.phase
    if not action.simulation.signals.go_to_phase(controller, phase, action.simulation.time):
        action.note(f"no signal controller '{controller}' with a phase '{phase}'")


def add_entity(content: AddEntityAction, action: AtOnce) -> None:
    """The entity appears at the position, with the speed that it had when it was taken out (at first: none)."""
    state = action.simulation.entity(content.entity_ref, content.place)
    if state.active:
        action.note(f"'{state.name}' exists already: it is not added")
        return
    state.active = True
    state.put(resolve(content.position, action.simulation))
    state.teleported = True
    state.activity = Activity.ACTIVE | Activity.TELEPORTED


def delete_entity(content: DeleteEntityAction, action: AtOnce) -> None:
    """The entity is gone, and with it what it was doing; trailers are left behind."""
    state = action.simulation.entity(content.entity_ref, content.place)
    state.active = False
    state.activity = 0
    disconnect(state)
    if state.tow is not None:
        disconnect(state.tow)
    for running in state.actions:
        if running.is_running:
            running.end()


def traffic(content: TrafficAction, action: AtOnce) -> None:
    """Traffic of a tool's own making: no file says where its cars are."""
    action.note(f"{content.kind}: its vehicles are made by the simulator and are not played")


def unsupported(content: Unsupported, action: AtOnce) -> None:
    """Named, and over at once."""
    action.note(content.reason or f"{content.kind} is not played")


def recorded(content: object, action: AtOnce) -> None:
    """The start is recorded like that of every action; nothing moves."""


RUNNING: dict[type, Maker] = {
    EnvironmentAction: at_once(environment),
    ParameterModifyAction: at_once(modify_value),
    ParameterSetAction: at_once(set_value),
    TrafficSignalControllerAction: at_once(signal_phase),
    TrafficSignalStateAction: at_once(signal_state),
    VariableModifyAction: at_once(modify_value),
    VariableSetAction: at_once(set_value),
    AddEntityAction: at_once(add_entity),
    DeleteEntityAction: at_once(delete_entity),
    SetMonitorAction: at_once(recorded),
    TrafficAction: at_once(traffic),
    Unsupported: at_once(unsupported),
    UserDefinedAction: at_once(recorded),
}
