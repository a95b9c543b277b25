"""Global actions as a file says them: environment, parameters, variables, signals, entities that come and go."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

from xosc_lateral.world.scenario.environment import Environment
from xosc_lateral.world.scenario.place import Content, EntityRef, ParameterRef, called
from xosc_lateral.world.scenario.position import Position


class EnvironmentAction(Content, frozen=True):
    """Set the environment; parts that are None stay as they are."""

    environment: Environment


class ModifyOperation(StrEnum):
    """What a modify action does."""

    ADD = "AddValue"
    MULTIPLY = "MultiplyByValue"


class ParameterSetAction(Content, frozen=True):
    """The parameter gets this value."""

    parameter_ref: ParameterRef
    value: str


class ParameterModifyAction(Content, frozen=True):
    """The parameter's number is changed."""

    parameter_ref: ParameterRef
    operation: ModifyOperation
    value: float


class VariableSetAction(Content, frozen=True):
    """The variable gets this value."""

    variable_ref: ParameterRef
    value: str


class VariableModifyAction(Content, frozen=True):
    """The variable's number is changed."""

    variable_ref: ParameterRef
    operation: ModifyOperation
    value: float


class SetMonitorAction(Content, frozen=True):
    """A monitor is set (1.3); nothing in playback reads it."""

    monitor_ref: str
    value: bool


class TrafficSignalStateAction(Content, frozen=True):
    """One signal gets a state."""

    name: str
    state: str


class TrafficSignalControllerAction(Content, frozen=True):
    """A signal controller goes to a phase."""

    controller_ref: Annotated[str, called("trafficSignalControllerRef")]
    phase: str


class AddEntityAction(Content, frozen=True):
    """The entity appears."""

    entity_ref: EntityRef
    position: Position


class DeleteEntityAction(Content, frozen=True):
    """The entity is gone."""

    entity_ref: EntityRef


class TrafficAction(Content, frozen=True):
    """Traffic source, sink, swarm, area, stop: kept and named, not played: its cars are the tool's own."""

    kind: str


class UserDefinedAction(Content, frozen=True):
    """`type` and the text of a CustomCommandAction."""

    type: str
    content: str
