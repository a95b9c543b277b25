"""Conditions as a file says them: on values, and on entities."""

from __future__ import annotations

from datetime import datetime

from msgspec import Struct

from xosc_lateral.scenario.enums import (
    AngleType,
    ConditionEdge,
    CoordinateSystem,
    DirectionalDimension,
    EntityCategory,
    RelativeDistanceType,
    RoutingAlgorithm,
    Rule,
    StoryboardElementState,
    StoryboardElementType,
)
from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position
from xosc_lateral.scenario.storyboard import Condition, ConditionGroup, Trigger


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
