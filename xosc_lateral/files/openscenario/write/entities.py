"""Entities and init of a written scenario, what no longer drives them, and what they do besides moving."""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress

from lxml import etree

from xosc_lateral.files.openscenario.actions import GROUPING
from xosc_lateral.files.openscenario.declarations import NAMES, final
from xosc_lateral.files.openscenario.element import at_node, children_of, elements, local_name
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.draft import Draft, source_of
from xosc_lateral.world.motion.nominal import PlayedAction
from xosc_lateral.world.scenario.controllers import named
from xosc_lateral.world.scenario.dependence import assigned_controllers, controlled_entities
from xosc_lateral.world.scenario.enums import Priority
from xosc_lateral.world.scenario.expressions import ExpressionError
from xosc_lateral.world.scenario.global_actions import ParameterModifyAction, ParameterSetAction
from xosc_lateral.world.scenario.parameters import Scope
from xosc_lateral.world.scenario.place import Place, Unsupported
from xosc_lateral.world.scenario.private_actions import CONTROLLER, MOTION
from xosc_lateral.world.scenario.scenario import Action, Scenario

_REPLACED_TAGS = {kind.__name__ for kind in MOTION + CONTROLLER}


def remove_controllers(draft: Draft, converted: Collection[str]) -> None:
    """Take the controllers off entities that follow trajectories: they would drive them elsewhere."""
    note_controllers(draft, converted)
    for entity in draft.scenario.entities:
        if entity.name not in converted or not entity.controllers:
            continue
        item = at_node(draft.root, entity.place.node)
        if local_name(item) != "ScenarioObject":
            continue  # described in a catalog
        for owner in item.findall("{*}ObjectController"):
            item.remove(owner)


def note_controllers(draft: Draft, converted: Collection[str]) -> None:
    """Once for each entity: what drove it, and no longer does."""
    driving, assigned = controlled_entities(draft.scenario), assigned_controllers(draft.scenario)
    for entity in draft.scenario.entities:
        if entity.name not in converted:
            continue
        names = ", ".join(dict.fromkeys(map(named, assigned[entity.name])))
        if control := driving.get(entity.name):
            reason = f"'{entity.name}' follows a trajectory: controller {control}; now as the default driver would"
        elif names:
            reason = f"'{entity.name}' follows a trajectory: controller {names}, which was never active"
        else:
            continue
        draft.removed.append(Unsupported("ObjectController", entity.place, reason))


def rewrite_init(draft: Draft, starts: Mapping[str, tuple[build.Pose, float] | None]) -> None:
    """Replace what moves the converted entities in init by a place and a speed; lights, visibility and others stay.

    A start of None leaves init as it is: the entity is not there at the start.
    """
    actions = draft.init_actions
    done: set[str] = set()
    # The reader's order is the file's: names need no parameters filled in again.
    owners = actions.findall("{*}Private")
    for owner, private in zip(owners, draft.scenario.storyboard.init.privates, strict=True):
        start = starts.get(private.entity_ref)
        if start is None:
            continue
        for action in owner.findall("{*}PrivateAction"):
            _prune(action)
            if not children_of(action):
                owner.remove(action)
        if private.entity_ref not in done:
            _place(owner, start)
            done.add(private.entity_ref)
        if not children_of(owner):
            actions.remove(owner)
    for name, start in starts.items():
        if start is not None and name not in done:
            owner = etree.Element("Private", {"entityRef": name})
            _place(owner, start)
            build.insert_indented(actions, len(actions), owner)


def _place(owner: etree._Element, start: tuple[build.Pose, float]) -> None:
    pose, speed = start
    teleport, drive = etree.Element("PrivateAction"), etree.Element("PrivateAction")
    build.world_position(build.sub(teleport, "TeleportAction"), pose)
    build.speed_step(drive, speed)
    build.insert_indented(owner, 0, teleport)
    build.insert_indented(owner, 1, drive)


def _prune(element: etree._Element) -> None:
    """Remove motion and controller actions, and grouping elements that are empty then."""
    for child in children_of(element):
        tag = local_name(child)
        if tag in _REPLACED_TAGS:
            element.remove(child)
        elif tag in GROUPING:
            _prune(child)
            if not children_of(child):
                element.remove(child)


# ---- actions that are no motion: copied out of the source, to happen when they were played ----
def is_replaced(action: Action, actor: str | None, converted: Collection[str]) -> bool:
    """Whether a written trajectory stands for this action."""
    return actor in converted and isinstance(action.content, MOTION + CONTROLLER)


def add_kept_actions(
    story: etree._Element, name: str, draft: Draft, played: Sequence[PlayedAction], poses: Mapping[int, build.Pose]
) -> None:
    """Add an act with one event for each action that is not replaced, in the order of the run; none for no actions.

    Each run of actions with the same actor has a maneuver group, so that the order holds across actors, too.
    `poses`: of an AddEntityAction, by index in `played`: where the entity appears on its written path.
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
