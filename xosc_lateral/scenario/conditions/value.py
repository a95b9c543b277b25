"""Conditions on time, parameters, variables, signals and the storyboard itself."""

from __future__ import annotations

from datetime import datetime

from msgspec import Struct

from xosc_lateral.scenario.enums import ConditionEdge, Rule, StoryboardElementState, StoryboardElementType
from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.trigger import Condition, ConditionGroup, Trigger


class ParameterCondition(Struct, frozen=True):
    """`value` is text: numbers are compared as numbers where both are."""

    parameter_ref: str
    value: str
    rule: Rule
    place: Place


class VariableCondition(Struct, frozen=True):
    """`value` is text: numbers are compared as numbers where both are."""

    variable_ref: str
    value: str
    rule: Rule
    place: Place


class SimulationTimeCondition(Struct, frozen=True):
    """[s]"""

    value: float
    rule: Rule
    place: Place


def at_time(moment: float, name: str, place: Place) -> Trigger:
    """Trigger of our own that holds from a moment on. [s]"""
    condition = SimulationTimeCondition(moment, Rule.GREATER_THAN, place)
    return Trigger((ConditionGroup((Condition(name, 0.0, ConditionEdge.NONE, condition, None, place),)),), place)


class TimeOfDayCondition(Struct, frozen=True):
    """Against the environment's clock."""

    date_time: datetime
    rule: Rule
    place: Place


class StoryboardElementStateCondition(Struct, frozen=True):
    """State or transition of a storyboard element; `element_ref` is the trailing part of ``story::act::...::name``."""

    element_type: StoryboardElementType
    element_ref: str
    state: StoryboardElementState
    place: Place


class TrafficSignalCondition(Struct, frozen=True):
    """A signal shows a state."""

    name: str
    state: str
    place: Place


class TrafficSignalControllerCondition(Struct, frozen=True):
    """A signal controller is in a phase."""

    controller_ref: str
    phase: str
    place: Place


class UserDefinedValueCondition(Struct, frozen=True):
    """A value from outside: never known while playing."""

    name: str
    value: str
    rule: Rule
    place: Place
