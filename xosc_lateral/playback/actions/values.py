"""Actions on parameters, variables, monitors and traffic signals."""

from __future__ import annotations

from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.scenario.actions.infrastructure import TrafficSignalControllerAction, TrafficSignalStateAction
from xosc_lateral.scenario.actions.values import (
    ParameterModifyAction,
    ParameterSetAction,
    VariableModifyAction,
    VariableSetAction,
)


class RunningParameterSet(RunningAction):
    """Conditions see the new value from now on; what was read from the file before does not change."""

    content: ParameterSetAction

    def start(self) -> None:
        """Set it."""
        if self.content.parameter_ref in self.simulation.parameters:
            self.simulation.parameters.set(self.content.parameter_ref, self.content.value)
        else:
            self.note(f"parameter '{self.content.parameter_ref}' is not declared: nothing is set")


class RunningParameterModify(RunningAction):
    """Add to a parameter, or multiply it."""

    content: ParameterModifyAction

    def start(self) -> None:
        """Modify it."""
        name = self.content.parameter_ref
        if name not in self.simulation.parameters:
            self.note(f"parameter '{name}' is not declared: nothing is modified")
        elif not self.simulation.parameters.modify(name, self.content.operation, self.content.value):
            self.note(f"parameter '{name}' is not a number: nothing is modified")


class RunningVariableSet(RunningAction):
    """Conditions see the new value from now on."""

    content: VariableSetAction

    def start(self) -> None:
        """Set it."""
        if self.content.variable_ref in self.simulation.variables:
            self.simulation.variables.set(self.content.variable_ref, self.content.value)
        else:
            self.note(f"variable '{self.content.variable_ref}' is not declared: nothing is set")


class RunningVariableModify(RunningAction):
    """Add to a variable, or multiply it."""

    content: VariableModifyAction

    def start(self) -> None:
        """Modify it."""
        name = self.content.variable_ref
        if name not in self.simulation.variables:
            self.note(f"variable '{name}' is not declared: nothing is modified")
        elif not self.simulation.variables.modify(name, self.content.operation, self.content.value):
            self.note(f"variable '{name}' is not a number: nothing is modified")


class RunningSignalState(RunningAction):
    """A signal shows a state from now on."""

    content: TrafficSignalStateAction

    def start(self) -> None:
        """Set it."""
        self.simulation.signals.set_state(self.content.name, self.content.state, self.simulation.time)


class RunningSignalController(RunningAction):
    """A signal controller goes to a phase."""

    content: TrafficSignalControllerAction

    def start(self) -> None:
        """Send it there."""
        if not self.simulation.signals.go_to_phase(
            self.content.controller_ref, self.content.phase, self.simulation.time
        ):
            self.note(f"no signal controller '{self.content.controller_ref}' with a phase '{self.content.phase}'")


RUNNING: dict[type, type[RunningAction]] = {
    ParameterModifyAction: RunningParameterModify,
    ParameterSetAction: RunningParameterSet,
    TrafficSignalControllerAction: RunningSignalController,
    TrafficSignalStateAction: RunningSignalState,
    VariableModifyAction: RunningVariableModify,
    VariableSetAction: RunningVariableSet,
}
