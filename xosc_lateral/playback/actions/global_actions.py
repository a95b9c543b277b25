"""Global actions: environment, parameters, variables and signals, entities that come and go, and what is not played."""

from __future__ import annotations

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.playback.positions.resolve import resolve
from xosc_lateral.playback.storyboard import ActionElement, ElementState
from xosc_lateral.playback.trailers import disconnect
from xosc_lateral.scenario import Unsupported
from xosc_lateral.scenario.global_actions import (
    AddEntityAction,
    DeleteEntityAction,
    EnvironmentAction,
    ParameterModifyAction,
    ParameterSetAction,
    TrafficAction,
    TrafficSignalControllerAction,
    TrafficSignalStateAction,
    VariableModifyAction,
    VariableSetAction,
)


class RunningEnvironment(RunningAction):
    """Only the time of day matters to playback; the rest is recorded with the start of the action."""

    content: EnvironmentAction

    def start(self) -> None:
        """Set the clock."""
        clock = self.content.environment.time_of_day
        if clock is not None:
            self.simulation.time_of_day = (clock.date_time, clock.animation, self.simulation.time)


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


class RunningAddEntity(RunningAction):
    """The entity appears at the position, with the speed that it had when it was taken out (at first: none)."""

    content: AddEntityAction

    def start(self) -> None:
        """Put it there; one that exists already is left alone."""
        state = self.simulation.entity(self.content.entity_ref, self.content.place)
        if state.active:
            self.note(f"'{state.name}' exists already: it is not added")
            return
        state.active = True
        state.put(resolve(self.content.position, self.simulation))
        state.teleported = True
        state.activity = Activity.ACTIVE | Activity.TELEPORTED


class RunningDeleteEntity(RunningAction):
    """The entity is gone, and with it what it was doing."""

    content: DeleteEntityAction

    def start(self) -> None:
        """Take it out; trailers are left behind."""
        state = self.simulation.entity(self.content.entity_ref, self.content.place)
        state.active = False
        state.activity = 0
        disconnect(state)
        if state.tow is not None:
            disconnect(state.tow)
        for element in (*state.init_actions, *state.event_actions):
            assert isinstance(element, ActionElement)
            if element.state is ElementState.RUNNING:
                element.end()


class RunningTraffic(RunningAction):
    """Traffic of a tool's own making: no file says where its cars are."""

    content: TrafficAction

    def start(self) -> None:
        """Say that there is none."""
        self.note(f"{self.content.kind}: its vehicles are made by the simulator and are not played")


class RunningUnsupported(RunningAction):
    """Named, and over at once."""

    content: Unsupported

    def start(self) -> None:
        """Say so."""
        self.note(self.content.reason or f"{self.content.kind} is not played")


RUNNING: dict[type, type[RunningAction]] = {
    EnvironmentAction: RunningEnvironment,
    ParameterModifyAction: RunningParameterModify,
    ParameterSetAction: RunningParameterSet,
    TrafficSignalControllerAction: RunningSignalController,
    TrafficSignalStateAction: RunningSignalState,
    VariableModifyAction: RunningVariableModify,
    VariableSetAction: RunningVariableSet,
    AddEntityAction: RunningAddEntity,
    DeleteEntityAction: RunningDeleteEntity,
    TrafficAction: RunningTraffic,
    Unsupported: RunningUnsupported,
}
