"""Global actions as a file says them, and the environment that they set."""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum
from typing import Annotated

from msgspec import Struct

from xosc_lateral.world.scenario.place import Content, EntityRef, Name, ParameterRef, called
from xosc_lateral.world.scenario.position import Position


class EnvironmentAction(Content, frozen=True):
    """Set the environment; parts that are None stay as they are."""

    environment: Annotated[Environment, called("")]


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


# ---- The environment as far as a driver may react to it ----
class TimeOfDay(Struct, frozen=True):
    """Date and time; `animation`: it goes on with simulation time."""

    date_time: datetime
    animation: bool


class Weather(Struct, frozen=True):
    """Parts that a file does not state are None."""

    illuminance: Annotated[float | None, called("Sun/illuminance", "Sun/intensity")] = None
    """Of the sun (`intensity` up to 1.1). [lx]"""
    precipitation_type: Annotated[str | None, called("Precipitation/precipitationType")] = None
    """``dry``, ``rain``, ``snow``."""
    precipitation_intensity: float | None = None
    """mm/h; from 1.1: version 1.0 has a share without a unit."""
    wind_speed: Annotated[float | None, called("Wind/speed")] = None
    wind_direction: Annotated[float | None, called("Wind/direction")] = None
    """[m/s], [rad]: direction is where the wind blows to, counter-clockwise from world x."""


class Environment(Content, frozen=True):
    """A named environment; parts that a file does not state are None."""

    name: Name
    time_of_day: TimeOfDay | None = None
    weather: Weather | None = None
    friction_scale_factor: Annotated[float | None, called("RoadCondition/frictionScaleFactor")] = None
