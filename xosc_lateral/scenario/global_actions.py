"""Global actions as a file says them: environment, parameters, variables, signals, entities that come and go."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from xosc_lateral.scenario.environment import Environment
from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position


@dataclass(frozen=True, slots=True)
class EnvironmentAction:
    """Set the environment; parts that are None stay as they are."""

    environment: Environment
    place: Place


class ModifyOperation(StrEnum):
    """What a modify action does."""

    ADD = "AddValue"
    MULTIPLY = "MultiplyByValue"


@dataclass(frozen=True, slots=True)
class ParameterSetAction:
    """The parameter gets this value."""

    parameter_ref: str
    value: str
    place: Place


@dataclass(frozen=True, slots=True)
class ParameterModifyAction:
    """The parameter's number is changed."""

    parameter_ref: str
    operation: ModifyOperation
    value: float
    place: Place


@dataclass(frozen=True, slots=True)
class VariableSetAction:
    """The variable gets this value."""

    variable_ref: str
    value: str
    place: Place


@dataclass(frozen=True, slots=True)
class VariableModifyAction:
    """The variable's number is changed."""

    variable_ref: str
    operation: ModifyOperation
    value: float
    place: Place


@dataclass(frozen=True, slots=True)
class SetMonitorAction:
    """A monitor is set (1.3); nothing in playback reads it."""

    monitor_ref: str
    value: bool
    place: Place


@dataclass(frozen=True, slots=True)
class TrafficSignalStateAction:
    """One signal gets a state."""

    name: str
    state: str
    place: Place


@dataclass(frozen=True, slots=True)
class TrafficSignalControllerAction:
    """A signal controller goes to a phase."""

    controller_ref: str
    phase: str
    place: Place


@dataclass(frozen=True, slots=True)
class AddEntityAction:
    """The entity appears."""

    entity_ref: str
    position: Position
    place: Place


@dataclass(frozen=True, slots=True)
class DeleteEntityAction:
    """The entity is gone."""

    entity_ref: str
    place: Place


@dataclass(frozen=True, slots=True)
class TrafficAction:
    """Traffic source, sink, swarm, area, stop: kept and named, not played: its cars are the tool's own."""

    kind: str
    place: Place


@dataclass(frozen=True, slots=True)
class UserDefinedAction:
    """`type` and the text of a CustomCommandAction."""

    type: str
    content: str
    place: Place
