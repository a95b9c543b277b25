"""Global actions as a file says them: environment, parameters, variables, signals, entities that come and go."""

from __future__ import annotations

from enum import StrEnum

from msgspec import Struct

from xosc_lateral.scenario.environment import Environment
from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position


class EnvironmentAction(Struct, frozen=True):
    """Set the environment; parts that are None stay as they are."""

    environment: Environment
    place: Place


class ModifyOperation(StrEnum):
    """What a modify action does."""

    ADD = "AddValue"
    MULTIPLY = "MultiplyByValue"


class ParameterSetAction(Struct, frozen=True):
    """The parameter gets this value."""

    parameter_ref: str
    value: str
    place: Place


class ParameterModifyAction(Struct, frozen=True):
    """The parameter's number is changed."""

    parameter_ref: str
    operation: ModifyOperation
    value: float
    place: Place


class VariableSetAction(Struct, frozen=True):
    """The variable gets this value."""

    variable_ref: str
    value: str
    place: Place


class VariableModifyAction(Struct, frozen=True):
    """The variable's number is changed."""

    variable_ref: str
    operation: ModifyOperation
    value: float
    place: Place


class SetMonitorAction(Struct, frozen=True):
    """A monitor is set (1.3); nothing in playback reads it."""

    monitor_ref: str
    value: bool
    place: Place


class TrafficSignalStateAction(Struct, frozen=True):
    """One signal gets a state."""

    name: str
    state: str
    place: Place


class TrafficSignalControllerAction(Struct, frozen=True):
    """A signal controller goes to a phase."""

    controller_ref: str
    phase: str
    place: Place


class AddEntityAction(Struct, frozen=True):
    """The entity appears."""

    entity_ref: str
    position: Position
    place: Place


class DeleteEntityAction(Struct, frozen=True):
    """The entity is gone."""

    entity_ref: str
    place: Place


class TrafficAction(Struct, frozen=True):
    """Traffic source, sink, swarm, area, stop: kept and named, not played: its cars are the tool's own."""

    kind: str
    place: Place


class UserDefinedAction(Struct, frozen=True):
    """`type` and the text of a CustomCommandAction."""

    type: str
    content: str
    place: Place
