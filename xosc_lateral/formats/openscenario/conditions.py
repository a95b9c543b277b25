"""Triggers and conditions."""

from __future__ import annotations

from collections.abc import Callable

from xosc_lateral.formats.openscenario.context import Context
from xosc_lateral.formats.openscenario.declarations import parameter_name
from xosc_lateral.formats.openscenario.element import XmlElement
from xosc_lateral.formats.openscenario.entities import read_date_time
from xosc_lateral.formats.openscenario.positions import read_position_in
from xosc_lateral.scenario.conditions import (
    AccelerationCondition,
    AngleCondition,
    CollisionCondition,
    DistanceCondition,
    EndOfRoadCondition,
    OffroadCondition,
    ParameterCondition,
    ReachPositionCondition,
    RelativeAngleCondition,
    RelativeClearanceCondition,
    RelativeDistanceCondition,
    RelativeLaneRange,
    RelativeSpeedCondition,
    SimulationTimeCondition,
    SpeedCondition,
    StandStillCondition,
    StoryboardElementStateCondition,
    TimeHeadwayCondition,
    TimeOfDayCondition,
    TimeToCollisionCondition,
    TrafficSignalCondition,
    TrafficSignalControllerCondition,
    TraveledDistanceCondition,
    UserDefinedValueCondition,
    VariableCondition,
)
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
    TriggeringEntitiesRule,
)
from xosc_lateral.scenario.place import Content, Unsupported
from xosc_lateral.scenario.storyboard import Condition, ConditionGroup, Trigger, TriggeringEntities

# `cartesianDistance` is the name of 1.0; the misspelt one is the standard's.
DISTANCE_TYPES = {
    "cartesianDistance": RelativeDistanceType.EUCLIDIAN,
    "euclideanDistance": RelativeDistanceType.EUCLIDIAN,
}


def read_trigger(element: XmlElement | None, context: Context) -> Trigger | None:
    """A start or stop trigger; None where the element is missing."""
    if element is None:
        return None
    groups = tuple(
        ConditionGroup(tuple(_read_condition(condition, context) for condition in group.children("Condition")))
        for group in element.children("ConditionGroup")
    )
    return Trigger(groups, element.place())


def _read_condition(element: XmlElement, context: Context) -> Condition:
    owner = element.required("ByEntityCondition", "ByValueCondition")
    content = _content(owner, context)
    triggering = None
    if owner.tag == "ByEntityCondition":
        triggering = _triggering_entities(owner.required("TriggeringEntities"), context)
    delay = element.number("delay", 0.0)
    if delay < 0:
        element.fail(f"delay of {delay} s is negative")
    edge = element.choice("conditionEdge", ConditionEdge, ConditionEdge.NONE)
    return Condition(element.text("name", ""), delay, edge, content, triggering, element.place())


def _content(owner: XmlElement, context: Context) -> Content:
    """What is waited for; a condition that nobody reads is unsupported."""
    if owner.tag == "ByEntityCondition":
        kind = owner.required("EntityCondition").child()
        readers: dict[str, Callable[[XmlElement, Context], Content]] = {**ENTITY_CONDITIONS}
    else:
        kind = owner.child()
        readers = {**VALUE_CONDITIONS}
    if kind is None:
        owner.fail("contains no condition")
    reader = readers.get(kind.tag)
    content = reader(kind, context) if reader else Unsupported(kind.tag, kind.place())
    return content


def _triggering_entities(element: XmlElement, context: Context) -> TriggeringEntities:
    members = [name for reference in element.children("EntityRef") for name in context.members(reference)]
    rule = element.choice("triggeringEntitiesRule", TriggeringEntitiesRule, TriggeringEntitiesRule.ANY)
    return TriggeringEntities(rule, tuple(members))


def _rule(e: XmlElement) -> Rule:
    return e.choice("rule", Rule)


def _value(e: XmlElement) -> float:
    return e.number("value", finite=False)


def _system(e: XmlElement) -> CoordinateSystem | None:
    return e.optional_choice("coordinateSystem", CoordinateSystem)


def _distance_type(e: XmlElement) -> RelativeDistanceType | None:
    return e.optional_choice("relativeDistanceType", RelativeDistanceType, DISTANCE_TYPES)


def _routing(e: XmlElement) -> RoutingAlgorithm | None:
    return e.optional_choice("routingAlgorithm", RoutingAlgorithm)


def _direction(e: XmlElement) -> DirectionalDimension | None:
    return e.optional_choice("direction", DirectionalDimension)


def _end_of_road(e: XmlElement, _: Context) -> Content:
    return EndOfRoadCondition(e.number("duration"), e.place())


def _collision(e: XmlElement, context: Context) -> Content:
    reference, by_type = e.child("EntityRef"), e.child("ByType")
    if reference is None and by_type is None:
        e.fail("contains neither EntityRef nor ByType")
    return CollisionCondition(
        e.place(),
        None if reference is None else context.entity(reference),
        None if by_type is None else by_type.choice("type", EntityCategory),
    )


def _offroad(e: XmlElement, _: Context) -> Content:
    return OffroadCondition(e.number("duration"), e.place())


def _time_headway(e: XmlElement, context: Context) -> Content:
    return TimeHeadwayCondition(
        context.entity(e),
        _value(e),
        _rule(e),
        e.boolean("freespace", False),
        e.place(),
        _system(e),
        _distance_type(e),
        e.optional_boolean("alongRoute"),
        _routing(e),
    )


def _time_to_collision(e: XmlElement, context: Context) -> Content:
    target = e.required("TimeToCollisionConditionTarget")
    reference = target.child("EntityRef")
    return TimeToCollisionCondition(
        context.entity(reference) if reference is not None else read_position_in(target, context),
        _value(e),
        _rule(e),
        e.boolean("freespace", False),
        e.place(),
        _system(e),
        _distance_type(e),
        e.optional_boolean("alongRoute"),
        _routing(e),
    )


def _acceleration(e: XmlElement, _: Context) -> Content:
    return AccelerationCondition(_value(e), _rule(e), e.place(), _direction(e))


def _stand_still(e: XmlElement, _: Context) -> Content:
    return StandStillCondition(e.number("duration"), e.place())


def _speed(e: XmlElement, _: Context) -> Content:
    return SpeedCondition(_value(e), _rule(e), e.place(), _direction(e))


def _relative_speed(e: XmlElement, context: Context) -> Content:
    return RelativeSpeedCondition(context.entity(e), _value(e), _rule(e), e.place(), _direction(e))


def _traveled_distance(e: XmlElement, _: Context) -> Content:
    return TraveledDistanceCondition(_value(e), e.place())


def _reach_position(e: XmlElement, context: Context) -> Content:
    return ReachPositionCondition(read_position_in(e, context), e.number("tolerance"), e.place())


def _distance(e: XmlElement, context: Context) -> Content:
    return DistanceCondition(
        read_position_in(e, context),
        _value(e),
        _rule(e),
        e.boolean("freespace", False),
        e.place(),
        _system(e),
        _distance_type(e),
        e.optional_boolean("alongRoute"),
        _routing(e),
    )


def _relative_distance(e: XmlElement, context: Context) -> Content:
    return RelativeDistanceCondition(
        context.entity(e),
        _value(e),
        _rule(e),
        e.boolean("freespace", False),
        _distance_type(e) or RelativeDistanceType.EUCLIDIAN,
        e.place(),
        _system(e),
        _routing(e),
    )


def _relative_clearance(e: XmlElement, context: Context) -> Content:
    return RelativeClearanceCondition(
        e.boolean("oppositeLanes", False),
        e.boolean("freeSpace", e.boolean("freespace", False)),
        e.place(),
        e.number("distanceForward", 0.0),
        e.number("distanceBackward", 0.0),
        tuple(
            RelativeLaneRange(lanes.optional_integer("from"), lanes.optional_integer("to"))
            for lanes in e.children("RelativeLaneRange")
        ),
        tuple(name for reference in e.children("EntityRef") for name in context.members(reference)),
    )


def _angle(e: XmlElement, _: Context) -> Content:
    return AngleCondition(
        e.choice("angleType", AngleType), e.number("angle"), e.number("angleTolerance"), e.place(), _system(e)
    )


def _relative_angle(e: XmlElement, context: Context) -> Content:
    kind = e.choice("angleType", AngleType)
    return RelativeAngleCondition(
        context.entity(e), kind, e.number("angle"), e.number("angleTolerance"), e.place(), _system(e)
    )


def _parameter(e: XmlElement, _: Context) -> Content:
    name = parameter_name(e.raw("parameterRef") or e.text("parameterRef"))
    return ParameterCondition(name, e.text("value"), _rule(e), e.place())


def _variable(e: XmlElement, _: Context) -> Content:
    name = parameter_name(e.raw("variableRef") or e.text("variableRef"))
    return VariableCondition(name, e.text("value"), _rule(e), e.place())


def _simulation_time(e: XmlElement, _: Context) -> Content:
    return SimulationTimeCondition(_value(e), _rule(e), e.place())


def _time_of_day(e: XmlElement, _: Context) -> Content:
    moment = read_date_time(e)
    if moment is None:
        e.fail(f"dateTime='{e.text('dateTime')}' is not a date and time")
    return TimeOfDayCondition(moment, _rule(e), e.place())


def _element_state(e: XmlElement, _: Context) -> Content:
    return StoryboardElementStateCondition(
        e.choice("storyboardElementType", StoryboardElementType),
        e.text("storyboardElementRef"),
        e.choice("state", StoryboardElementState),
        e.place(),
    )


def _traffic_signal(e: XmlElement, _: Context) -> Content:
    return TrafficSignalCondition(e.text("name"), e.text("state"), e.place())


def _traffic_signal_controller(e: XmlElement, _: Context) -> Content:
    return TrafficSignalControllerCondition(e.text("trafficSignalControllerRef"), e.text("phase"), e.place())


def _user_defined(e: XmlElement, _: Context) -> Content:
    return UserDefinedValueCondition(e.text("name"), e.text("value"), _rule(e), e.place())


ENTITY_CONDITIONS: dict[str, Callable[[XmlElement, Context], Content]] = {
    "EndOfRoadCondition": _end_of_road,
    "CollisionCondition": _collision,
    "OffroadCondition": _offroad,
    "TimeHeadwayCondition": _time_headway,
    "TimeToCollisionCondition": _time_to_collision,
    "AccelerationCondition": _acceleration,
    "StandStillCondition": _stand_still,
    "SpeedCondition": _speed,
    "RelativeSpeedCondition": _relative_speed,
    "TraveledDistanceCondition": _traveled_distance,
    "ReachPositionCondition": _reach_position,
    "DistanceCondition": _distance,
    "RelativeDistanceCondition": _relative_distance,
    "RelativeClearanceCondition": _relative_clearance,
    "AngleCondition": _angle,
    "RelativeAngleCondition": _relative_angle,
}
VALUE_CONDITIONS: dict[str, Callable[[XmlElement, Context], Content]] = {
    "ParameterCondition": _parameter,
    "VariableCondition": _variable,
    "SimulationTimeCondition": _simulation_time,
    "TimeOfDayCondition": _time_of_day,
    "StoryboardElementStateCondition": _element_state,
    "TrafficSignalCondition": _traffic_signal,
    "TrafficSignalControllerCondition": _traffic_signal_controller,
    "UserDefinedValueCondition": _user_defined,
}
