"""Conditions on values: clocks, parameters, variables, signals."""

from __future__ import annotations

from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.storyboard import StoryboardElement, ValueCheck, ValueChecks, Watch
from xosc_lateral.world.player.values import Values, holds
from xosc_lateral.world.scenario.conditions import (
    ParameterCondition,
    SimulationTimeCondition,
    StoryboardElementStateCondition,
    TimeOfDayCondition,
    TrafficSignalCondition,
    TrafficSignalControllerCondition,
    UserDefinedValueCondition,
    VariableCondition,
)
from xosc_lateral.world.scenario.enums import StoryboardElementState as State


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


# ---- StoryboardElementStateCondition ----
class StateWatch(Watch):
    """Changes of one element since the last look.

    Any change since then that matches counts, also one that was passed through; without changes the last state goes on
    to count, but not its transition, which lasts for one look only.
    """

    def __init__(self, content: StoryboardElementStateCondition, simulation: Simulation) -> None:
        self._content = content
        self._simulation = simulation
        self._changes: list[tuple[State, State | None]] = []
        self._last: State | None = None

    def find(self, root: StoryboardElement) -> None:
        """Look for the element: the first whose path ends in the reference."""
        kind, reference = self._content.element_type, self._content.element_ref
        for element in root.walk():
            if (
                element.kind is kind
                and len(reference) >= len(element.name)
                and "::".join(element.path).endswith(reference)
            ):
                element.watchers.append(self._note)
                return
        what = f"no {kind.value} '{reference}' in the storyboard: the condition stays false"
        self._simulation.note(what, self._content.place)

    def _note(self, state: State, transition: State | None) -> None:
        self._changes.append((state, transition))
        self.is_settled = False
        if self.wake is not None:
            self.wake()

    def forget(self) -> None:
        """Leave changes that nobody has looked at aside."""
        self._changes.clear()

    def __call__(self) -> bool:
        """Whether the element is, or was since the last look, in the wanted state."""
        wanted = self._content.state
        self.is_settled = not self._changes
        if not self._changes:
            return self._last is wanted
        changes, self._changes = self._changes, []
        self._last = changes[-1][0]
        return any(wanted in change for change in changes)


def prepare_storyboard_element_state(content: StoryboardElementStateCondition, simulation: Simulation) -> ValueCheck:
    """A watch; it finds its element once the storyboard stands."""
    watch = StateWatch(content, simulation)
    simulation.when_built.append(watch.find)
    return watch


CHECKS: ValueChecks = {
    SimulationTimeCondition: prepare_simulation_time,
    TimeOfDayCondition: prepare_time_of_day,
    ParameterCondition: prepare_parameter,
    VariableCondition: prepare_variable,
    TrafficSignalCondition: prepare_signal,
    TrafficSignalControllerCondition: prepare_controller,
    UserDefinedValueCondition: prepare_user_defined,
    StoryboardElementStateCondition: prepare_storyboard_element_state,
}
