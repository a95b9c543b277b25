"""Entities and init of a written scenario: where they start, and what no longer drives them."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from lxml import etree

from xosc_lateral.files.openscenario.actions import GROUPING
from xosc_lateral.files.openscenario.element import at_node, children_of, local_name
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.draft import Draft
from xosc_lateral.world.scenario.controllers import named
from xosc_lateral.world.scenario.place import Unsupported
from xosc_lateral.world.scenario.private_actions import CONTROLLER, MOTION
from xosc_lateral.world.scenario.under_test import assigned_controllers, controlled_entities

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

    Parameters
    ----------
    starts : mapping of str to (pose, speed), or None
        Converted entities; None leaves init as it is: the entity is not there at the start.
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
