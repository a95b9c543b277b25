"""Write a played scenario with trajectories in place of its maneuvers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lxml import etree

from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.provenance import mark, write_sealed
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.carla import add_drives, start_of
from xosc_lateral.formats.openscenario.write.entities import remove_controllers, rewrite_init
from xosc_lateral.formats.openscenario.write.fit import fit
from xosc_lateral.formats.openscenario.write.moving import Moving, add_trajectories
from xosc_lateral.formats.openscenario.write.non_motion_actions import (
    CONTROLLER,
    add_non_motion_actions,
    dropped_reason,
    is_placing,
    is_replaced,
)
from xosc_lateral.formats.openscenario.write.result import (
    WrittenScenario,
    check_convertible,
    global_scope,
    override_parameters,
)
from xosc_lateral.formats.openscenario.write.target import STANDARD, Player, TargetPlayer
from xosc_lateral.formats.openscenario.write.vertices import Vertices, rewrite_paths
from xosc_lateral.formats.xml import parse_xml
from xosc_lateral.motion.nominal import NominalMotion, PlayedAction
from xosc_lateral.motion.trajectory import WorldTrajectory
from xosc_lateral.rows import blocks, columns
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.conditions import SimulationTimeCondition
from xosc_lateral.scenario.parameters import Scope
from xosc_lateral.scenario.place import Unsupported
from xosc_lateral.scenario.private_actions import ConnectTrailerAction

STORY = "xosc-lateral"
TRAILERS_SINCE = (1, 3)
"""Version from which a trailer follows whoever pulls it; in older ones it is an entity like others."""
STOP_TRIGGER = "stop trigger"
"""`NominalMotion.ended_by` of a run that the scenario itself ended."""


def write_trajectory_scenario(
    scenario: Scenario,
    motion: NominalMotion,
    trajectories: Mapping[str, WorldTrajectory],
    output: Path | str,
    *,
    provenance: Mapping[str, Any],
    summary: str,
    save: bool = True,
    target: TargetPlayer = STANDARD,
) -> WrittenScenario:
    """Write a scenario in which entities follow trajectories; all else happens when it happened in the run.

    Parameters
    ----------
    scenario : Scenario
        As read: its bytes are the starting point, so that comments, catalogs and vendor extensions survive.
    motion : NominalMotion
        The run: gives the times of kept actions, standstill, teleports, and the end.
    trajectories : mapping of str to WorldTrajectory
        Per entity, on the rows of `motion`. An entity that is absent keeps its actions, at the times of the run.
        Trailers follow whoever pulls them: theirs are ignored.
    output : path
    provenance : mapping
        JSON values: goes into the file as it is.
    summary : str
        A few words of it for the file header's description.
    save : bool
        Write it; else the bytes are only handed back.
    target : TargetPlayer
        Player and version that it is made for.

    Raises
    ------
    FormatError
        The scenario was converted before, or can't be expressed for the target.
    OSError
        The output can't be written; nothing is left half-written.
    ValueError
        A trajectory holds NaN or does not fit the motion.
    """
    output = Path(output)
    root = parse_xml(scenario.source, scenario.path)
    check_convertible(root, scenario, motion)
    scope = global_scope(scenario)
    version = target.version_for(scenario)
    alone = target.adapts(scenario) and version < TRAILERS_SINCE
    pulled = set() if alone else _trailers(scenario, motion)
    if scenario.header.is_left_handed:
        trajectories = {name: _mirrored(path) for name, path in trajectories.items()}
    moving = {
        entity.name: Moving(entity, trajectories[entity.name], motion)
        for entity in motion.entities
        if entity.name in trajectories and entity.name not in pulled
    }
    removed = _dropped(scenario, motion, moving)
    removed += remove_controllers(root, scenario, moving)
    starts = {name: item.start for name, item in moving.items()}
    if target.player is Player.CARLA:
        starts = {name: start_of(item) for name, item in moving.items()}
    rewrite_init(root, scenario, starts)
    vertices = Vertices(scenario.source)
    _replace_stories(root, scenario, motion, moving, scope, target, vertices)
    _replace_stop_trigger(root, scenario, motion, version)
    override_parameters(root, scenario)
    notes = fit(root, scenario, motion, target, scope, tuple(moving))
    rewrite_paths(root, scenario, output, scope)
    mark(root, provenance, summary)
    pieces = vertices.document(root)
    sha256, content, data = write_sealed(output, pieces, save=save)
    return WrittenScenario(output, sha256, content, tuple(moving), tuple(removed), data, notes)


def _trailers(scenario: Scenario, motion: NominalMotion) -> set[str]:
    """Entities that are pulled at some time: the player moves them itself."""
    coupled = {played.action.content.trailer_ref for played in motion.actions if _connects(played)}
    return {entity.trailer for entity in scenario.entities if entity.trailer is not None} | coupled


def _connects(played: PlayedAction) -> bool:
    return isinstance(played.action.content, ConnectTrailerAction)


def _replace_stories(
    root: etree._Element,
    scenario: Scenario,
    motion: NominalMotion,
    moving: Mapping[str, Moving],
    scope: Scope,
    target: TargetPlayer,
    vertices: Vertices,
) -> None:
    storyboard = _child(root, "Storyboard")
    index = _take_away(storyboard)
    story = _new_story(scenario, motion, moving, scope, target, vertices)
    if len(story):
        build.insert_indented(storyboard, index, story)


def _take_away(storyboard: etree._Element) -> int:
    """Stories; their comments stay. Where the next one belongs."""
    stories = [element for element in storyboard if local_name(element) == "Story"]
    index = storyboard.index(_child(storyboard, "Init")) + 1
    comments = [comment for old in stories for comment in old.iter(etree.Comment)]
    for old in stories:
        storyboard.remove(old)
    for comment in comments:
        kept = etree.Comment(comment.text)
        build.insert_indented(storyboard, index, kept)
        index += 1
    return index


def _new_story(
    scenario: Scenario,
    motion: NominalMotion,
    moving: Mapping[str, Moving],
    scope: Scope,
    target: TargetPlayer,
    vertices: Vertices,
) -> etree._Element:
    story = build.story(STORY)
    version = target.version_for(scenario)
    kept = [played for played in motion.actions if _is_non_motion(played, scenario, moving)]
    if kept:
        # Before the trajectories: an entity has to be there before it moves.
        _add_kept(story, kept, scenario, moving, scope, version)
    with_pieces = [item for item in moving.values() if item.pieces]
    # Up to 1.1 there has to be a story, even if nothing happens in it.
    if with_pieces or (not kept and version < (1, 2)):
        act = build.sub(story, "Act", name=f"{STORY} trajectories")
        for item in with_pieces:
            maneuver = build.maneuver(act, f"{STORY} {item.name}", item.name)
            if target.player is Player.CARLA:
                add_drives(maneuver, item, vertices, flat=not scenario.header.is_left_handed)
            else:
                add_trajectories(maneuver, item, version, vertices)
        if not with_pieces:
            build.maneuver_group(act, f"{STORY} nothing", None)
        build.time_trigger(act, "StartTrigger", 0.0, version)
    return story


def _add_kept(
    story: etree._Element,
    kept: Sequence[PlayedAction],
    scenario: Scenario,
    moving: Mapping[str, Moving],
    scope: Scope,
    version: tuple[int, int],
) -> None:
    """What is not motion, in an act of its own."""
    act = build.sub(story, "Act", name=f"{STORY} kept actions")
    poses = {
        index: moving[played.action.content.entity_ref].pose_after(played.start)
        for index, played in enumerate(kept)
        if is_placing(played.action) and played.action.content.entity_ref in moving
    }
    add_non_motion_actions(act, kept, poses, scenario, parse_xml(scenario.source, scenario.path), scope, version)
    build.time_trigger(act, "StartTrigger", 0.0, version)


def _is_non_motion(played: PlayedAction, scenario: Scenario, moving: Mapping[str, Moving]) -> bool:
    if played.path == ("Init",):
        return False  # stays where it is
    return not is_replaced(played.action, played.actor, moving) and dropped_reason(played.action, scenario) is None


def _replace_stop_trigger(
    root: etree._Element, scenario: Scenario, motion: NominalMotion, version: build.Version
) -> None:
    """The played end, unless the scenario ended itself by nothing but the time."""
    storyboard = _child(root, "Storyboard")
    old = next((element for element in storyboard if local_name(element) == "StopTrigger"), None)
    if old is not None and motion.ended_by == STOP_TRIGGER and _is_by_time_only(scenario):
        return
    if old is not None:
        storyboard.remove(old)
    holder = etree.Element("holder")
    trigger = build.time_trigger(holder, "StopTrigger", motion.end_time, version)
    build.insert_indented(storyboard, len(storyboard), trigger)


def _is_by_time_only(scenario: Scenario) -> bool:
    trigger = scenario.storyboard.stop_trigger
    return trigger is not None and all(
        isinstance(condition.content, SimulationTimeCondition)
        for group in trigger.groups
        for condition in group.conditions
    )


def _dropped(scenario: Scenario, motion: NominalMotion, moving: Mapping[str, Moving]) -> list[Unsupported]:
    """Actions that are neither motion nor kept, with reasons, each place once."""
    found: dict[Any, Unsupported] = {}
    for played in motion.actions:
        content = played.action.content
        reason = dropped_reason(played.action, scenario) if played.path != ("Init",) else None
        if isinstance(content, CONTROLLER) and played.actor in moving:
            reason = f"'{played.actor}' follows a trajectory"
        if reason is not None:
            found[played.action.place, played.actor] = Unsupported(type(content).__name__, played.action.place, reason)
    return list(found.values())


def _child(parent: etree._Element, tag: str) -> etree._Element:
    return next(element for element in parent if isinstance(element.tag, str) and local_name(element) == tag)


def _mirrored(path: WorldTrajectory) -> WorldTrajectory:
    """In the left-handed coordinates of a scenario written for CARLA."""
    n, turned = len(path.time), (path.y, path.heading, path.pitch)
    y, heading, pitch = columns(n, ([-values[rows] for values in turned] for rows in blocks(n)))
    return replace(path, y=y, heading=heading, pitch=pitch)
