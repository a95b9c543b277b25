"""Conditions on the state of triggering entities. `value` is in the quantity's SI unit."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.enums import (
    AngleType,
    CoordinateSystem,
    DirectionalDimension,
    EntityCategory,
    RelativeDistanceType,
    RoutingAlgorithm,
    Rule,
)
from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position


class EndOfRoadCondition(Struct, frozen=True):
    """At the end of its road for this long. [s]"""

    duration: float
    place: Place


class CollisionCondition(Struct, frozen=True):
    """Touches that entity, or any of that category."""

    place: Place
    entity_ref: str | None = None
    by_type: EntityCategory | None = None


class OffroadCondition(Struct, frozen=True):
    """Off the road for this long. [s]"""

    duration: float
    place: Place


class TimeHeadwayCondition(Struct, frozen=True):
    """Distance to an entity over own speed. [s] `along_route` (1.0) None: not said."""

    entity_ref: str
    value: float
    rule: Rule
    freespace: bool
    place: Place
    coordinate_system: CoordinateSystem | None = None
    distance_type: RelativeDistanceType | None = None
    along_route: bool | None = None
    routing_algorithm: RoutingAlgorithm | None = None


class TimeToCollisionCondition(Struct, frozen=True):
    """Distance to an entity or position over closing speed. [s]"""

    target: str | Position
    value: float
    rule: Rule
    freespace: bool
    place: Place
    coordinate_system: CoordinateSystem | None = None
    distance_type: RelativeDistanceType | None = None
    along_route: bool | None = None
    routing_algorithm: RoutingAlgorithm | None = None


class AccelerationCondition(Struct, frozen=True):
    """[m/s2]; `direction` None: the magnitude."""

    value: float
    rule: Rule
    place: Place
    direction: DirectionalDimension | None = None


class StandStillCondition(Struct, frozen=True):
    """Stands for this long. [s]"""

    duration: float
    place: Place


class SpeedCondition(Struct, frozen=True):
    """[m/s]; `direction` None: the scalar speed."""

    value: float
    rule: Rule
    place: Place
    direction: DirectionalDimension | None = None


class RelativeSpeedCondition(Struct, frozen=True):
    """Own speed minus that of an entity. [m/s]"""

    entity_ref: str
    value: float
    rule: Rule
    place: Place
    direction: DirectionalDimension | None = None


class TraveledDistanceCondition(Struct, frozen=True):
    """Since the scenario's start. [m]"""

    value: float
    place: Place


class ReachPositionCondition(Struct, frozen=True):
    """Within `tolerance` of a position. [m]"""

    position: Position
    tolerance: float
    place: Place


class DistanceCondition(Struct, frozen=True):
    """Distance to a position. [m]"""

    position: Position
    value: float
    rule: Rule
    freespace: bool
    place: Place
    coordinate_system: CoordinateSystem | None = None
    distance_type: RelativeDistanceType | None = None
    along_route: bool | None = None
    routing_algorithm: RoutingAlgorithm | None = None


class RelativeDistanceCondition(Struct, frozen=True):
    """Distance to an entity. [m]"""

    entity_ref: str
    value: float
    rule: Rule
    freespace: bool
    distance_type: RelativeDistanceType
    place: Place
    coordinate_system: CoordinateSystem | None = None
    routing_algorithm: RoutingAlgorithm | None = None


class RelativeLaneRange(Struct, frozen=True):
    """Lanes `from_lane` to `to_lane`, relative to the own one; None: open."""

    from_lane: int | None
    to_lane: int | None


class RelativeClearanceCondition(Struct, frozen=True):
    """Nobody (of `entity_refs`, or at all when empty) in these lanes within these distances. [m]"""

    opposite_lanes: bool
    freespace: bool
    place: Place
    distance_forward: float = 0.0
    distance_backward: float = 0.0
    lane_ranges: tuple[RelativeLaneRange, ...] = ()
    entity_refs: tuple[str, ...] = ()


class AngleCondition(Struct, frozen=True):
    """Own angle within a tolerance. [rad]"""

    angle_type: AngleType
    angle: float
    tolerance: float
    place: Place
    coordinate_system: CoordinateSystem | None = None


class RelativeAngleCondition(Struct, frozen=True):
    """Angle relative to an entity's within a tolerance. [rad]"""

    entity_ref: str
    angle_type: AngleType
    angle: float
    tolerance: float
    place: Place
    coordinate_system: CoordinateSystem | None = None
