"""Init, stories, acts, maneuver groups, maneuvers, events."""

from __future__ import annotations

from xosc_lateral.files.openscenario.actions import read_actions, read_transition
from xosc_lateral.files.openscenario.conditions import read_trigger
from xosc_lateral.files.openscenario.context import Context, Reader, read_struct
from xosc_lateral.files.openscenario.declarations import local_scope
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.openscenario.entities import read_bounding_box, read_controller, read_performance
from xosc_lateral.files.openscenario.positions import READERS as POSITION_READERS
from xosc_lateral.world.scenario.entity import BoundingBox, Controller, Performance
from xosc_lateral.world.scenario.private_actions import TransitionDynamics
from xosc_lateral.world.scenario.storyboard import Actors, Event, Init, Maneuver, ManeuverGroup, Private, Story, Trigger


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
    Event: _read_event,
    Init: _read_init,
    ManeuverGroup: _read_group,
    Performance: read_performance,
    Story: _read_story,
    TransitionDynamics: read_transition,
    Trigger: read_trigger,
}
