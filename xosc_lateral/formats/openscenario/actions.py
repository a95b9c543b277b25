"""Actions of init and events: global, user-defined, private."""

from __future__ import annotations

from collections.abc import Callable

from xosc_lateral.formats.openscenario.context import Context
from xosc_lateral.formats.openscenario.declarations import parameter_name
from xosc_lateral.formats.openscenario.element import XmlElement
from xosc_lateral.formats.openscenario.entities import read_environment
from xosc_lateral.formats.openscenario.positions import read_position_in
from xosc_lateral.formats.openscenario.private_actions import PRIVATE_ACTIONS
from xosc_lateral.scenario.global_actions import (
    AddEntityAction,
    DeleteEntityAction,
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
from xosc_lateral.scenario.place import Content, Unsupported
from xosc_lateral.scenario.storyboard import Action

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
    scope = owner.scope.local_values()
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
    found: list[XmlElement] = []
    for child in owner.children():
        found.extend(_contents(child) if child.tag in GROUPING else [child])
    return found


def _environment(e: XmlElement, context: Context) -> Content:
    return EnvironmentAction(read_environment(e, context), e.place())


def _entity(e: XmlElement, context: Context) -> Content:
    add = e.child("AddEntityAction")
    if add is not None:
        return AddEntityAction(context.entity(e), read_position_in(add, context), e.place())
    e.required("DeleteEntityAction")
    return DeleteEntityAction(context.entity(e), e.place())


def _parameter(e: XmlElement, _: Context) -> Content:
    name = parameter_name(e.raw("parameterRef") or e.text("parameterRef"))
    change = e.child("SetAction")
    if change is not None:
        return ParameterSetAction(name, change.text("value"), e.place())
    operation, value = _modification(e)
    return ParameterModifyAction(name, operation, value, e.place())


def _variable(e: XmlElement, _: Context) -> Content:
    name = parameter_name(e.raw("variableRef") or e.text("variableRef"))
    change = e.child("SetAction")
    if change is not None:
        return VariableSetAction(name, change.text("value"), e.place())
    operation, value = _modification(e)
    return VariableModifyAction(name, operation, value, e.place())


def _modification(e: XmlElement) -> tuple[ModifyOperation, float]:
    rule = e.required("ModifyAction").required("Rule").required("AddValue", "MultiplyByValue")
    return ModifyOperation(rule.tag), rule.number("value")


def _monitor(e: XmlElement, _: Context) -> Content:
    return SetMonitorAction(e.text("monitorRef"), e.boolean("value"), e.place())


def _signal_state(e: XmlElement, _: Context) -> Content:
    return TrafficSignalStateAction(e.text("name"), e.text("state"), e.place())


def _signal_controller(e: XmlElement, _: Context) -> Content:
    return TrafficSignalControllerAction(e.text("trafficSignalControllerRef"), e.text("phase"), e.place())


def _traffic(e: XmlElement, _: Context) -> Content:
    content = e.child()
    return TrafficAction(content.tag if content else e.tag, e.place())


def _user_defined(e: XmlElement, _: Context) -> Content:
    command = e.child("CustomCommandAction")
    if command is None:
        return UserDefinedAction("", "", e.place())
    return UserDefinedAction(command.text("type", ""), (command.xml.text or "").strip(), e.place())


GLOBAL_ACTIONS: dict[str, Callable[[XmlElement, Context], Content]] = {
    "EnvironmentAction": _environment,
    "EntityAction": _entity,
    "ParameterAction": _parameter,
    "VariableAction": _variable,
    "SetMonitorAction": _monitor,
    "TrafficSignalStateAction": _signal_state,
    "TrafficSignalControllerAction": _signal_controller,
    "TrafficAction": _traffic,
    "UserDefinedAction": _user_defined,
}
