"""The storyboard: init, stories, events; their actions, global, user-defined and private; triggers and conditions."""

from __future__ import annotations

from itertools import chain

from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.files.openscenario.context import Context, Reader, declared, read_struct
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.openscenario.entities import READERS as ENTITY_READERS
from xosc_lateral.files.openscenario.entities import read_date_time
from xosc_lateral.files.openscenario.positions import READERS as POSITION_READERS
from xosc_lateral.files.openscenario.positions import read_position
from xosc_lateral.files.openscenario.references import local_scope
from xosc_lateral.world.scenario import conditions, global_actions
from xosc_lateral.world.scenario import private_actions as private
from xosc_lateral.world.scenario.enums import DynamicsShape, EntityCategory
from xosc_lateral.world.scenario.parameters import ExpressionError
from xosc_lateral.world.scenario.place import Unsupported
from xosc_lateral.world.scenario.private_actions import TransitionDynamics
from xosc_lateral.world.scenario.scenario import (
    Action,
    Actors,
    Condition,
    ConditionGroup,
    Event,
    Init,
    Maneuver,
    ManeuverGroup,
    Private,
    Story,
    TrafficSignalPhase,
    Trigger,
    TriggeringEntities,
)

# Elements that only group others; what they hold is the action.
GROUPING = {
    "LongitudinalAction",
    "LateralAction",
    "RoutingAction",
    "ControllerAction",
    "AppearanceAction",
    "TrailerAction",
    "InfrastructureAction",
    "TrafficSignalAction",
}


def read_actions(owner: XmlElement, name: str, context: Context) -> list[Action]:
    """Actions in a PrivateAction, GlobalAction or UserDefinedAction element: one, or more in lenient files."""
    private = owner.tag == "PrivateAction"
    readers = PRIVATE_ACTIONS if private else GLOBAL_ACTIONS
    try:
        scope = owner.scope.local_values()
    except ExpressionError as error:
        owner.fail(f"parameters that are declared around it: {error}")
    contents = [owner] if owner.tag == "UserDefinedAction" else list(_contents(owner))
    if not contents:
        context.note(owner, "contains no action: played as nothing")
    actions = []
    for element in contents:
        reader = readers.get(element.tag)
        content = reader(element, context) if reader else Unsupported(element.tag, element.place())
        actions.append(Action(name, content, owner.place(), private, scope))
    return actions


def _contents(owner: XmlElement) -> list[XmlElement]:
    parts = (_contents(child) if child.tag in GROUPING else [child] for child in owner.children())
    return [*chain.from_iterable(parts)]


def _entity(e: XmlElement, context: Context) -> Struct:
    if (add := e.child("AddEntityAction")) is not None:
        position = read_position(add.required("Position"), context)
        return global_actions.AddEntityAction(context.entity(e), position, place=e.place())
    e.required("DeleteEntityAction")
    return global_actions.DeleteEntityAction(context.entity(e), place=e.place())


def _setting(sets: type[Struct], modifies: type[Struct]) -> Reader:
    """Of a parameter or a variable."""

    def read(e: XmlElement, context: Context) -> Struct:
        if (change := e.child("SetAction")) is not None:
            return read_struct(sets, e, context, value=change.text("value"))
        rule = e.required("ModifyAction").required("Rule").required("AddValue", "MultiplyByValue")
        operation = global_actions.ModifyOperation(rule.tag)
        return read_struct(modifies, e, context, operation=operation, value=rule.number("value"))

    return read


def _traffic(e: XmlElement, _: Context) -> global_actions.TrafficAction:
    content = e.child()
    return global_actions.TrafficAction(content.tag if content else e.tag, place=e.place())


def _user_defined(e: XmlElement, _: Context) -> global_actions.UserDefinedAction:
    command = e.child("CustomCommandAction")
    if command is None:
        return global_actions.UserDefinedAction("", "", place=e.place())
    return global_actions.UserDefinedAction(command.text("type", ""), (command.xml.text or "").strip(), place=e.place())


GLOBAL_ACTIONS: dict[str, Reader] = {
    **declared(global_actions.EnvironmentAction, global_actions.SetMonitorAction),
    **declared(global_actions.TrafficSignalStateAction, global_actions.TrafficSignalControllerAction),
    "EntityAction": _entity,
    "ParameterAction": _setting(global_actions.ParameterSetAction, global_actions.ParameterModifyAction),
    "VariableAction": _setting(global_actions.VariableSetAction, global_actions.VariableModifyAction),
    "TrafficAction": _traffic,
    "UserDefinedAction": _user_defined,
}


# ---- private actions: what their structs declare is read by that, the others by functions ----
def _teleport(e: XmlElement, context: Context) -> private.TeleportAction:
    # 1.0 files in the field put the position right into the action.
    return private.TeleportAction(read_position(e.child("Position") or e, context), place=e.place())


def _speed_profile(e: XmlElement, context: Context) -> private.SpeedProfileAction:
    if e.child("SpeedProfileEntry") is None:
        e.fail("a speed profile needs an entry")
    reference = context.entity(e) if e.optional_text("entityRef") else None
    return read_struct(private.SpeedProfileAction, e, context, entity_ref=reference)


def _lane_offset(e: XmlElement, context: Context) -> private.LaneOffsetAction:
    dynamics = e.required("LaneOffsetActionDynamics")
    shape = dynamics.value("dynamicsShape", DynamicsShape, DynamicsShape.STEP)
    most = dynamics.optional_number("maxLateralAcc", finite=False)
    action = read_struct(private.LaneOffsetAction, e, context, shape=shape, max_lateral_acc=most)
    return replace(action, target=replace(action.target, value=-action.target.value)) if context.left_handed else action


def _override(e: XmlElement, _: Context) -> private.OverrideControllerValueAction:
    overrides = tuple(
        (item.tag, item.value("active", bool, False), item.optional_number("value")) for item in e.children()
    )
    return private.OverrideControllerValueAction(overrides, place=e.place())


def _animation(e: XmlElement, context: Context) -> private.AnimationAction:
    owner = e.child("AnimationType")
    content = None if owner is None else owner.child()
    return read_struct(private.AnimationAction, e, context, kind=content.tag if content else "")


def read_transition(e: XmlElement, context: Context) -> TransitionDynamics:
    """How a value goes to its target; a step needs no value."""
    is_step = e.value("dynamicsShape", DynamicsShape, DynamicsShape.STEP) is DynamicsShape.STEP
    preset = {"value": 0.0} if is_step and e.optional_number("value", finite=False) is None else {}
    return read_struct(TransitionDynamics, e, context, **preset)


PRIVATE_ACTIONS: dict[str, Reader] = {
    **declared(private.SpeedAction, private.LongitudinalDistanceAction, private.SynchronizeAction),
    **declared(private.LaneChangeAction, private.LateralDistanceAction, private.FollowTrajectoryAction),
    **declared(private.AssignRouteAction, private.AcquirePositionAction, private.AssignControllerAction),
    **declared(private.ActivateControllerAction, private.ConnectTrailerAction, private.DisconnectTrailerAction),
    **declared(private.VisibilityAction, private.LightStateAction),
    "TeleportAction": _teleport,
    "SpeedProfileAction": _speed_profile,
    "LaneOffsetAction": _lane_offset,
    "OverrideControllerValueAction": _override,
    "AnimationAction": _animation,
}


# ---- init, stories, maneuver groups, events ----
def _read_init(element: XmlElement, context: Context) -> Init:
    owner = element.child("Actions") or element
    global_actions, user_defined, privates = [], [], []
    for child in owner.children():
        if child.tag == "GlobalAction":
            global_actions.extend(read_actions(child, "", context))
        elif child.tag == "UserDefinedAction":
            user_defined.extend(read_actions(child, "", context))
        elif child.tag == "Private":
            entity = context.entity(child)
            actions = [action for item in child.children("PrivateAction") for action in read_actions(item, "", context)]
            privates.append(Private(entity, tuple(actions), child.place()))
        else:
            context.note(child)
    return Init(tuple(global_actions), tuple(user_defined), tuple(privates))


def _read_group(element: XmlElement, context: Context) -> ManeuverGroup:
    maneuvers = []
    for child in element.children("Maneuver", "CatalogReference"):
        if child.tag == "Maneuver":
            maneuver = child.within(local_scope(child))
        else:
            maneuver = context.catalogs.entry(child)
            if maneuver.tag != "Maneuver":
                child.fail(f"catalog entry '{maneuver.raw('name')}' is a {maneuver.tag}, not a Maneuver")
        maneuvers.append(read_struct(Maneuver, maneuver, context))
    owner = element.child("Actors")
    actors = Actors((), False, element.place()) if owner is None else read_struct(Actors, owner, context)
    return read_struct(ManeuverGroup, element, context, maneuvers=tuple(maneuvers), actors=actors)


def _read_event(element: XmlElement, context: Context) -> Event:
    actions = list[Action]()
    for item in element.children("Action"):
        contents = list(item.children("PrivateAction", "GlobalAction", "UserDefinedAction"))
        if not contents and item.child() is not None:
            item.fail("contains no PrivateAction, GlobalAction or UserDefinedAction")
        parts = (read_actions(content, item.text("name", ""), context) for content in contents)
        actions += chain.from_iterable(parts)
    return read_struct(Event, element, context, actions=tuple(actions))


def _read_phase(element: XmlElement, context: Context) -> TrafficSignalPhase:
    shown = element.children("TrafficSignalState")
    states = tuple((state.text("trafficSignalId"), state.text("state")) for state in shown)
    return read_struct(TrafficSignalPhase, element, context, states=states)


# ---- triggers and conditions ----
def _read_trigger(element: XmlElement, context: Context) -> Trigger:
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
        None if by_type is None else by_type.value("type", EntityCategory),
        place=e.place(),
    )


def _time_to_collision(e: XmlElement, context: Context) -> conditions.TimeToCollisionCondition:
    owner = e.required("TimeToCollisionConditionTarget")
    reference = owner.child("EntityRef")
    target = read_position(owner.required("Position"), context) if reference is None else context.entity(reference)
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


READERS: dict[object, Reader] = {
    **POSITION_READERS,
    **ENTITY_READERS,
    Event: _read_event,
    Init: _read_init,
    ManeuverGroup: _read_group,
    Story: lambda e, context: read_struct(Story, e.within(local_scope(e)), context),
    TransitionDynamics: read_transition,
    TrafficSignalPhase: _read_phase,
    Trigger: _read_trigger,
}
