"""Write a played scenario with trajectories in place of its maneuvers."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from lxml import etree

from xosc_lateral.files.openscenario.element import child_of
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.carla import add_drives, start_of
from xosc_lateral.files.openscenario.write.draft import Draft, Player, source_of
from xosc_lateral.files.openscenario.write.entities import (
    add_kept_actions,
    dropped_reason,
    is_replaced,
    note_dropped,
    remove_controllers,
    rewrite_init,
)
from xosc_lateral.files.openscenario.write.moving import Moving, add_trajectories, moving_entities
from xosc_lateral.files.openscenario.write.versions import newer_than
from xosc_lateral.files.xml import parse_xml
from xosc_lateral.world.motion.nominal import NominalMotion, PlayedAction
from xosc_lateral.world.motion.trajectory import WorldTrajectory
from xosc_lateral.world.scenario.conditions import SimulationTimeCondition
from xosc_lateral.world.scenario.dependence import conditions_of
from xosc_lateral.world.scenario.global_actions import AddEntityAction
from xosc_lateral.world.scenario.private_actions import MOTION, ConnectTrailerAction
from xosc_lateral.world.scenario.scenario import Scenario

STORY = "xosc-lateral"
TRAILERS_SINCE = (1, 3)
"""Version from which a trailer follows whoever pulls it; in older ones it is an entity like others."""
STOP_TRIGGER = "stop trigger"
"""`NominalMotion.ended_by` of a run that the scenario itself ended."""


def replay(draft: Draft, trajectories: Mapping[str, WorldTrajectory]) -> tuple[str, ...]:
    """Put trajectories in place of all maneuvers: all else happens when it happened in the run; who follows one."""
    alone = draft.is_adapted and draft.version < TRAILERS_SINCE
    pulled = set() if alone else pulled_entities(draft.scenario, draft.motion)
    moving = moving_entities(draft, {name: path for name, path in trajectories.items() if name not in pulled})
    note_dropped(draft, draft.motion.actions)
    remove_controllers(draft, moving)
    for_carla = draft.player is Player.CARLA
    rewrite_init(draft, {name: start_of(item) if for_carla else item.start for name, item in moving.items()})
    index = _take_away(draft.storyboard)
    story = _new_story(draft, moving)
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


def _new_story(draft: Draft, moving: Mapping[str, Moving]) -> etree._Element:
    story = build.story(STORY)
    kept = [played for played in draft.motion.actions if _is_kept(played, draft.scenario, moving)]
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


def _is_kept(played: PlayedAction, scenario: Scenario, moving: Mapping[str, Moving]) -> bool:
    """Actions of init stay where they are."""
    is_motion = is_replaced(played.action, played.actor, moving)
    return not (played.path == ("Init",) or is_motion or dropped_reason(played.action, scenario))


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
            reasons[actor] = f"version {build.named(version)} has no {what}"
    if version < TRAILERS_SINCE:
        trailers = sorted(pulled_entities(scenario, motion) & set(entities))
        reasons |= dict.fromkeys(trailers, f"version {build.named(version)} has no Trailer")
    return reasons
