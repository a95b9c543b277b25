"""Write a scenario that keeps its maneuvers and gets the offsets as lane offset actions on top.

For scenarios that have to stay reactive: triggers look at what happens, an ego under test may drive itself. Each
stretch of road-following gets an act of its own. It starts when the lateral action before it has ended (or at its
time), and is stopped by any lateral action of the same entity that has not run yet: a lane change overrules it,
whenever it comes. Times inside an act count from the act's start where a lateral action starts it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.provenance import mark, refuse_converted
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.parameters import global_scope, override_parameters
from xosc_lateral.formats.openscenario.write.relocate import relocate
from xosc_lateral.formats.openscenario.write.result import WrittenScenario
from xosc_lateral.formats.xml import parse_xml
from xosc_lateral.motion.nominal import EntityMotion, NominalMotion, PlayedAction
from xosc_lateral.road import RoadNetwork
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.actions import (
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
)
from xosc_lateral.scenario.enums import Priority

FloatArray = NDArray[np.float64]

LATERAL = (LaneChangeAction, LaneOffsetAction, LateralDistanceAction, FollowTrajectoryAction)

SETTLING_TIME = 2.0
"""From the nominal offset at a stretch's start to the sampled one: 0.3 m take 0.45 m/s2 at most. [s]"""
TOLERANCE = 0.01
"""How far straight ramps between two targets may be from the sampled offset. [m]"""
LEAST_STEP = 0.2
"""Time between two targets: the step of the sampled offsets. [s]"""
LEAST_CHANGE = 1e-3
"""A smaller change of the target is left to the next one. [m]"""
AT_ONCE = 0.1
"""A stretch that begins within this after a lateral action begins because of it. [s]"""


@dataclass(frozen=True, eq=False, slots=True)
class OffsetChain:
    """Offsets of one entity on one stretch of road-following.

    Parameters
    ----------
    entity : str
    time : array, shape (n,)
        Increasing. [s]
    offset_t : array, shape (n,)
        From the lane centre along +t, as ``AbsoluteTargetLaneOffset`` has it, the nominal offset included. [m]
    start_t : float
        Where the entity is when the chain begins, along +t: the first ramp leads from there. [m]
    """

    entity: str
    time: FloatArray
    offset_t: FloatArray
    start_t: float = 0.0


def offset_chain(
    motion: EntityMotion, network: RoadNetwork, deviation: FloatArray, first: int, last: int
) -> OffsetChain:
    """Chain for rows first..last (both included) of a motion with a deviation positive to the left of travel. [m]"""
    rows = slice(first, last + 1)
    along_lane = np.where(np.cos(motion.heading_relative[rows]) >= 0.0, 1.0, -1.0)
    offset = motion.offset[rows] + along_lane * deviation[rows]
    direction = network.travel_directions(motion.road[rows], motion.lane[rows])
    start_t = float(direction[0] * motion.offset[first])
    return OffsetChain(motion.name, motion.time[rows], direction * offset, start_t)


def write_lane_offset_scenario(
    scenario: Scenario,
    motion: NominalMotion,
    chains: Sequence[OffsetChain],
    output: Path | str,
    *,
    provenance: Mapping[str, Any],
    summary: str,
) -> WrittenScenario:
    """Write the scenario with its maneuvers as they are and lane offset actions added.

    Parameters
    ----------
    scenario : Scenario
        As read.
    motion : NominalMotion
        The run: says which lateral action comes before and after each chain.
    chains : sequence of OffsetChain
        In order of time for each entity.
    output : path
    provenance : mapping
        JSON values: goes into the file as it is.
    summary : str
        A few words of it for the file header's description.

    Raises
    ------
    FormatError
        The scenario was converted before.
    OSError
        The output can't be written; nothing is left half-written.
    ValueError
        A chain holds NaN.
    """
    output = Path(output)
    root = parse_xml(scenario.source, scenario.path)
    refuse_converted(root, scenario.path)
    version = scenario.header.version
    story = build.story("xosc-lateral")
    lateral = _lateral_actions(scenario)
    for number, chain in enumerate(chains, start=1):
        if not np.isfinite(chain.offset_t).all():
            raise ValueError(f"offsets of '{chain.entity}' are not finite")
        name = f"xosc-lateral offsets {number}"
        _add_act(story, name, chain, motion, lateral.get(chain.entity, ()), version)
    if len(story):
        storyboard = next(element for element in root if local_name(element) == "Storyboard")
        # Last: a lane change that starts in the same frame has started before ours are looked at.
        stop = next((element for element in storyboard if local_name(element) == "StopTrigger"), None)
        build.insert_indented(storyboard, len(storyboard) if stop is None else storyboard.index(stop), story)
    override_parameters(root, scenario)
    relocate(root, scenario, output, global_scope(scenario))
    mark(root, provenance, summary)
    data = build.document(root)
    write_atomically(output, data)
    names = tuple(dict.fromkeys(chain.entity for chain in chains))
    return WrittenScenario(output, hashlib.sha256(data).hexdigest(), names, ())


def targets(chain: OffsetChain) -> tuple[FloatArray, FloatArray]:
    """Times at which ramps end and the offsets there: the first after settling, then as few as the tolerance allows."""
    settled = np.flatnonzero(chain.time >= chain.time[0] + SETTLING_TIME)
    if len(settled) == 0:
        return np.empty(0), np.empty(0)
    time, offset = chain.time[settled], chain.offset_t[settled]
    kept = [0]
    while kept[-1] < len(time) - 1:
        kept.append(_farthest(time, offset, kept[-1]))
    return time[kept], offset[kept]


def _farthest(time: FloatArray, offset: FloatArray, start: int) -> int:
    """Last row that a straight ramp from `start` reaches within the tolerance; at least one step away.

    Cone of slopes that pass every row between within the tolerance: the ramp may end where its slope is inside.
    """
    ahead = time[start + 1 :] - time[start]
    change = offset[start + 1 :] - offset[start]
    lower = np.maximum.accumulate((change - TOLERANCE) / ahead)
    upper = np.minimum.accumulate((change + TOLERANCE) / ahead)
    slope = change / ahead
    inside = np.flatnonzero((slope >= lower) & (slope <= upper) & (lower <= upper))
    first_false = int(np.argmax(lower > upper)) if (lower > upper).any() else len(ahead)
    reachable = inside[inside < first_false]
    at_least = int(np.searchsorted(ahead, LEAST_STEP - 1e-9))
    farthest = max(int(reachable[-1]) if len(reachable) else 0, min(at_least, len(ahead) - 1))
    return start + 1 + farthest


@dataclass(frozen=True, slots=True)
class _Lateral:
    """A lateral action somewhere in the storyboard, by its names from the story down."""

    path: tuple[str, ...]

    @property
    def reference(self) -> str:
        return "::".join(self.path)


def _lateral_actions(scenario: Scenario) -> dict[str, tuple[_Lateral, ...]]:
    """Lateral actions of events, per entity, in file order."""
    found: dict[str, dict[_Lateral, None]] = {}
    for story in scenario.storyboard.stories:
        for act in story.acts:
            for group in act.maneuver_groups:
                for maneuver in group.maneuvers:
                    for event in maneuver.events:
                        for action in event.actions:
                            if isinstance(action.content, LATERAL):
                                path = (story.name, act.name, group.name, maneuver.name, event.name, action.name)
                                for actor in group.actors.entity_refs:
                                    found.setdefault(actor, {})[_Lateral(path)] = None
    return {entity: tuple(actions) for entity, actions in found.items()}


def _add_act(
    story: etree._Element,
    name: str,
    chain: OffsetChain,
    motion: NominalMotion,
    lateral: Iterable[_Lateral],
    version: build.Version,
) -> None:
    times, offsets = targets(chain)
    if len(times) == 0:
        return
    started = [played for played in motion.actions if played.actor == chain.entity and _is_lateral(played)]
    begin = float(chain.time[0])
    before = [played for played in started if played.start < begin]
    cause = _cause(before, begin)
    act = build.sub(story, "Act", name=name)
    maneuver = build.maneuver(act, name, chain.entity)
    ramp_start, last = begin, chain.start_t
    for number, (end, offset) in enumerate(zip(times.tolist(), offsets.tolist(), strict=True), start=1):
        if number > 1 and abs(offset - last) < LEAST_CHANGE and end < times[-1]:
            ramp_start = end
            continue
        event = build.event(maneuver, f"{name} {number}", Priority.OVERRIDE, version)
        _add_action(event, f"{name} {number}", offset, offset - last, end - ramp_start, settles=number == 1)
        if cause is None:
            build.time_trigger(event, "StartTrigger", ramp_start, version)
        else:
            group = build.sub(build.sub(event, "StartTrigger"), "ConditionGroup")
            build.state_condition(group, "act", name, "runningState", ramp_start - begin)
        ramp_start, last = end, offset
    _add_act_triggers(
        act, cause, begin, [item for item in lateral if item.path not in {b.path for b in before}], version
    )


def _add_action(
    event: etree._Element, name: str, offset: float, change: float, duration: float, *, settles: bool
) -> None:
    """A ramp to `offset` that takes `duration`.

    The reference player makes the duration from the change b and the acceleration A: sqrt(6 |b| / A), linear and cubic.
    """
    acceleration = 6.0 * max(abs(change), LEAST_CHANGE) / duration**2
    action = build.sub(
        build.sub(build.private_action(event, name), "LateralAction"), "LaneOffsetAction", continuous="false"
    )
    build.sub(
        action,
        "LaneOffsetActionDynamics",
        dynamicsShape="cubic" if settles else "linear",
        maxLateralAcc=build.decimal(acceleration, 6),
    )
    build.sub(build.sub(action, "LaneOffsetTarget"), "AbsoluteTargetLaneOffset", value=build.decimal(offset, 4))


def _add_act_triggers(
    act: etree._Element, cause: PlayedAction | None, begin: float, overruling: list[_Lateral], version: build.Version
) -> None:
    if cause is None:
        build.time_trigger(act, "StartTrigger", begin, version)
    else:
        trigger = build.sub(act, "StartTrigger")
        # An event that may run again goes back to standby instead of being complete.
        for state in ("completeState", "endTransition"):
            group = build.sub(trigger, "ConditionGroup")
            build.state_condition(group, "action", "::".join(cause.path), state, 0.0)
    if overruling:
        trigger = build.sub(act, "StopTrigger")
        for item in overruling:
            group = build.sub(trigger, "ConditionGroup")
            build.state_condition(group, "action", item.reference, "runningState", 0.0)


def _is_lateral(played: PlayedAction) -> bool:
    return isinstance(played.action.content, LATERAL) and played.path != ("Init",)


def _cause(before: list[PlayedAction], begin: float) -> PlayedAction | None:
    """The lateral action whose end begins the stretch."""
    ended = [played for played in before if played.end is not None and abs(begin - played.end) <= AT_ONCE]
    return ended[-1] if ended else None
