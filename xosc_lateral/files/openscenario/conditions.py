"""Triggers and conditions: what their structs declare is read by that, the others by the functions here."""

from __future__ import annotations

from xosc_lateral.files.openscenario.context import Context, Reader, declared, read_struct
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.openscenario.entities import read_date_time
from xosc_lateral.files.openscenario.positions import read_position
from xosc_lateral.world.scenario import conditions
from xosc_lateral.world.scenario.enums import EntityCategory
from xosc_lateral.world.scenario.place import Unsupported
from xosc_lateral.world.scenario.scenario import Condition, ConditionGroup, Trigger, TriggeringEntities


def read_trigger(element: XmlElement, context: Context) -> Trigger:
    """A start or stop trigger."""
    groups = tuple(
        ConditionGroup(tuple(_read_condition(condition, context) for condition in group.children("Condition")))
        for group in element.children("ConditionGroup")
    )
    return Trigger(groups, element.place())


def _read_condition(element: XmlElement, context: Context) -> Condition:
    """A condition; one that nobody reads is unsupported."""
    owner = element.required("ByEntityCondition", "ByValueCondition")
    triggering, holder, readers = None, owner, VALUE_CONDITIONS
    if owner.tag == "ByEntityCondition":
        holder, readers = owner.required("EntityCondition"), ENTITY_CONDITIONS
    kind = holder.child()
    if kind is None:
        owner.fail("contains no condition")
    reader = readers.get(kind.tag)
    content = reader(kind, context) if reader else Unsupported(kind.tag, kind.place())
    if owner.tag == "ByEntityCondition":
        triggering = read_struct(TriggeringEntities, owner.required("TriggeringEntities"), context)
    return read_struct(Condition, element, context, content=content, triggering_entities=triggering)


def _collision(e: XmlElement, context: Context) -> conditions.CollisionCondition:
    reference, by_type = e.child("EntityRef"), e.child("ByType")
    if reference is None and by_type is None:
        e.fail("contains neither EntityRef nor ByType")
    return conditions.CollisionCondition(
        None if reference is None else context.entity(reference),
        None if by_type is None else by_type.choice("type", EntityCategory),
        place=e.place(),
    )


def _time_to_collision(e: XmlElement, context: Context) -> conditions.TimeToCollisionCondition:
    owner = e.required("TimeToCollisionConditionTarget")
    reference = owner.child("EntityRef")
    if reference is not None:
        return read_struct(conditions.TimeToCollisionCondition, e, context, target=context.entity(reference))
    target = read_position(owner.required("Position"), context)
    return read_struct(conditions.TimeToCollisionCondition, e, context, target=target)


def _time_of_day(e: XmlElement, context: Context) -> conditions.TimeOfDayCondition:
    moment = read_date_time(e)
    if moment is None:
        e.fail(f"dateTime='{e.text('dateTime')}' is not a date and time")
    return read_struct(conditions.TimeOfDayCondition, e, context, date_time=moment)


ENTITY_CONDITIONS: dict[str, Reader] = {
    **declared(conditions.EndOfRoadCondition, conditions.OffroadCondition, conditions.StandStillCondition),
    **declared(conditions.SpeedCondition, conditions.RelativeSpeedCondition, conditions.AccelerationCondition),
    **declared(conditions.TraveledDistanceCondition, conditions.ReachPositionCondition, conditions.DistanceCondition),
    **declared(conditions.RelativeDistanceCondition, conditions.RelativeClearanceCondition),
    **declared(conditions.TimeHeadwayCondition, conditions.AngleCondition, conditions.RelativeAngleCondition),
    "CollisionCondition": _collision,
    "TimeToCollisionCondition": _time_to_collision,
}
VALUE_CONDITIONS: dict[str, Reader] = {
    **declared(conditions.ParameterCondition, conditions.VariableCondition, conditions.UserDefinedValueCondition),
    **declared(conditions.SimulationTimeCondition, conditions.StoryboardElementStateCondition),
    **declared(conditions.TrafficSignalCondition, conditions.TrafficSignalControllerCondition),
    "TimeOfDayCondition": _time_of_day,
}
