"""Speed, speed profile, longitudinal distance."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.dynamics import DynamicConstraints, TransitionDynamics
from xosc_lateral.scenario.enums import (
    CoordinateSystem,
    FollowingMode,
    LongitudinalDisplacement,
    SpeedTargetValueType,
)
from xosc_lateral.scenario.place import Place


class AbsoluteTargetSpeed(Struct, frozen=True):
    """[m/s]"""

    value: float


class RelativeTargetSpeed(Struct, frozen=True):
    """From an entity's speed: plus `value` [m/s] or times `value` [-]; `continuous`: for ever."""

    entity_ref: str
    value: float
    value_type: SpeedTargetValueType
    continuous: bool


class SpeedAction(Struct, frozen=True):
    """Go to a speed."""

    target: AbsoluteTargetSpeed | RelativeTargetSpeed
    dynamics: TransitionDynamics
    place: Place


class SpeedProfileEntry(Struct, frozen=True):
    """A speed [m/s] and the time since the entry before [s]; None: as fast as the constraints allow."""

    speed: float
    time: float | None


class SpeedProfileAction(Struct, frozen=True):
    """Speeds over time; with `entity_ref`, relative to that entity's speed."""

    entries: tuple[SpeedProfileEntry, ...]
    following_mode: FollowingMode
    place: Place
    entity_ref: str | None = None
    constraints: DynamicConstraints | None = None


class LongitudinalDistanceAction(Struct, frozen=True):
    """Keep a distance [m] or time gap [s] to an entity; both None: the present distance."""

    entity_ref: str
    continuous: bool
    freespace: bool
    place: Place
    distance: float | None = None
    time_gap: float | None = None
    displacement: LongitudinalDisplacement | None = None
    coordinate_system: CoordinateSystem | None = None
    constraints: DynamicConstraints | None = None
