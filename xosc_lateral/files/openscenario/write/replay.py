"""Trajectories in place of all maneuvers: what goes, and what else happens, at the times of the run."""

from __future__ import annotations

import copy
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress

from lxml import etree

from xosc_lateral.base.note import Note
from xosc_lateral.base.track import Track
from xosc_lateral.files.openscenario.element import at_node, child_of, children_of, elements, local_name
from xosc_lateral.files.openscenario.references import NAMES, final
from xosc_lateral.files.openscenario.storyboard import GROUPING
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.carla import add_drives, start_of
from xosc_lateral.files.openscenario.write.draft import Draft, Player, source_of
from xosc_lateral.files.openscenario.write.moving import Moving, add_trajectories, moving_entities
from xosc_lateral.files.openscenario.write.versions import newer_than
from xosc_lateral.files.xml import parse_xml
from xosc_lateral.world.motion.nominal import NominalMotion, PlayedAction
from xosc_lateral.world.scenario.conditions import SimulationTimeCondition
from xosc_lateral.world.scenario.controllers import assigned_controllers, controlled_entities, named
from xosc_lateral.world.scenario.enums import Priority
from xosc_lateral.world.scenario.global_actions import AddEntityAction, ParameterModifyAction, ParameterSetAction
from xosc_lateral.world.scenario.parameters import ExpressionError, Scope
from xosc_lateral.world.scenario.private_actions import CONTROLLER, MOTION, ConnectTrailerAction
from xosc_lateral.world.scenario.scenario import Scenario, conditions_of

_REPLACED_TAGS = {kind.__name__ for kind in MOTION + CONTROLLER}


def remove_controllers(draft: Draft, converted: Collection[str]) -> None:
    """Take the controllers off entities that follow trajectories, and name them: they would drive them elsewhere."""
    driving, assigned = controlled_entities(draft.scenario), assigned_controllers(draft.scenario)
    for entity in draft.scenario.entities:
        if entity.name not in converted:
            continue
        what = ", ".join(dict.fromkeys(map(named, assigned[entity.name]))) + ", which was never active"
        if control := driving.get(entity.name):
            what = f"{control}; now as the default driver would"
        if control or assigned[entity.name]:
            reason = f"ObjectController left out ('{entity.name}' follows a trajectory: controller {what})"
            draft.notes.append(entity.place.note(reason, is_warning=True, entity=entity.name))
        if entity.controllers and entity.place.path == str(draft.scenario.path):  # else described in a catalog
            item = at_node(draft.root, entity.place.node)
            for owner in item.findall("{*}ObjectController"):
                item.remove(owner)


def rewrite_init(draft: Draft, starts: Mapping[str, tuple[build.Pose, float] | None]) -> None:
    """A place and a speed in place of what moves entities in init; a start of None (not there yet) changes nothing."""
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
def kept_actions(draft: Draft, played: Iterable[PlayedAction], moving: Collection[str]) -> list[PlayedAction]:
    """Those of events that no trajectory stands for, in the order of the run; those that can't be kept are named."""
    kept: list[PlayedAction] = []
    dropped: dict[Note, None] = {}
    for item in played:
        content, place = item.action.content, item.action.place
        if item.path == ("Init",):
            continue
        is_set = isinstance(content, ParameterSetAction | ParameterModifyAction)
        if is_set and content.parameter_ref not in draft.scenario.parameters:
            reason = f"left out (sets parameter '{content.parameter_ref}' of a story that is no longer there)"
            dropped[place.note(reason, is_warning=True, entity=item.actor)] = None
        elif item.actor not in moving or not isinstance(content, MOTION + CONTROLLER):
            kept.append(item)
    draft.notes += dropped
    return kept


def add_kept_actions(
    story: etree._Element, name: str, draft: Draft, played: Sequence[PlayedAction], poses: Mapping[int, build.Pose]
) -> None:
    """Add an act with an event per action, in order, a group for each run of an actor's; `poses`: of those added."""
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


# ---- all maneuvers gone ----
STORY = "xosc-lateral"
TRAILERS_SINCE = (1, 3)
"""Version from which a trailer follows whoever pulls it; in older ones it is an entity like others."""
STOP_TRIGGER = "stop trigger"
"""`NominalMotion.ended_by` of a run that the scenario itself ended."""


def replay(draft: Draft, trajectories: Mapping[str, Track]) -> tuple[str, ...]:
    """Put trajectories in place of all maneuvers: all else happens when it happened in the run; who follows one."""
    alone = draft.is_adapted and draft.version < TRAILERS_SINCE
    pulled = set() if alone else pulled_entities(draft.scenario, draft.motion)
    moving = moving_entities(draft, {name: path for name, path in trajectories.items() if name not in pulled})
    kept = kept_actions(draft, draft.motion.actions, moving)
    remove_controllers(draft, moving)
    for_carla = draft.player is Player.CARLA
    rewrite_init(draft, {name: start_of(item) if for_carla else item.start for name, item in moving.items()})
    index = _take_away(draft.storyboard)
    story = _new_story(draft, kept, moving)
    if len(story):
        build.insert_indented(draft.storyboard, index, story)
    _replace_stop_trigger(draft)
    return tuple(moving)


def pulled_entities(scenario: Scenario, motion: NominalMotion) -> set[str]:
    """Entities that are pulled at some time: the player moves them itself."""
    contents = (played.action.content for played in motion.actions)
    coupled = {content.trailer_ref for content in contents if isinstance(content, ConnectTrailerAction)}
    return {entity.trailer for entity in scenario.entities if entity.trailer is not None} | coupled


def _take_away(storyboard: etree._Element) -> int:
    """Stories; their comments stay. Where the next one belongs."""
    stories, init = storyboard.findall("{*}Story"), child_of(storyboard, "Init")
    assert init is not None
    index = storyboard.index(init) + 1
    comments = [comment for old in stories for comment in old.iter(etree.Comment)]
    for old in stories:
        storyboard.remove(old)
    for comment in comments:
        build.insert_indented(storyboard, index, etree.Comment(comment.text))
        index += 1
    return index


def _new_story(draft: Draft, kept: Sequence[PlayedAction], moving: Mapping[str, Moving]) -> etree._Element:
    story = build.story(STORY)
    # Before the trajectories: an entity has to be there before it moves.
    poses = {
        index: moving[content.entity_ref].pose_after(played.start)
        for index, played in enumerate(kept)
        if isinstance(content := played.action.content, AddEntityAction) and content.entity_ref in moving
    }
    add_kept_actions(story, f"{STORY} kept actions", draft, kept, poses)
    with_pieces = [item for item in moving.values() if item.pieces]
    # Up to 1.1 there has to be a story, even if nothing happens in it.
    if with_pieces or (not kept and draft.version < (1, 2)):
        act = build.sub(story, "Act", name=f"{STORY} trajectories")
        add = add_drives if draft.player is Player.CARLA else add_trajectories
        for item in with_pieces:
            add(act, f"{STORY} {item.name}", item, draft)
        if not with_pieces:
            build.maneuver_group(act, f"{STORY} nothing", None)
        build.time_trigger(act, "StartTrigger", 0.0, draft.version)
    return story


def _replace_stop_trigger(draft: Draft) -> None:
    """The played end, unless the scenario ended itself by nothing but the time."""
    old, read = child_of(draft.storyboard, "StopTrigger"), draft.scenario.storyboard.stop_trigger
    by_time = all(isinstance(condition.content, SimulationTimeCondition) for condition in conditions_of(read))
    if old is not None and draft.motion.ended_by == STOP_TRIGGER and read is not None and by_time:
        return
    if old is not None:
        draft.storyboard.remove(old)
    trigger = build.time_trigger(etree.Element("holder"), "StopTrigger", draft.motion.end_time, draft.version)
    build.insert_indented(draft.storyboard, len(draft.storyboard), trigger)


def motion_unknown_to(
    version: build.Version, scenario: Scenario, motion: NominalMotion, entities: Collection[str]
) -> dict[str, str]:
    """Those of some entities with a maneuver in this run that a version does not know, and which."""
    if version >= scenario.header.version:
        return {}
    root = parse_xml(scenario.source, scenario.path)
    reasons: dict[str, str] = {}
    for played in motion.actions:
        actor, content = played.actor, played.action.content
        if actor is None or actor not in entities or actor in reasons or not isinstance(content, MOTION):
            continue
        what = newer_than(source_of(played.action, scenario, root), version)
        if what is not None:
            reasons[actor] = f"version {build.version_text(version)} has no {what}"
    if version < TRAILERS_SINCE:
        trailers = sorted(pulled_entities(scenario, motion) & set(entities))
        reasons |= dict.fromkeys(trailers, f"version {build.version_text(version)} has no Trailer")
    return reasons
