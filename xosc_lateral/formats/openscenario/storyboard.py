"""Init, stories, acts, maneuver groups, maneuvers, events."""

from __future__ import annotations

from xosc_lateral.formats.openscenario.actions import read_actions
from xosc_lateral.formats.openscenario.conditions import read_trigger
from xosc_lateral.formats.openscenario.context import Context
from xosc_lateral.formats.openscenario.declarations import local_scope
from xosc_lateral.formats.openscenario.element import XmlElement
from xosc_lateral.scenario.enums import Priority
from xosc_lateral.scenario.storyboard import (
    Act,
    Actors,
    Event,
    Init,
    Maneuver,
    ManeuverGroup,
    Private,
    Story,
    Storyboard,
)

PRIORITY_SYNONYMS = {"overwrite": Priority.OVERRIDE}


def read_storyboard(root: XmlElement, context: Context) -> Storyboard:
    """The whole storyboard."""
    element = root.required("Storyboard")
    return Storyboard(
        _read_init(element.required("Init"), context),
        tuple(_read_story(story, context) for story in element.children("Story")),
        read_trigger(element.child("StopTrigger"), context),
        element.place(),
    )


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
    story = element.within(local_scope(element))
    acts = tuple(_read_act(act, context) for act in story.children("Act"))
    return Story(story.text("name", ""), acts, story.place())


def _read_act(element: XmlElement, context: Context) -> Act:
    return Act(
        element.text("name", ""),
        tuple(_read_group(group, context) for group in element.children("ManeuverGroup")),
        read_trigger(element.child("StartTrigger"), context),
        read_trigger(element.child("StopTrigger"), context),
        element.place(),
    )


def _read_group(element: XmlElement, context: Context) -> ManeuverGroup:
    maneuvers = []
    for child in element.children("Maneuver", "CatalogReference"):
        if child.tag == "Maneuver":
            maneuvers.append(_read_maneuver(child.within(local_scope(child)), context))
        else:
            entry = context.catalogs.entry(child)
            if entry.tag != "Maneuver":
                child.fail(f"catalog entry '{entry.raw('name')}' is a {entry.tag}, not a Maneuver")
            maneuvers.append(_read_maneuver(entry, context))
    return ManeuverGroup(
        element.text("name", ""),
        _read_actors(element, context),
        tuple(maneuvers),
        element.place(),
        element.integer("maximumExecutionCount", 1),
    )


def _read_actors(group: XmlElement, context: Context) -> Actors:
    element = group.child("Actors")
    if element is None:
        return Actors((), False, group.place())
    names = [name for reference in element.children("EntityRef") for name in context.members(reference)]
    return Actors(tuple(names), element.boolean("selectTriggeringEntities", False), element.place())


def _read_maneuver(element: XmlElement, context: Context) -> Maneuver:
    events = tuple(_read_event(event, context) for event in element.children("Event"))
    return Maneuver(element.text("name", ""), events, element.place())


def _read_event(element: XmlElement, context: Context) -> Event:
    actions = []
    for item in element.children("Action"):
        contents = list(item.children("PrivateAction", "GlobalAction", "UserDefinedAction"))
        if not contents and item.child() is not None:
            item.fail("contains no PrivateAction, GlobalAction or UserDefinedAction")
        for content in contents:
            actions.extend(read_actions(content, item.text("name", ""), context))
    return Event(
        element.text("name", ""),
        element.choice("priority", Priority, Priority.PARALLEL, PRIORITY_SYNONYMS),
        tuple(actions),
        read_trigger(element.child("StartTrigger"), context),
        element.place(),
        element.integer("maximumExecutionCount", 1),
    )
