"""Arrive at a place when another entity arrives at its own."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.enums import SpeedTargetValueType
from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position


class SteadyState(Struct, frozen=True):
    """The final speed holds for this `distance` [m] or `time` [s] before the target (one of them)."""

    distance: float | None = None
    time: float | None = None


class AbsoluteSpeed(Struct, frozen=True):
    """[m/s]"""

    value: float
    steady_state: SteadyState | None = None


class RelativeSpeedToMaster(Struct, frozen=True):
    """From the master's speed: plus `value` [m/s] or times `value` [-]."""

    value: float
    value_type: SpeedTargetValueType
    steady_state: SteadyState | None = None


class SynchronizeAction(Struct, frozen=True):
    """Tolerances None: not said. [m]"""

    master_entity_ref: str
    target_position_master: Position
    target_position: Position
    place: Place
    final_speed: AbsoluteSpeed | RelativeSpeedToMaster | None = None
    target_tolerance_master: float | None = None
    target_tolerance: float | None = None
