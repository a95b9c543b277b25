"""Actions that are no motion: copied out of the source, to happen at the time at which they were played."""

from __future__ import annotations

import copy
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

from lxml import etree

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.openscenario.element import at_node, local_name
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.result import final
from xosc_lateral.formats.xml import read_document
from xosc_lateral.motion.nominal import PlayedAction
from xosc_lateral.scenario import Action, Scenario
from xosc_lateral.scenario.enums import Priority
from xosc_lateral.scenario.expressions import ExpressionError
from xosc_lateral.scenario.global_actions import AddEntityAction, ParameterModifyAction, ParameterSetAction
from xosc_lateral.scenario.parameters import Scope
from xosc_lateral.scenario.private_actions import (
    AcquirePositionAction,
    ActivateControllerAction,
    AssignControllerAction,
    AssignRouteAction,
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
    LongitudinalDistanceAction,
    OverrideControllerValueAction,
    SpeedAction,
    SpeedProfileAction,
    SynchronizeAction,
    TeleportAction,
)

MOTION = (
    TeleportAction,
    SpeedAction,
    SpeedProfileAction,
    LongitudinalDistanceAction,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
    SynchronizeAction,
    FollowTrajectoryAction,
    AssignRouteAction,
    AcquirePositionAction,
)
CONTROLLER = (AssignControllerAction, ActivateControllerAction, OverrideControllerValueAction)

Pose = tuple[float, float, float, float, float, float]


def is_replaced(action: Action, actor: str | None, converted: Collection[str]) -> bool:
    """Whether a written trajectory stands for this action."""
    return actor in converted and isinstance(action.content, MOTION + CONTROLLER)


def add_non_motion_actions(
    act: etree._Element,
    played: Sequence[PlayedAction],
    poses: dict[int, Pose],
    scenario: Scenario,
    root: etree._Element,
    scope: Scope,
    version: build.Version,
) -> None:
    """Add one event for each action, in the order of the run.

    Parameters
    ----------
    act : element
        Gets a maneuver group for each run of actions with the same actor, so that the order holds across actors, too.
    played : sequence of PlayedAction
        Actions of events that are not replaced.
    poses : mapping of int to tuple
        For an AddEntityAction, by index in `played`: where the entity appears on its written path.
    scenario : Scenario
    root : element
        Unchanged parse of the scenario's bytes: actions are copied from it.
    scope : Scope
        Global parameters.
    version : Version
        Of the output.
    """
    maneuver: etree._Element | None = None
    actor: str | None = None
    for index, item in enumerate(played):
        if maneuver is None or item.actor != actor:
            actor = item.actor
            maneuver = build.maneuver(act, f"kept {index + 1}", actor)
        name = item.action.name or local_name(source_of(item.action, scenario, root))
        event = build.event(maneuver, f"kept {index + 1}: {name}", Priority.PARALLEL, version)
        action = build.sub(event, "Action", name=name)
        action.append(_copied(item.action, scenario, root, scope))
        if index in poses:
            add = next(element for element in action.iter() if local_name(element) == "AddEntityAction")
            add[:] = []
            build.world_position(add, poses[index])
        build.time_trigger(event, "StartTrigger", item.start, version)


def dropped_reason(action: Action, scenario: Scenario) -> str | None:
    """Why an action that is no motion can't be kept; None if it can."""
    content = action.content
    if isinstance(content, ParameterSetAction | ParameterModifyAction) and (
        content.parameter_ref not in scenario.parameters
    ):
        return f"sets parameter '{content.parameter_ref}' of a story that is no longer there"
    return None


def is_placing(action: Action) -> bool:
    """An entity appears: its position has to be the one on its written path."""
    return isinstance(action.content, AddEntityAction)


def source_of(action: Action, scenario: Scenario, root: etree._Element) -> etree._Element:
    """The element that an action was read from: in the scenario, whose unchanged parse `root` is, or in a catalog."""
    if action.place.path == str(scenario.path):
        return at_node(root, action.place.node)
    path = Path(action.place.path)
    document = read_document(path)
    if scenario.input_hashes.get(path, document.sha256) != document.sha256:
        raise FormatError("changed during the conversion", path=path)
    catalog = document.root
    return at_node(catalog, action.place.node)


def _copied(action: Action, scenario: Scenario, root: etree._Element, scope: Scope) -> etree._Element:
    """Copy with the parameters of story, maneuver and catalog filled in; global ones stay parameters."""
    element = copy.deepcopy(source_of(action, scenario, root))
    element.tail = None
    if not action.scope:
        return element
    local = Scope({name: final(value) for name, value in action.scope.items()}, scope)
    for item in element.iter("{*}*"):  # no comments
        _fill_attributes(item, action.scope, local)
    return element


def _fill_attributes(item: etree._Element, mine: Mapping[str, str], local: Scope) -> None:
    """Those that mention parameters of the action's own."""
    for attribute, value in item.attrib.items():
        text = str(value)
        if text.startswith("$") and attribute not in ("parameterRef", "variableRef") and _mentions(text, mine):
            try:
                item.set(attribute, local.fill(text))
            except ExpressionError:
                continue


def _mentions(text: str, names: Collection[str]) -> bool:
    return any(f"${name}" in text for name in names)
