"""Write a scenario that keeps its maneuvers and gets the offsets as lane offset actions on top.

For scenarios that have to stay reactive: triggers look at what happens, an ego under test may drive itself. Each
road-following segment gets an act of its own. It starts when the lateral action before it has ended (or at its
time), and is stopped by any lateral action of the same entity: a lane change overrules it, whenever it comes. Each of
its events begins when the one before has ended, and after the last the second comes again: the car goes on moving for
as long as the segment lasts, which is not for the nominal run to say where somebody drives along.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree

from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.provenance import mark, write_sealed
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.checks import check_convertible
from xosc_lateral.formats.openscenario.write.fit import fit
from xosc_lateral.formats.openscenario.write.lateral_actions import (
    LATERAL,
    LateralAction,
    LateralActions,
    lateral_actions,
)
from xosc_lateral.formats.openscenario.write.literal import inline_maneuvers, name_literally
from xosc_lateral.formats.openscenario.write.moving import Moving
from xosc_lateral.formats.openscenario.write.offset_chain import LEAST_CHANGE, SLACK, OffsetChain, ramps
from xosc_lateral.formats.openscenario.write.parameters import global_scope, override_parameters
from xosc_lateral.formats.openscenario.write.ramp_targets import Ramp, acceleration
from xosc_lateral.formats.openscenario.write.relative_paths import rewrite_paths
from xosc_lateral.formats.openscenario.write.replaced_maneuvers import ReplacedManeuvers, put_last
from xosc_lateral.formats.openscenario.write.result import WrittenScenario
from xosc_lateral.formats.openscenario.write.target import STANDARD, TargetPlayer
from xosc_lateral.formats.openscenario.write.vertices import Vertices
from xosc_lateral.formats.xml import parse_xml
from xosc_lateral.motion.nominal import NominalMotion, PlayedAction
from xosc_lateral.motion.trajectory import WorldTrajectory
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.enums import Priority

CHAIN = "xosc-lateral offsets"
AT_ONCE = 0.1
"""A segment that begins within this after a lateral action begins because of it. [s]"""
TURNS = 10000
"""Runs of a chain's events: as good as for ever. [-]"""
LEAST_RING = 2
"""Transitions at least of a chain that goes round. [-]"""
PAUSE = 0.5
"""Before a chain goes round: time for the maneuver that ends it in the nominal run. [s]"""
SLOWEST = 10.0
"""A car that gets slower keeps its place in the lane: a little below what counts as road-following. [m/s]"""
PLACED = 1e-3
"""What begins with the scenario begins only now: it would overrule an init action that has not been stepped yet. [s]"""


def write_lane_offset_scenario(
    scenario: Scenario,
    motion: NominalMotion,
    chains: Sequence[OffsetChain],
    output: Path | str,
    *,
    provenance: Mapping[str, Any],
    summary: str,
    save: bool = True,
    target: TargetPlayer = STANDARD,
    trajectories: Mapping[str, WorldTrajectory] | None = None,
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
    save : bool
        Write it; else the bytes are only handed back.
    target : TargetPlayer
        Player and version that it is made for.
    trajectories : mapping of str to WorldTrajectory, optional
        Entities that follow trajectories in place of their maneuvers: none that a chain is for.

    Raises
    ------
    FormatError
        The scenario was converted before, or can't be expressed for the target.
    OSError
        The output can't be written; nothing is left half-written.
    ValueError
        A chain holds NaN.
    """
    output = Path(output)
    root = parse_xml(scenario.source, scenario.path)
    check_convertible(root, scenario, motion)
    paths = trajectories or {}
    moving = {one.name: Moving(one, paths[one.name], motion) for one in motion.entities if one.name in paths}
    maneuvers = ReplacedManeuvers(root, scenario, motion, moving)
    version, vertices = target.version_for(scenario), Vertices(scenario.source)
    story = build.story("xosc-lateral")
    lateral = lateral_actions(scenario)
    for number, chain in enumerate(chains, start=1):
        if not np.isfinite(chain.offset_t).all():
            raise ValueError(f"offsets of '{chain.entity}' are not finite")
        later = [k for k, one in enumerate(chains, start=1) if k > number and one.entity == chain.entity and ramps(one)]
        following = f"{CHAIN} {later[0]}" if later else None
        _add_act(story, f"{CHAIN} {number}", chain, motion, lateral, version, following)
    _put_into(root, story, scenario, chains)
    scope, referred = global_scope(scenario), _referred(story)
    name_literally(root, scenario.path, scope, referred)
    inline_maneuvers(root, scenario, scope, referred)
    removed, frozen = maneuvers.replace(scope, version, vertices) if moving else ([], [])
    override_parameters(root, scenario)
    notes = (*frozen, *fit(root, scenario, motion, target, scope))
    rewrite_paths(root, scenario, output, scope)
    mark(root, provenance, summary)
    pieces = vertices.document(root) if moving else [build.document(root)]
    sha256, content, data = write_sealed(output, pieces, save=save)
    names = tuple(dict.fromkeys([*moving, *(chain.entity for chain in chains)]))
    return WrittenScenario(output, sha256, content, names, tuple(removed), data, notes)


def _put_into(root: etree._Element, story: etree._Element, scenario: Scenario, chains: Sequence[OffsetChain]) -> None:
    """Our story among the scenario's."""
    storyboard = next(element for element in root if local_name(element) == "Storyboard")
    _place_aside(storyboard, scenario, chains)
    if len(story):
        # Last: a lane change that starts in the same frame has started before ours are looked at.
        put_last(root, story)


def _place_aside(storyboard: etree._Element, scenario: Scenario, chains: Sequence[OffsetChain]) -> None:
    """Put those whose offsets begin with the scenario down there, after all else that places them."""
    placed = {
        chain.entity: found[0].origin if (found := ramps(chain)) else chain.start_t
        for chain in chains
        if chain.is_placed
    }
    owners = storyboard.findall("{*}Init/{*}Actions/{*}Private")
    # The reader's order is the file's: names need no parameters filled in again.
    last = {
        private.entity_ref: owner
        for owner, private in zip(owners, scenario.storyboard.init.privates, strict=True)
        if private.entity_ref in placed
    }
    for entity, owner in last.items():
        action = etree.Element("PrivateAction")
        _lane_offset(action, {"dynamicsShape": "step"}, placed[entity])
        build.insert_indented(owner, len(owner), action)


def _referred(story: etree._Element) -> set[str]:
    """Names of the elements that our conditions look at, with those above them where they are needed."""
    references = (item.get("storyboardElementRef") or "" for item in story.iter("StoryboardElementStateCondition"))
    return {name for reference in references for name in reference.split("::")}


def _add_act(
    story: etree._Element,
    name: str,
    chain: OffsetChain,
    motion: NominalMotion,
    lateral: LateralActions,
    version: build.Version,
    following: str | None,
) -> None:
    """The act of one chain; `following` is the act of the entity's next one, which takes over from it."""
    found = ramps(chain)
    if not found:
        return
    begin = float(chain.time[0])
    before = [played for played in motion.actions if _is_lateral(played, chain.entity) and played.start < begin]
    cause = _cause(before, begin)
    act = build.sub(story, "Act", name=name)
    maneuver = build.sub(build.maneuver_group(act, f"{name} group", chain.entity), "Maneuver", name=f"{name} maneuver")
    ring = len(found) - 1 if chain.goes_on and len(found) > LEAST_RING else 0
    for number, ramp in enumerate(found, start=1):
        event = build.event(maneuver, f"{name}.{number}", Priority.OVERRIDE, version)
        _add_ramp(event, f"{name}.{number} action", ramp)
        if number == 1 and cause is None:
            build.time_trigger(event, "StartTrigger", max(ramp.start, PLACED), version)
            continue
        trigger = build.sub(event, "StartTrigger")
        if number == 1:
            group = build.sub(trigger, "ConditionGroup")
            build.state_condition(group, "act", name, "runningState", ramp.start - begin)
            continue
        _add_link(trigger, f"{name}.{number - 1}", ramp.start - found[number - 2].end)
        if ring:
            event.set("maximumExecutionCount", str(TURNS))
            if number == 2:
                _add_link(trigger, f"{name}.{len(found)}", PAUSE)
    if cause is None:
        build.time_trigger(act, "StartTrigger", begin, version)
    else:
        _add_start_after(act, lateral.by_path[cause.path])
    _add_stop(act, lateral.by_entity.get(chain.entity, ()), {played.path for played in before})
    _add_end(act, chain.entity, following if ring else None)
    for trigger in [item for item in act if local_name(item) == "StartTrigger"]:
        for group in trigger:
            _add_speed(group, chain.entity, "none")


def _add_link(trigger: etree._Element, event: str, gap: float) -> None:
    """Begin when an event has ended; the player takes a frame or two of the gap."""
    group = build.sub(trigger, "ConditionGroup")
    build.state_condition(group, "event", event, "endTransition", max(gap - SLACK, 0.0))


def _add_end(act: etree._Element, entity: str, following: str | None) -> None:
    """A chain ends where the next one takes over, or when the car hardly drives any more."""
    trigger = next((item for item in act if local_name(item) == "StopTrigger"), None)
    trigger = build.sub(act, "StopTrigger") if trigger is None else trigger
    if following is not None:
        build.state_condition(build.sub(trigger, "ConditionGroup"), "act", following, "runningState", 0.0)
    _add_speed(build.sub(trigger, "ConditionGroup"), entity, "falling")


def _add_speed(group: etree._Element, entity: str, edge: str) -> None:
    """The car is faster than what it needs to move aside without turning much; `edge` "falling": it no longer is."""
    condition = build.sub(group, "Condition", name=f"speed {edge}", delay="0", conditionEdge=edge)
    by_entity = build.sub(condition, "ByEntityCondition")
    triggering = build.sub(by_entity, "TriggeringEntities", triggeringEntitiesRule="any")
    build.sub(triggering, "EntityRef", entityRef=entity)
    build.sub(build.sub(by_entity, "EntityCondition"), "SpeedCondition", value=str(SLOWEST), rule="greaterThan")


def _add_ramp(event: etree._Element, name: str, ramp: Ramp) -> None:
    """A ramp as an action.

    The reference player makes the duration from the change b and the acceleration A: pi sqrt(|b| / (2 A)).
    """
    change = max(abs(ramp.target - ramp.origin), LEAST_CHANGE)
    most = float(acceleration(change, ramp.end - ramp.start))
    dynamics = {"dynamicsShape": "sinusoidal", "maxLateralAcc": build.decimal(most, 6)}
    _lane_offset(build.private_action(event, name), dynamics, ramp.target)


def _lane_offset(owner: etree._Element, dynamics: Mapping[str, str], offset_t: float) -> None:
    """To an offset along +t. [m]"""
    action = build.sub(build.sub(owner, "LateralAction"), "LaneOffsetAction", continuous="false")
    build.sub(action, "LaneOffsetActionDynamics", **dynamics)
    target = build.sub(action, "LaneOffsetTarget")
    build.sub(target, "AbsoluteTargetLaneOffset", value=build.decimal(offset_t, 4))


def _add_start_after(act: etree._Element, cause: LateralAction) -> None:
    trigger = build.sub(act, "StartTrigger")
    # An event that may run again goes back to standby instead of being complete.
    for state in ("completeState", "endTransition"):
        group = build.sub(trigger, "ConditionGroup")
        build.state_condition(group, cause.kind, cause.reference, state, 0.0)


def _add_stop(act: etree._Element, overruling: Sequence[LateralAction], already: Collection[tuple[str, ...]]) -> None:
    """By a lateral action that has not run yet, or that begins again."""
    states = [(item, "startTransition" if item.path in already else "runningState") for item in overruling]
    states = [(item, state) for item, state in states if item.repeats or item.path not in already]
    if not states:
        return
    trigger = build.sub(act, "StopTrigger")
    for item, state in states:
        group = build.sub(trigger, "ConditionGroup")
        build.state_condition(group, item.kind, item.reference, state, 0.0)


def _is_lateral(played: PlayedAction, entity: str) -> bool:
    return played.actor == entity and isinstance(played.action.content, LATERAL) and played.path != ("Init",)


def _cause(before: Sequence[PlayedAction], begin: float) -> PlayedAction | None:
    """The lateral action whose end begins the segment."""
    ended = [played for played in before if played.end is not None and abs(begin - played.end) <= AT_ONCE]
    return ended[-1] if ended else None
