"""Entities and init of a written scenario: where they start, and what no longer drives them."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from lxml import etree

from xosc_lateral.formats.openscenario.actions import GROUPING
from xosc_lateral.formats.openscenario.element import at_node, local_name
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.non_motion_actions import CONTROLLER, MOTION, Pose
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.entity import Entity
from xosc_lateral.scenario.place import Unsupported

_REPLACED_TAGS = {kind.__name__ for kind in MOTION + CONTROLLER}


def remove_controllers(root: etree._Element, scenario: Scenario, converted: Collection[str]) -> list[Unsupported]:
    """Take the controllers off entities that follow trajectories: they would drive them elsewhere."""
    removed = []
    for entity in scenario.entities:
        if entity.name not in converted or not entity.controllers:
            continue
        item = at_node(root, entity.place.node)
        if local_name(item) != "ScenarioObject":
            continue  # described in a catalog
        for controller in [child for child in item if local_name(child) == "ObjectController"]:
            item.remove(controller)
        removed += _removed(entity)
    return removed


def _removed(entity: Entity) -> list[Unsupported]:
    return [
        Unsupported(
            "ObjectController",
            controller.place,
            f"'{controller.name}' of '{entity.name}', which follows a trajectory",
        )
        for controller in entity.controllers
    ]


def rewrite_init(root: etree._Element, scenario: Scenario, starts: Mapping[str, tuple[Pose, float] | None]) -> None:
    """Replace what moves the converted entities in init by a place and a speed; lights, visibility and others stay.

    Parameters
    ----------
    starts : mapping of str to (pose, speed), or None
        Converted entities; None leaves init as it is: the entity is not there at the start.
    """
    storyboard = next(e for e in root if local_name(e) == "Storyboard")
    init = next(e for e in storyboard if local_name(e) == "Init")
    actions = next((e for e in init if local_name(e) == "Actions"), init)
    done: set[str] = set()
    # The reader's order is the file's: names need no parameters filled in again.
    owners = [e for e in actions if local_name(e) == "Private"]
    for owner, private in zip(owners, scenario.storyboard.init.privates, strict=True):
        start = starts.get(private.entity_ref)
        if start is None:
            continue
        _remove_motion(owner)
        if private.entity_ref not in done:
            _place(owner, start)
            done.add(private.entity_ref)
        if not any(isinstance(child.tag, str) for child in owner):
            actions.remove(owner)
    for name, start in starts.items():
        if start is not None and name not in done:
            owner = etree.Element("Private", {"entityRef": name})
            _place(owner, start)
            build.insert_indented(actions, len(actions), owner)


def _place(owner: etree._Element, start: tuple[Pose, float]) -> None:
    pose, speed = start
    teleport, drive = etree.Element("PrivateAction"), etree.Element("PrivateAction")
    build.world_position(build.sub(teleport, "TeleportAction"), pose)
    build.speed_step(drive, speed)
    build.insert_indented(owner, 0, teleport)
    build.insert_indented(owner, 1, drive)


def _remove_motion(owner: etree._Element) -> None:
    for action in [child for child in owner if local_name(child) == "PrivateAction"]:
        _prune(action)
        if not any(isinstance(child.tag, str) for child in action):
            owner.remove(action)


def _prune(element: etree._Element) -> None:
    """Remove motion and controller actions, and grouping elements that are empty then."""
    for child in [child for child in element if isinstance(child.tag, str)]:
        tag = local_name(child)
        if tag in _REPLACED_TAGS:
            element.remove(child)
        elif tag in GROUPING:
            _prune(child)
            if not any(isinstance(inner.tag, str) for inner in child):
                element.remove(child)
