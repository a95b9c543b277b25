"""Write a played scenario with trajectories in place of its maneuvers."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.provenance import mark
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.checks import check_convertible
from xosc_lateral.formats.openscenario.write.entities import remove_controllers, rewrite_init
from xosc_lateral.formats.openscenario.write.kept import (
    CONTROLLER,
    Pose,
    add_kept_actions,
    dropped_reason,
    is_placing,
    is_replaced,
)
from xosc_lateral.formats.openscenario.write.moves import Move, cut_moves, vertex_times
from xosc_lateral.formats.openscenario.write.parameters import global_scope, override_parameters
from xosc_lateral.formats.openscenario.write.relocate import relocate
from xosc_lateral.formats.openscenario.write.result import WrittenScenario
from xosc_lateral.formats.xml import parse_xml
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion, PlayedAction
from xosc_lateral.motion.trajectory import Trajectory
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.actions import ConnectTrailerAction
from xosc_lateral.scenario.conditions import SimulationTimeCondition
from xosc_lateral.scenario.enums import Priority
from xosc_lateral.scenario.parameters import Scope
from xosc_lateral.scenario.place import Unsupported

FloatArray = NDArray[np.float64]

STORY = "xosc-lateral"
STOP_TRIGGER = "stop trigger"
"""`NominalMotion.ended_by` of a run that the scenario itself ended."""


def write_trajectory_scenario(
    scenario: Scenario,
    motion: NominalMotion,
    trajectories: Mapping[str, Trajectory],
    output: Path | str,
    *,
    provenance: Mapping[str, Any],
    summary: str,
    save: bool = True,
) -> WrittenScenario:
    """Write a scenario in which entities follow trajectories; all else happens when it happened in the run.

    Parameters
    ----------
    scenario : Scenario
        As read: its bytes are the starting point, so that comments, catalogs and vendor extensions survive.
    motion : NominalMotion
        The run: gives the times of kept actions, standstill, teleports, and the end.
    trajectories : mapping of str to Trajectory
        Per entity, on the rows of `motion`. An entity that is absent keeps its actions, at the times of the run.
        Trailers follow whoever pulls them: theirs are ignored.
    output : path
    provenance : mapping
        JSON values: goes into the file as it is.
    summary : str
        A few words of it for the file header's description.
    save : bool
        Write it; else the bytes are only handed back.

    Raises
    ------
    FormatError
        The scenario was converted before.
    OSError
        The output can't be written; nothing is left half-written.
    ValueError
        A trajectory holds NaN or does not fit the motion.
    """
    output = Path(output)
    root = parse_xml(scenario.source, scenario.path)
    untouched = parse_xml(scenario.source, scenario.path)
    check_convertible(root, scenario, motion)
    scope = global_scope(scenario)
    pulled = _trailers(scenario, motion)
    if scenario.header.is_left_handed:
        trajectories = {name: _mirrored(path) for name, path in trajectories.items()}
    moving = {
        entity.name: _Moving(entity, trajectories[entity.name], motion)
        for entity in motion.entities
        if entity.name in trajectories and entity.name not in pulled
    }
    removed = _dropped(scenario, motion, moving)
    removed += remove_controllers(root, scenario, moving)
    starts = {name: item.start for name, item in moving.items()}
    rewrite_init(root, scenario, starts)
    _replace_stories(root, scenario, motion, moving, untouched, scope)
    _replace_stop_trigger(root, scenario, motion)
    override_parameters(root, scenario)
    relocate(root, scenario, output, scope)
    mark(root, provenance, summary)
    data = build.document(root)
    if save:
        write_atomically(output, data)
    return WrittenScenario(output, hashlib.sha256(data).hexdigest(), tuple(moving), tuple(removed), data)


class _Moving:
    """An entity with its path cut into moves."""

    def __init__(self, entity: EntityMotion, path: Trajectory, motion: NominalMotion) -> None:
        self.name, self.path, self.end = entity.name, path, motion.end_time
        active = (entity.activity & Activity.ACTIVE) != 0
        teleported = (entity.activity & Activity.TELEPORTED) != 0
        _check(entity, path, active)
        self.active_at_start = bool(active[0])
        self.moves = cut_moves(path.time, path.x, path.y, active, teleported)

    @property
    def start(self) -> tuple[Pose, float] | None:
        """Pose and speed at time 0; None for an entity that is not there yet. A car that stands does so by speed 0."""
        if not self.active_at_start:
            return None
        drives = bool(self.moves) and self.moves[0].first == 0
        return self.pose(0), float(self.path.speed[0]) if drives else 0.0

    def pose(self, row: int) -> Pose:
        """Pose in one row."""
        path = self.path
        arrays = (path.x, path.y, path.z, _wrapped(path.heading), path.pitch, path.roll)
        x, y, z, h, p, r = (float(values[row]) for values in arrays)
        return x, y, z, h, p, r

    def pose_after(self, moment: float) -> Pose:
        """Pose in the row that the step beginning at `moment` leads to."""
        row = int(np.searchsorted(self.path.time, moment + 1e-9, side="right"))
        return self.pose(min(row, len(self.path.time) - 1))

    def trigger_time(self, move: Move) -> float:
        """When a move has to begin: being placed anew happens in the step before its first row."""
        return float(self.path.time[move.first - 1 if move.placed else move.first])


def _check(entity: EntityMotion, path: Trajectory, active: NDArray[np.bool_]) -> None:
    arrays = (path.time, path.x, path.y, path.z, path.heading, path.pitch, path.roll)
    if any(len(values) != len(entity.time) for values in arrays):
        raise ValueError(f"trajectory of '{entity.name}' does not have the {len(entity.time)} rows of its motion")
    if any(not np.isfinite(values[active]).all() for values in arrays):
        raise ValueError(f"trajectory of '{entity.name}' is not finite")


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
    moving: Mapping[str, _Moving],
    untouched: etree._Element,
    scope: Scope,
) -> None:
    storyboard = _child(root, "Storyboard")
    stories = [element for element in storyboard if local_name(element) == "Story"]
    index = storyboard.index(_child(storyboard, "Init")) + 1
    comments = [comment for old in stories for comment in old.iter(etree.Comment)]
    for old in stories:
        storyboard.remove(old)
    for comment in comments:
        kept = etree.Comment(comment.text)
        build.insert_indented(storyboard, index, kept)
        index += 1
    story = _new_story(scenario, motion, moving, untouched, scope)
    if len(story):
        build.insert_indented(storyboard, index, story)


def _new_story(
    scenario: Scenario,
    motion: NominalMotion,
    moving: Mapping[str, _Moving],
    untouched: etree._Element,
    scope: Scope,
) -> etree._Element:
    story = build.story(STORY)
    version = scenario.header.version
    kept = [played for played in motion.actions if _is_kept(played, scenario, moving)]
    if kept:
        # Before the trajectories: an entity has to be there before it moves.
        act = build.sub(story, "Act", name=f"{STORY} kept actions")
        poses = {
            index: moving[played.action.content.entity_ref].pose_after(played.start)
            for index, played in enumerate(kept)
            if is_placing(played.action) and played.action.content.entity_ref in moving
        }
        add_kept_actions(act, kept, poses, scenario, untouched, scope)
        build.time_trigger(act, "StartTrigger", 0.0, version)
    with_moves = [item for item in moving.values() if item.moves]
    # Up to 1.1 there has to be a story, even if nothing happens in it.
    if with_moves or (not kept and version < (1, 2)):
        act = build.sub(story, "Act", name=f"{STORY} trajectories")
        for item in with_moves:
            _add_moves(build.maneuver(act, f"{STORY} {item.name}", item.name), item, version)
        if not with_moves:
            build.maneuver_group(act, f"{STORY} nothing", None)
        build.time_trigger(act, "StartTrigger", 0.0, version)
    return story


def _is_kept(played: PlayedAction, scenario: Scenario, moving: Mapping[str, _Moving]) -> bool:
    if played.path == ("Init",):
        return False  # stays where it is
    return not is_replaced(played.action, played.actor, moving) and dropped_reason(played.action, scenario) is None


def _add_moves(maneuver: etree._Element, item: _Moving, version: build.Version) -> None:
    for number, move in enumerate(item.moves, start=1):
        rows = slice(move.first, move.last + 1)
        times = vertex_times(item.path.time[rows], item.path.x[rows], item.path.y[rows])
        name = f"{item.name} trajectory {number}"
        event = build.event(maneuver, name, Priority.OVERRIDE, version)
        if len(times) < 2:
            _add_hop(event, name, item, move, version)
            continue
        if move.placed:
            place = build.private_action(event, f"{name} place")
            build.world_position(build.sub(place, "TeleportAction"), item.pose(move.first))
        _add_trajectory(build.private_action(event, name), name, item.path, rows, times, version)
        build.time_trigger(event, "StartTrigger", item.trigger_time(move), version)
        if move.stops:
            name = f"{item.name} stand {number}"
            stand = build.event(maneuver, name, Priority.OVERRIDE, version)
            build.speed_step(build.private_action(stand, name), 0.0)
            build.time_trigger(stand, "StartTrigger", float(item.path.time[move.last]), version)


def _add_hop(event: etree._Element, name: str, item: _Moving, move: Move, version: build.Version) -> None:
    """A move too short for two vertices: the entity is put where it ends."""
    place = build.private_action(event, f"{name} place")
    build.world_position(build.sub(place, "TeleportAction"), item.pose(move.last))
    speed = 0.0 if move.stops else float(item.path.speed[move.last])
    build.speed_step(build.private_action(event, f"{name} speed"), speed)
    start = item.trigger_time(move) if move.placed else float(item.path.time[move.last])
    build.time_trigger(event, "StartTrigger", start, version)


def _add_trajectory(
    owner: etree._Element, name: str, path: Trajectory, rows: slice, times: FloatArray, version: build.Version
) -> None:
    follow = build.sub(build.sub(owner, "RoutingAction"), "FollowTrajectoryAction")
    holder = follow if version < (1, 1) else build.sub(follow, "TrajectoryRef")
    trajectory = build.sub(holder, "Trajectory", name=name, closed="false")
    polyline = build.sub(build.sub(trajectory, "Shape"), "Polyline")
    time = path.time[rows]
    arrays = (path.x, path.y, path.z, np.unwrap(path.heading[rows]), path.pitch, path.roll)
    columns = [np.interp(times, time, values if len(values) == len(time) else values[rows]) for values in arrays]
    columns[3] = _wrapped(columns[3])
    for moment, *pose in zip(times.tolist(), *(column.tolist() for column in columns), strict=True):
        vertex = build.sub(polyline, "Vertex", time=build.decimal(moment, 6))
        x, y, z, h, p, r = pose
        build.world_position(vertex, (x, y, z, h, p, r))
    timing = build.sub(follow, "TimeReference")
    build.sub(timing, "Timing", domainAbsoluteRelative="absolute", scale="1", offset="0")
    build.sub(follow, "TrajectoryFollowingMode", followingMode="position")


def _replace_stop_trigger(root: etree._Element, scenario: Scenario, motion: NominalMotion) -> None:
    """The played end, unless the scenario ended itself by nothing but the time."""
    storyboard = _child(root, "Storyboard")
    old = next((element for element in storyboard if local_name(element) == "StopTrigger"), None)
    if old is not None and motion.ended_by == STOP_TRIGGER and _is_by_time_only(scenario):
        return
    if old is not None:
        storyboard.remove(old)
    holder = etree.Element("holder")
    trigger = build.time_trigger(holder, "StopTrigger", motion.end_time, scenario.header.version)
    build.insert_indented(storyboard, len(storyboard), trigger)


def _is_by_time_only(scenario: Scenario) -> bool:
    trigger = scenario.storyboard.stop_trigger
    return trigger is not None and all(
        isinstance(condition.content, SimulationTimeCondition)
        for group in trigger.groups
        for condition in group.conditions
    )


def _dropped(scenario: Scenario, motion: NominalMotion, moving: Mapping[str, _Moving]) -> list[Unsupported]:
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


def _mirrored(path: Trajectory) -> Trajectory:
    """In the left-handed coordinates of a scenario written for CARLA."""
    return replace(path, y=-path.y, heading=-path.heading, pitch=-path.pitch)


def _wrapped(angle: FloatArray) -> FloatArray:
    """Into (-pi, pi]."""
    return np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
