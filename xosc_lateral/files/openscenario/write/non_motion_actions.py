"""Actions that are no motion: copied out of the source, to happen at the time at which they were played."""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress

from lxml import etree

from xosc_lateral.files.openscenario.declarations import NAMES, final
from xosc_lateral.files.openscenario.element import elements, local_name
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.draft import Draft, source_of
from xosc_lateral.world.motion.nominal import PlayedAction
from xosc_lateral.world.scenario import Action, Scenario
from xosc_lateral.world.scenario.enums import Priority
from xosc_lateral.world.scenario.expressions import ExpressionError
from xosc_lateral.world.scenario.global_actions import ParameterModifyAction, ParameterSetAction
from xosc_lateral.world.scenario.parameters import Scope
from xosc_lateral.world.scenario.place import Place, Unsupported
from xosc_lateral.world.scenario.private_actions import CONTROLLER, MOTION


def is_replaced(action: Action, actor: str | None, converted: Collection[str]) -> bool:
    """Whether a written trajectory stands for this action."""
    return actor in converted and isinstance(action.content, MOTION + CONTROLLER)


def add_kept_actions(
    story: etree._Element, name: str, draft: Draft, played: Sequence[PlayedAction], poses: Mapping[int, build.Pose]
) -> None:
    """Add an act with one event for each action, in the order of the run; none for no actions.

    Parameters
    ----------
    story : element
        Gets an act of that name, with a maneuver group for each run of actions with the same actor, so that the order
        holds across actors, too.
    played : sequence of PlayedAction
        Actions of events that are not replaced.
    poses : mapping of int to tuple
        For an AddEntityAction, by index in `played`: where the entity appears on its written path.
    """
    if not played:
        return
    act = build.sub(story, "Act", name=name)
    maneuver: etree._Element | None = None
    actor: str | None = None
    for index, item in enumerate(played):
        if maneuver is None or item.actor != actor:
            actor = item.actor
            maneuver = build.maneuver(act, f"kept {index + 1}", actor)
        source = source_of(item.action, draft.scenario, draft.untouched)
        named = item.action.name or local_name(source)
        event = build.event(maneuver, f"kept {index + 1}: {named}", Priority.PARALLEL, draft.version)
        action = build.sub(event, "Action", name=named)
        action.append(_copied(source, item.action.scope, draft.scope))
        if index in poses:
            (add,) = elements(action, "AddEntityAction")
            add[:] = []
            build.world_position(add, poses[index])
        build.time_trigger(event, "StartTrigger", item.start, draft.version)
    build.time_trigger(act, "StartTrigger", 0.0, draft.version)


def dropped_reason(action: Action, scenario: Scenario) -> str | None:
    """Why an action that is no motion can't be kept; None if it can."""
    content = action.content
    if isinstance(content, ParameterSetAction | ParameterModifyAction) and (
        content.parameter_ref not in scenario.parameters
    ):
        return f"sets parameter '{content.parameter_ref}' of a story that is no longer there"
    return None


def note_dropped(draft: Draft, played: Iterable[PlayedAction]) -> None:
    """Name the actions that are neither motion nor kept, with reasons, each place once."""
    unsupported: dict[tuple[Place, str | None], Unsupported] = {}
    for item in played:
        reason = dropped_reason(item.action, draft.scenario) if item.path != ("Init",) else None
        if reason is not None:
            place = item.action.place
            unsupported[place, item.actor] = Unsupported(type(item.action.content).__name__, place, reason)
    draft.removed += unsupported.values()


def _copied(source: etree._Element, mine: Mapping[str, str], scope: Scope) -> etree._Element:
    """Copy with the parameters of story, maneuver and catalog filled in; global ones stay parameters."""
    element = copy.deepcopy(source)
    element.tail = None
    local = Scope({name: final(value) for name, value in mine.items()}, scope)
    for item in elements(element) if mine else ():
        for attribute, value in item.attrib.items():
            text = str(value)
            if text.startswith("$") and attribute not in NAMES and any(f"${name}" in text for name in mine):
                with suppress(ExpressionError):
                    item.set(attribute, local.fill(text))
    return element
