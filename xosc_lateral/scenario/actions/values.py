"""Parameters, variables, monitors changed while playing."""

from __future__ import annotations

from enum import StrEnum

from msgspec import Struct

from xosc_lateral.scenario.place import Place


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
