"""Global actions: environment, parameters, variables and signals, entities that come and go, and what is not played."""

from __future__ import annotations

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.playback.positions.resolve import resolve
from xosc_lateral.playback.trailers import disconnect
from xosc_lateral.playback.values import Values
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

    def _begin(self) -> None:
        clock = self.content.environment.time_of_day
        if clock is not None:
            self.simulation.time_of_day = (clock.date_time, clock.animation, self.simulation.time)


class _OfValue(RunningAction):
    """About a parameter or a variable."""

    @property
    def _values(self) -> tuple[str, Values, str]:
        """What it is called in notes, all of its kind, and its name."""
        if isinstance(self.content, ParameterSetAction | ParameterModifyAction):
            return "parameter", self.simulation.parameters, self.content.parameter_ref
        return "variable", self.simulation.variables, self.content.variable_ref


class RunningSet(_OfValue):
    """Conditions see the new value from now on; what was read from the file before does not change."""

    content: ParameterSetAction | VariableSetAction

    def _begin(self) -> None:
        kind, values, name = self._values
        if name in values:
            values.set(name, self.content.value)
        else:
            self._note(f"{kind} '{name}' is not declared: nothing is set")


class RunningModify(_OfValue):
    """Add to a value, or multiply it."""

    content: ParameterModifyAction | VariableModifyAction

    def _begin(self) -> None:
        kind, values, name = self._values
        if name not in values:
            self._note(f"{kind} '{name}' is not declared: nothing is modified")
        elif not values.modify(name, self.content.operation, self.content.value):
            self._note(f"{kind} '{name}' is not a number: nothing is modified")


class RunningSignalState(RunningAction):
    """A signal shows a state from now on."""

    content: TrafficSignalStateAction

    def _begin(self) -> None:
        self.simulation.signals.set_state(self.content.name, self.content.state, self.simulation.time)


class RunningSignalController(RunningAction):
    """A signal controller goes to a phase."""

    content: TrafficSignalControllerAction

    def _begin(self) -> None:
        controller, phase = self.content.controller_ref, self.content.phase
        if not self.simulation.signals.go_to_phase(controller, phase, self.simulation.time):
            self._note(f"no signal controller '{controller}' with a phase '{phase}'")


class RunningAddEntity(RunningAction):
    """The entity appears at the position, with the speed that it had when it was taken out (at first: none)."""

    content: AddEntityAction

    def _begin(self) -> None:
        state = self.simulation.entity(self.content.entity_ref, self.content.place)
        if state.active:
            self._note(f"'{state.name}' exists already: it is not added")
            return
        state.active = True
        state.put(resolve(self.content.position, self.simulation))
        state.teleported = True
        state.activity = Activity.ACTIVE | Activity.TELEPORTED


class RunningDeleteEntity(RunningAction):
    """The entity is gone, and with it what it was doing; trailers are left behind."""

    content: DeleteEntityAction

    def _begin(self) -> None:
        state = self.simulation.entity(self.content.entity_ref, self.content.place)
        state.active = False
        state.activity = 0
        disconnect(state)
        if state.tow is not None:
            disconnect(state.tow)
        for action in state.actions:
            if action.is_running:
                action.end()


class RunningTraffic(RunningAction):
    """Traffic of a tool's own making: no file says where its cars are."""

    content: TrafficAction

    def _begin(self) -> None:
        self._note(f"{self.content.kind}: its vehicles are made by the simulator and are not played")


class RunningUnsupported(RunningAction):
    """Named, and over at once."""

    content: Unsupported

    def _begin(self) -> None:
        self._note(self.content.reason or f"{self.content.kind} is not played")


RUNNING: dict[type, type[RunningAction]] = {
    EnvironmentAction: RunningEnvironment,
    ParameterModifyAction: RunningModify,
    ParameterSetAction: RunningSet,
    TrafficSignalControllerAction: RunningSignalController,
    TrafficSignalStateAction: RunningSignalState,
    VariableModifyAction: RunningModify,
    VariableSetAction: RunningSet,
    AddEntityAction: RunningAddEntity,
    DeleteEntityAction: RunningDeleteEntity,
    TrafficAction: RunningTraffic,
    Unsupported: RunningUnsupported,
}
