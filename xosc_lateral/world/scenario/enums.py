"""The standard's option codes. Values are the text in the file."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from operator import eq, ge, gt, le, lt, ne
from typing import Any


class EntityCategory(StrEnum):
    """What kind of scenario object an entity is."""

    VEHICLE = "vehicle"
    PEDESTRIAN = "pedestrian"
    MISC = "miscellaneous"
    EXTERNAL = "external"


class VehicleCategory(StrEnum):
    """`Vehicle/@vehicleCategory`."""

    BICYCLE = "bicycle"
    BUS = "bus"
    CAR = "car"
    MOTORBIKE = "motorbike"
    SEMITRAILER = "semitrailer"
    TRAILER = "trailer"
    TRAIN = "train"
    TRAM = "tram"
    TRUCK = "truck"
    VAN = "van"


class Priority(StrEnum):
    """`Event/@priority`; ``overwrite`` is the older word for override."""

    OVERRIDE = "override"
    SKIP = "skip"
    PARALLEL = "parallel"


class ConditionEdge(StrEnum):
    """`Condition/@conditionEdge`."""

    NONE = "none"
    RISING = "rising"
    FALLING = "falling"
    RISING_OR_FALLING = "risingOrFalling"


class Rule(StrEnum):
    """Comparison of a condition's quantity (left) with its value (right)."""

    EQUAL_TO = "equalTo"
    GREATER_THAN = "greaterThan"
    LESS_THAN = "lessThan"
    GREATER_OR_EQUAL = "greaterOrEqual"
    LESS_OR_EQUAL = "lessOrEqual"
    NOT_EQUAL_TO = "notEqualTo"

    def holds(self, left: object, right: object) -> bool:
        """Compare two values of one kind, exactly."""
        return bool(_OPERATORS[self](left, right))


_OPERATORS: dict[Rule, Callable[[Any, Any], bool]] = {
    Rule.EQUAL_TO: eq,
    Rule.GREATER_THAN: gt,
    Rule.LESS_THAN: lt,
    Rule.GREATER_OR_EQUAL: ge,
    Rule.LESS_OR_EQUAL: le,
    Rule.NOT_EQUAL_TO: ne,
}


class TriggeringEntitiesRule(StrEnum):
    """Whether one triggering entity suffices."""

    ANY = "any"
    ALL = "all"


class DynamicsShape(StrEnum):
    """How a value goes from start to target."""

    LINEAR = "linear"
    CUBIC = "cubic"
    SINUSOIDAL = "sinusoidal"
    STEP = "step"


class DynamicsDimension(StrEnum):
    """What the value of a transition measures."""

    TIME = "time"
    DISTANCE = "distance"
    RATE = "rate"


class FollowingMode(StrEnum):
    """Exactly on the path, or steered along it."""

    POSITION = "position"
    FOLLOW = "follow"


class ReferenceContext(StrEnum):
    """Absolute or relative to the reference."""

    ABSOLUTE = "absolute"
    RELATIVE = "relative"


class SpeedTargetValueType(StrEnum):
    """Relative target speed: added, or multiplied."""

    DELTA = "delta"
    FACTOR = "factor"


class CoordinateSystem(StrEnum):
    """In which a distance is measured."""

    ENTITY = "entity"
    LANE = "lane"
    ROAD = "road"
    TRAJECTORY = "trajectory"
    WORLD = "world"


class RelativeDistanceType(StrEnum):
    """Which component of a distance; ``cartesianDistance`` (1.0) is read as euclidian."""

    LONGITUDINAL = "longitudinal"
    LATERAL = "lateral"
    EUCLIDIAN = "euclidianDistance"


class DirectionalDimension(StrEnum):
    """Axis of the entity's frame."""

    LONGITUDINAL = "longitudinal"
    LATERAL = "lateral"
    VERTICAL = "vertical"


class LongitudinalDisplacement(StrEnum):
    """On which side of the reference a longitudinal distance is kept."""

    ANY = "any"
    TRAILING = "trailingReferencedEntity"
    LEADING = "leadingReferencedEntity"


class LateralDisplacement(StrEnum):
    """On which side of the reference a lateral distance is kept."""

    ANY = "any"
    LEFT = "leftToReferencedEntity"
    RIGHT = "rightToReferencedEntity"


class StoryboardElementType(StrEnum):
    """What a storyboard element state condition refers to."""

    STORY = "story"
    ACT = "act"
    MANEUVER_GROUP = "maneuverGroup"
    MANEUVER = "maneuver"
    EVENT = "event"
    ACTION = "action"


class StoryboardElementState(StrEnum):
    """State or transition of a storyboard element."""

    STANDBY = "standbyState"
    RUNNING = "runningState"
    COMPLETE = "completeState"
    START_TRANSITION = "startTransition"
    END_TRANSITION = "endTransition"
    STOP_TRANSITION = "stopTransition"
    SKIP_TRANSITION = "skipTransition"


class AngleType(StrEnum):
    """Which angle an angle condition looks at."""

    HEADING = "heading"
    PITCH = "pitch"
    ROLL = "roll"


class RouteStrategy(StrEnum):
    """How to go to a waypoint from the one before."""

    FASTEST = "fastest"
    SHORTEST = "shortest"
    LEAST_INTERSECTIONS = "leastIntersections"
    RANDOM = "random"


class RoutingAlgorithm(StrEnum):
    """Which route a distance along the road is measured on."""

    UNDEFINED = "undefined"
    ASSIGNED_ROUTE = "assignedRoute"
    FASTEST = "fastest"
    SHORTEST = "shortest"
    LEAST_INTERSECTIONS = "leastIntersections"


class ParameterType(StrEnum):
    """Type of a parameter or variable; ``integer`` (1.0) is read as int."""

    BOOLEAN = "boolean"
    DATE_TIME = "dateTime"
    DOUBLE = "double"
    INT = "int"
    STRING = "string"
    UNSIGNED_INT = "unsignedInt"
    UNSIGNED_SHORT = "unsignedShort"


SYNONYMS: dict[type[StrEnum], dict[str, StrEnum]] = {
    Priority: {"overwrite": Priority.OVERRIDE},
    ParameterType: {"integer": ParameterType.INT, "bool": ParameterType.BOOLEAN, "float": ParameterType.DOUBLE},
    RelativeDistanceType: dict.fromkeys(("cartesianDistance", "euclideanDistance"), RelativeDistanceType.EUCLIDIAN),
}
"""What older versions and other tools write: ``overwrite``, ``integer`` and ``cartesianDistance`` are words of 1.0."""
