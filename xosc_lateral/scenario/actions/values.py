"""Parameters, variables, monitors changed while playing."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from xosc_lateral.scenario.place import Place


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
