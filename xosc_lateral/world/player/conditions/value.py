"""Conditions on values: clocks, parameters, variables, signals."""

from __future__ import annotations

from xosc_lateral.world.player.conditions.base import ValueCheck, ValueChecks
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.values import Values, holds
from xosc_lateral.world.scenario.conditions import (
    ParameterCondition,
    SimulationTimeCondition,
    TimeOfDayCondition,
    TrafficSignalCondition,
    TrafficSignalControllerCondition,
    UserDefinedValueCondition,
    VariableCondition,
)


def prepare_simulation_time(content: SimulationTimeCondition, simulation: Simulation) -> ValueCheck:
    """Compare the time at the start of the frame. [s]"""
    return lambda: holds(simulation.time, content.rule, content.value)


def prepare_time_of_day(content: TimeOfDayCondition, simulation: Simulation) -> ValueCheck:
    """False while no environment has said what time it is."""

    def check() -> bool:
        now = simulation.clock()
        if now is None:
            simulation.note("no environment has set the time of day: the condition stays false", content.place)
            return False
        then = content.date_time
        if (now.tzinfo is None) != (then.tzinfo is None):
            now, then = now.replace(tzinfo=None), then.replace(tzinfo=None)
        return holds((now - then).total_seconds(), content.rule, 0.0)

    return check


def prepare_parameter(content: ParameterCondition, simulation: Simulation) -> ValueCheck:
    """Compare in the parameter's own type; false for a parameter that is not declared globally."""
    return _declared(content, content.parameter_ref, "parameter", simulation.parameters, simulation)


def prepare_variable(content: VariableCondition, simulation: Simulation) -> ValueCheck:
    """Compare in the variable's own type; false for a variable that is not declared."""
    return _declared(content, content.variable_ref, "variable", simulation.variables, simulation)


def _declared(
    content: ParameterCondition | VariableCondition, name: str, kind: str, values: Values, simulation: Simulation
) -> ValueCheck:
    def check() -> bool:
        if name not in values:
            simulation.note(f"{kind} '{name}' is not declared: the condition stays false", content.place)
            return False
        return values.compare(name, content.rule, content.value)

    return check


def prepare_signal(content: TrafficSignalCondition, simulation: Simulation) -> ValueCheck:
    """Whether the signal shows that state (of its controller's phase, or set by an action)."""
    return lambda: simulation.signals.state(content.name, simulation.time) == content.state


def prepare_controller(content: TrafficSignalControllerCondition, simulation: Simulation) -> ValueCheck:
    """Whether the controller is in that phase."""
    return lambda: simulation.signals.phase(content.controller_ref, simulation.time) == content.phase


def prepare_user_defined(content: UserDefinedValueCondition, simulation: Simulation) -> ValueCheck:
    """Always false, which is said."""
    simulation.note(f"value '{content.name}' comes from outside the scenario: the condition stays false", content.place)
    return lambda: False


CHECKS: ValueChecks = {
    SimulationTimeCondition: prepare_simulation_time,
    TimeOfDayCondition: prepare_time_of_day,
    ParameterCondition: prepare_parameter,
    VariableCondition: prepare_variable,
    TrafficSignalCondition: prepare_signal,
    TrafficSignalControllerCondition: prepare_controller,
    UserDefinedValueCondition: prepare_user_defined,
}
