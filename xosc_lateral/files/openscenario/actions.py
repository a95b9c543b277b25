"""The storyboard: init, stories, events, and their actions: global, user-defined, private."""

from __future__ import annotations

from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.files.openscenario.conditions import read_trigger
from xosc_lateral.files.openscenario.context import Context, Reader, declared, read_struct
from xosc_lateral.files.openscenario.declarations import local_scope
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.openscenario.entities import (
    read_bounding_box,
    read_controller,
    read_environment,
    read_performance,
)
from xosc_lateral.files.openscenario.positions import READERS as POSITION_READERS
from xosc_lateral.files.openscenario.positions import read_position
from xosc_lateral.world.scenario import private_actions as private
from xosc_lateral.world.scenario.entity import BoundingBox, Controller, Performance
from xosc_lateral.world.scenario.enums import DynamicsShape
from xosc_lateral.world.scenario.global_actions import (
    AddEntityAction,
    DeleteEntityAction,
    Environment,
    EnvironmentAction,
    ModifyOperation,
    ParameterModifyAction,
    ParameterSetAction,
    SetMonitorAction,
    TrafficAction,
    TrafficSignalControllerAction,
    TrafficSignalStateAction,
    UserDefinedAction,
    VariableModifyAction,
    VariableSetAction,
)
from xosc_lateral.world.scenario.parameters import ExpressionError
from xosc_lateral.world.scenario.place import Unsupported
from xosc_lateral.world.scenario.private_actions import TransitionDynamics
from xosc_lateral.world.scenario.scenario import (
    Action,
    Actors,
    Event,
    Init,
    Maneuver,
    ManeuverGroup,
    Private,
    Story,
    Trigger,
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
    """Actions in a PrivateAction, GlobalAction or UserDefinedAction element: one, or more in lenient files.

    In version 1.0 a ControllerAction holds both an assignment and an override; the assignment comes first.
    """
    private = owner.tag == "PrivateAction"
    readers = PRIVATE_ACTIONS if private else GLOBAL_ACTIONS
    try:
        scope = owner.scope.local_values()
    except ExpressionError as error:
        owner.fail(f"parameters that are declared around it: {error}")
    contents = [owner] if owner.tag == "UserDefinedAction" else list(_contents(owner))
    if not contents:
        context.remark(owner, "contains no action: played as nothing")
    actions = []
    for element in contents:
        reader = readers.get(element.tag)
        content = reader(element, context) if reader else Unsupported(element.tag, element.place())
        actions.append(Action(name, content, owner.place(), private, scope))
    return actions


def _contents(owner: XmlElement) -> list[XmlElement]:
    elements: list[XmlElement] = []
    for child in owner.children():
        elements.extend(_contents(child) if child.tag in GROUPING else [child])
    return elements


def _entity(e: XmlElement, context: Context) -> AddEntityAction | DeleteEntityAction:
    if (add := e.child("AddEntityAction")) is not None:
        return AddEntityAction(context.entity(e), read_position(add.required("Position"), context), place=e.place())
    e.required("DeleteEntityAction")
    return DeleteEntityAction(context.entity(e), place=e.place())


def _setting(sets: type[Struct], modifies: type[Struct]) -> Reader:
    """Of a parameter or a variable."""

    def read(e: XmlElement, context: Context) -> Struct:
        if (change := e.child("SetAction")) is not None:
            return read_struct(sets, e, context, value=change.text("value"))
        rule = e.required("ModifyAction").required("Rule").required("AddValue", "MultiplyByValue")
        return read_struct(modifies, e, context, operation=ModifyOperation(rule.tag), value=rule.number("value"))

    return read


def _traffic(e: XmlElement, _: Context) -> TrafficAction:
    content = e.child()
    return TrafficAction(content.tag if content else e.tag, place=e.place())


def _user_defined(e: XmlElement, _: Context) -> UserDefinedAction:
    command = e.child("CustomCommandAction")
    if command is None:
        return UserDefinedAction("", "", place=e.place())
    return UserDefinedAction(command.text("type", ""), (command.xml.text or "").strip(), place=e.place())


GLOBAL_ACTIONS: dict[str, Reader] = {
    **declared(EnvironmentAction, SetMonitorAction, TrafficSignalStateAction, TrafficSignalControllerAction),
    "EntityAction": _entity,
    "ParameterAction": _setting(ParameterSetAction, ParameterModifyAction),
    "VariableAction": _setting(VariableSetAction, VariableModifyAction),
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
    shape = dynamics.choice("dynamicsShape", DynamicsShape, DynamicsShape.STEP)
    most = dynamics.optional_number("maxLateralAcc", finite=False)
    action = read_struct(private.LaneOffsetAction, e, context, shape=shape, max_lateral_acc=most)
    return replace(action, target=replace(action.target, value=-action.target.value)) if context.left_handed else action


def _override(e: XmlElement, _: Context) -> private.OverrideControllerValueAction:
    overrides = tuple((item.tag, item.boolean("active", False), item.optional_number("value")) for item in e.children())
    return private.OverrideControllerValueAction(overrides, place=e.place())


def _animation(e: XmlElement, context: Context) -> private.AnimationAction:
    owner = e.child("AnimationType")
    content = None if owner is None else owner.child()
    return read_struct(private.AnimationAction, e, context, kind=content.tag if content else "")


def read_transition(e: XmlElement, context: Context) -> TransitionDynamics:
    """How a value goes to its target; a step needs no value."""
    is_step = e.choice("dynamicsShape", DynamicsShape, DynamicsShape.STEP) is DynamicsShape.STEP
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
            context.remark(child)
    return Init(tuple(global_actions), tuple(user_defined), tuple(privates))


def _read_story(element: XmlElement, context: Context) -> Story:
    return read_struct(Story, element.within(local_scope(element)), context)


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
    actions = []
    for item in element.children("Action"):
        contents = list(item.children("PrivateAction", "GlobalAction", "UserDefinedAction"))
        if not contents and item.child() is not None:
            item.fail("contains no PrivateAction, GlobalAction or UserDefinedAction")
        for content in contents:
            actions.extend(read_actions(content, item.text("name", ""), context))
    return read_struct(Event, element, context, actions=tuple(actions))


READERS: dict[object, Reader] = {
    **POSITION_READERS,
    BoundingBox: read_bounding_box,
    Controller: read_controller,
    Environment: read_environment,
    Event: _read_event,
    Init: _read_init,
    ManeuverGroup: _read_group,
    Performance: read_performance,
    Story: _read_story,
    TransitionDynamics: read_transition,
    Trigger: read_trigger,
}
