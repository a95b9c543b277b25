"""Conditions on values: clocks, parameters, variables, signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from xosc_lateral.world.player.simulation import Simulation, holds
from xosc_lateral.world.player.storyboard import Check, Checks, StoryboardElement, Watch, last_name
from xosc_lateral.world.scenario import conditions
from xosc_lateral.world.scenario.enums import StoryboardElementState as State


def prepare_simulation_time(content: conditions.SimulationTimeCondition, simulation: Simulation) -> Check:
    """Compare the time at the start of the frame. [s]"""
    return lambda: holds(simulation.time, content.rule, content.value)


def prepare_time_of_day(content: conditions.TimeOfDayCondition, simulation: Simulation) -> Check:
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


def prepare_value(
    content: conditions.ParameterCondition | conditions.VariableCondition, simulation: Simulation
) -> Check:
    """Compare in the type of the parameter or variable; false for one that is not declared globally."""
    values, name = simulation.values_of(content)

    def check() -> bool:
        if name not in values:
            simulation.note(f"{values.kind} '{name}' is not declared: the condition stays false", content.place)
            return False
        return values.compare(name, content.rule, content.value)

    return check


def prepare_signal(content: conditions.TrafficSignalCondition, simulation: Simulation) -> Check:
    """Whether the signal shows that state (of its controller's phase, or set by an action)."""
    return lambda: simulation.signals.state(content.name, simulation.time) == content.state


def prepare_controller(content: conditions.TrafficSignalControllerCondition, simulation: Simulation) -> Check:
    """Whether the controller is in that phase."""
    return lambda: simulation.signals.phase(content.controller_ref, simulation.time) == content.phase


def prepare_user_defined(content: conditions.UserDefinedValueCondition, simulation: Simulation) -> Check:
    """Always false, which is said."""
    simulation.note(f"value '{content.name}' comes from outside the scenario: the condition stays false", content.place)
    return lambda: False


# ---- StoryboardElementStateCondition ----
class StateWatch(Watch):
    """Changes of one element since the last look.

    Any change since then that matches counts, also one that was passed through; without changes the last state goes on
    to count, but not its transition, which lasts for one look only.
    """

    def __init__(self, content: conditions.StoryboardElementStateCondition, simulation: Simulation) -> None:
        self._content = content
        self._simulation = simulation
        self._changes: list[tuple[State, State | None]] = []
        self._last: State | None = None

    def find(self, named: Mapping[str, Sequence[StoryboardElement]]) -> None:
        """Look for the element: the first whose path ends in the reference; `named`: by `last_name`."""
        kind, reference = self._content.element_type, self._content.element_ref
        for element in named.get(last_name(reference), ()):
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


def prepare_element_state(content: conditions.StoryboardElementStateCondition, simulation: Simulation) -> Check:
    """A watch; it finds its element once the storyboard stands."""
    watch = StateWatch(content, simulation)
    simulation.when_built.append(watch.find)
    return watch


CHECKS: Checks = {
    conditions.SimulationTimeCondition: prepare_simulation_time,
    conditions.TimeOfDayCondition: prepare_time_of_day,
    conditions.ParameterCondition: prepare_value,
    conditions.VariableCondition: prepare_value,
    conditions.TrafficSignalCondition: prepare_signal,
    conditions.TrafficSignalControllerCondition: prepare_controller,
    conditions.UserDefinedValueCondition: prepare_user_defined,
    conditions.StoryboardElementStateCondition: prepare_element_state,
}
