"""Conditions as a file says them: on values, and on entities."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated

from msgspec import Struct

from xosc_lateral.world.scenario import enums
from xosc_lateral.world.scenario.place import (
    AnyNumber,
    Content,
    EntityRef,
    EntityRefs,
    No,
    ParameterRef,
    Place,
    Zero,
    called,
)
from xosc_lateral.world.scenario.position import Position
from xosc_lateral.world.scenario.scenario import Condition, ConditionGroup, Trigger

DistanceType = called("relativeDistanceType")


class ParameterCondition(Content, frozen=True):
    """`value` is text: numbers are compared as numbers where both are."""

    parameter_ref: ParameterRef
    value: str
    rule: enums.Rule


class VariableCondition(Content, frozen=True):
    """`value` is text: numbers are compared as numbers where both are."""

    variable_ref: ParameterRef
    value: str
    rule: enums.Rule


class AgainstNumber(Content, frozen=True):
    """Something against a number."""

    value: AnyNumber
    rule: enums.Rule


class SimulationTimeCondition(AgainstNumber, frozen=True):
    """[s]"""


def at_time(moment: float, name: str, place: Place) -> Trigger:
    """Trigger of our own that holds from a moment on. [s]"""
    content = SimulationTimeCondition(moment, enums.Rule.GREATER_THAN, place=place)
    return Trigger((ConditionGroup((Condition(name, 0.0, enums.ConditionEdge.NONE, content, None, place),)),), place)


class TimeOfDayCondition(Content, frozen=True):
    """Against the environment's clock."""

    date_time: datetime
    rule: enums.Rule


class StoryboardElementStateCondition(Content, frozen=True):
    """State or transition of a storyboard element; `element_ref` is the trailing part of ``story::act::...::name``."""

    element_type: Annotated[enums.StoryboardElementType, called("storyboardElementType")]
    element_ref: Annotated[str, called("storyboardElementRef")]
    state: enums.StoryboardElementState


class TrafficSignalCondition(Content, frozen=True):
    """A signal shows a state."""

    name: str
    state: str


class TrafficSignalControllerCondition(Content, frozen=True):
    """A signal controller is in a phase."""

    controller_ref: Annotated[str, called("trafficSignalControllerRef")]
    phase: str


class UserDefinedValueCondition(Content, frozen=True):
    """A value from outside: never known while playing."""

    name: str
    value: str
    rule: enums.Rule


class EndOfRoadCondition(Content, frozen=True):
    """At the end of its road for this long. [s]"""

    duration: float


class CollisionCondition(Content, frozen=True):
    """Touches that entity, or any of that category."""

    entity_ref: str | None = None
    by_type: enums.EntityCategory | None = None


class OffroadCondition(Content, frozen=True):
    """Off the road for this long. [s]"""

    duration: float


class Measured(AgainstNumber, frozen=True, kw_only=True):
    """A distance, or what is made of one, against a value. `along_route` (1.0) None: not said."""

    freespace: No
    coordinate_system: enums.CoordinateSystem | None = None
    distance_type: Annotated[enums.RelativeDistanceType | None, DistanceType] = None
    along_route: bool | None = None
    routing_algorithm: enums.RoutingAlgorithm | None = None


class TimeHeadwayCondition(Measured, frozen=True):
    """Distance to an entity over own speed. [s]"""

    entity_ref: EntityRef


class TimeToCollisionCondition(Measured, frozen=True):
    """Distance to an entity or position over closing speed. [s]"""

    target: str | Position


class AccelerationCondition(AgainstNumber, frozen=True):
    """[m/s2]; `direction` None: the magnitude."""

    direction: enums.DirectionalDimension | None = None


class StandStillCondition(Content, frozen=True):
    """Stands for this long. [s]"""

    duration: float


class SpeedCondition(AgainstNumber, frozen=True):
    """[m/s]; `direction` None: the scalar speed."""

    direction: enums.DirectionalDimension | None = None


class RelativeSpeedCondition(SpeedCondition, frozen=True, kw_only=True):
    """Own speed minus that of an entity. [m/s]"""

    entity_ref: EntityRef


class TraveledDistanceCondition(Content, frozen=True):
    """Since the scenario's start. [m]"""

    value: AnyNumber


class ReachPositionCondition(Content, frozen=True):
    """Within `tolerance` of a position. [m]"""

    position: Position
    tolerance: float


class DistanceCondition(Measured, frozen=True):
    """Distance to a position. [m]"""

    position: Position


class RelativeDistanceCondition(AgainstNumber, frozen=True):
    """Distance to an entity. [m]"""

    entity_ref: EntityRef
    freespace: No
    distance_type: Annotated[enums.RelativeDistanceType, DistanceType] = enums.RelativeDistanceType.EUCLIDIAN
    coordinate_system: enums.CoordinateSystem | None = None
    routing_algorithm: enums.RoutingAlgorithm | None = None


class RelativeLaneRange(Struct, frozen=True):
    """Lanes `from_lane` to `to_lane`, relative to the own one; None: open."""

    from_lane: Annotated[int | None, called("from")]
    to_lane: Annotated[int | None, called("to")]


class RelativeClearanceCondition(Content, frozen=True):
    """Nobody (of `entity_refs`, or at all when empty) in these lanes within these distances. [m]"""

    opposite_lanes: No
    freespace: Annotated[bool, called("freeSpace", "freespace", default=False)]
    distance_forward: Zero
    distance_backward: Zero
    lane_ranges: tuple[RelativeLaneRange, ...] = ()
    entity_refs: EntityRefs = ()


class AngleCondition(Content, frozen=True):
    """Own angle within a tolerance. [rad]"""

    angle_type: enums.AngleType
    angle: float
    tolerance: Annotated[float, called("angleTolerance")]
    coordinate_system: enums.CoordinateSystem | None = None


class RelativeAngleCondition(AngleCondition, frozen=True, kw_only=True):
    """Angle relative to an entity's within a tolerance. [rad]"""

    entity_ref: EntityRef
