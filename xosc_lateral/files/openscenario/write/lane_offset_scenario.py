"""Write a scenario that keeps its maneuvers and gets the offsets as lane offset actions on top.

For scenarios that have to stay reactive: triggers look at what happens, an ego under test may drive itself. Each
road-following segment gets an act of its own. It starts when the lateral action before it has ended, when the car is no
longer too slow, or at its time, and is stopped by any lateral action of the same entity: a lane change overrules it,
whenever it comes. Each of its events begins when the one before has ended, and after the last one leads back to the
first one's target: the car goes on moving for as long as the segment lasts, which is not for the nominal run to say
where somebody drives along. Lateral actions that the nominal run does not come to, or once less, are followed by such
an act, too.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from itertools import product
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree
from msgspec.structs import replace

from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.files.openscenario.element import parent_of
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.draft import Draft, WrittenScenario
from xosc_lateral.files.openscenario.write.fit import finish
from xosc_lateral.files.openscenario.write.lateral_actions import LateralAction, awaited, lateral_actions
from xosc_lateral.files.openscenario.write.literal import inline_maneuvers, name_literally
from xosc_lateral.files.openscenario.write.moving import moving_entities
from xosc_lateral.files.openscenario.write.replaced_maneuvers import ReplacedManeuvers
from xosc_lateral.files.openscenario.write.target import STANDARD, TargetPlayer
from xosc_lateral.world.motion.nominal import NominalMotion, PlayedAction
from xosc_lateral.world.motion.offset_chain import LEAST_CHANGE, SLACK, OffsetChain, leading, ramps
from xosc_lateral.world.motion.ramp_targets import Ramp, acceleration
from xosc_lateral.world.motion.trajectory import WorldTrajectory
from xosc_lateral.world.scenario import Scenario
from xosc_lateral.world.scenario.dependence import Dependence
from xosc_lateral.world.scenario.enums import Priority

CHAIN = "xosc-lateral offsets"
AT_ONCE = 0.1
"""A segment that begins within this after a lateral action begins because of it. [s]"""
TURNS = 10000
"""Runs of a chain's events: as good as for ever. [-]"""
LEAST_RING = 2
"""Transitions at least of a chain that goes round: one leads nowhere from where it ended. [-]"""
PAUSE = 0.5
"""Before a chain goes round: time for the maneuver that ends it in the nominal run. [s]"""
SLOWEST = 10.0
"""A car that gets slower keeps its place in the lane: a little below what counts as road-following. [m/s]"""
FIRST = 0.05
"""After a lateral action its chain waits so long, a few frames: what overrules the action begins with its end. [s]"""
MOST_AGAIN = 4
"""Actions that run again and are waited for: conditions for each combination of their states. [-]"""
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
    depends: Dependence | None = None,
) -> WrittenScenario:
    """Write the scenario with its maneuvers as they are and lane offset actions added.

    `output`, `provenance`, `summary`, `save`, `target`, and what is raised: see `write_trajectory_scenario`.

    Parameters
    ----------
    scenario : Scenario
        As read.
    motion : NominalMotion
        The run: says which lateral action comes before and after each chain.
    chains : sequence of OffsetChain
        In order of time for each entity.
    trajectories : mapping of str to WorldTrajectory, optional
        Entities that follow trajectories in place of their maneuvers: none that a chain is for.
    depends : Dependence, optional
        What depends on vehicles under test.
    """
    draft = Draft(scenario, motion, target)
    moving = moving_entities(draft, trajectories or {})
    maneuvers = ReplacedManeuvers(draft, moving)
    story = build.story("xosc-lateral")
    lateral = lateral_actions(scenario)
    for chain in chains:
        if not np.isfinite(chain.offset_t).all():
            raise ValueError(f"offsets of '{chain.entity}' are not finite")
    for entity in dict.fromkeys(chain.entity for chain in chains):
        own = [chain for chain in chains if chain.entity == entity and ramps(chain)]
        _Acts(story, entity, draft, lateral.get(entity, ())).add(own, depends)
    _place_aside(draft, chains)
    if len(story):
        # Last: a lane change that starts in the same frame has started before ours are looked at.
        draft.put_last(story)
    referred = _referred(story)
    name_literally(draft.root, scenario.path, draft.scope, referred)
    inline_maneuvers(draft, referred)
    maneuvers.replace()
    names = tuple(dict.fromkeys([*moving, *(chain.entity for chain in chains)]))
    return finish(draft, Path(output), names, reactive=True, provenance=provenance, summary=summary, save=save)


def _place_aside(draft: Draft, chains: Sequence[OffsetChain]) -> None:
    """Put those whose offsets begin with the scenario down there, after all else that places them."""
    placed = {
        chain.entity: found[0].origin if (found := ramps(chain)) else chain.start_t
        for chain in chains
        if chain.is_placed
    }
    owners = draft.init_actions.findall("{*}Private")
    # The reader's order is the file's: names need no parameters filled in again.
    last = {
        private.entity_ref: owner
        for owner, private in zip(owners, draft.scenario.storyboard.init.privates, strict=True)
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


class _Acts:
    """The acts of one entity, and its lateral actions."""

    def __init__(self, story: etree._Element, entity: str, draft: Draft, items: Sequence[LateralAction]) -> None:
        self._story, self._entity, self._items, self._version = story, entity, items, draft.version
        self._by_path = {item.path: item for item in items}
        self._played = [one for one in draft.motion.actions if one.actor == entity and one.path in self._by_path]
        self._last = dict[tuple[str, ...] | None, str]()  # act after each lateral action, and the last one of all

    def add(self, chains: Sequence[OffsetChain], depends: Dependence | None) -> None:
        """One act for each chain, and one after each lateral action that the run does not come to."""
        for k, chain in enumerate(chains):
            begin, before = float(chain.time[0]), self._before(chain)
            cause = None if (found := _cause(before, begin)) is None else found.path
            is_clocked = self._is_clocked(chain)
            act, events = self._act(ramps(chain), begin, is_clocked=is_clocked)
            if is_clocked:
                group = build.time_trigger(act, "StartTrigger", begin, self._version)[0]
                _add_speed(group, self._entity, SLOWEST, "none")
            elif cause is not None:
                self._start_after(act, self._by_path[cause])
            else:
                self._start_when_faster(act, before)
            if _may_go_round(chain):
                self._go_round(events, chain)
            clocked = _may_go_round(chain) and k + 1 < len(chains) and self._is_clocked(chains[k + 1])
            following = f"{CHAIN} {len(self._story) + 1}" if clocked else None
            self._stop(act, {played.path for played in before}, following)
            self._last[cause] = self._last[None] = str(act.get("name"))
        rings = [chain for chain in chains if _may_go_round(chain)]
        for item in awaited(self._items, depends) if depends is not None and rings else ():
            if item.repeats or item.path not in self._last:
                self._add_after(item, max(rings, key=lambda one: (one.is_overruled, len(one.time))))

    def _add_after(self, item: LateralAction, chain: OffsetChain) -> None:
        """An act with the ring of a chain after a lateral action, from the middle of whatever lane that led to."""
        first, *others = ramps(chain)
        back = leading(0.0, first.target, chain)
        moved = back.end - first.end
        others = [replace(ramp, start=ramp.start + moved, end=ramp.end + moved) for ramp in others]
        act, events = self._act((back, *others), 0.0, is_clocked=False)
        self._start_after(act, item)
        self._go_round(events, chain)
        begin = next((played.start for played in self._played if played.path == item.path), inf)
        self._stop(act, {item.path, *(played.path for played in self._played if played.start < begin)}, None)

    def _before(self, chain: OffsetChain) -> list[PlayedAction]:
        return [played for played in self._played if played.start < chain.time[0]]

    def _is_clocked(self, chain: OffsetChain) -> bool:
        """It begins at its time, as nothing that can be waited for makes it."""
        return not chain.after_slow and _cause(self._before(chain), float(chain.time[0])) is None

    def _act(
        self, found: Sequence[Ramp], begin: float, *, is_clocked: bool
    ) -> tuple[etree._Element, list[etree._Element]]:
        """An act without triggers, and its events: each begins when the one before has ended."""
        name = f"{CHAIN} {len(self._story) + 1}"
        act = build.sub(self._story, "Act", name=name)
        group = build.maneuver_group(act, f"{name} group", self._entity)
        maneuver = build.sub(group, "Maneuver", name=f"{name} maneuver")
        events: list[etree._Element] = []
        for number, ramp in enumerate(found, start=1):
            event = build.event(maneuver, f"{name}.{number}", Priority.OVERRIDE, self._version)
            _add_ramp(event, f"{name}.{number} action", ramp)
            if number > 1:
                _add_link(build.sub(event, "StartTrigger"), events[-1], ramp.start - found[number - 2].end)
            elif is_clocked:
                build.time_trigger(event, "StartTrigger", max(ramp.start, PLACED), self._version)
            else:
                group = build.sub(event, "StartTrigger/ConditionGroup")
                build.state_condition(group, "act", name, "runningState", max(ramp.start - begin, FIRST))
            events.append(event)
        return act, events

    def _go_round(self, events: Sequence[etree._Element], chain: OffsetChain) -> None:
        """After the last event one leads back to where the first did, unless the car is about to be too slow."""
        first, second, last = ramps(chain)[0], ramps(chain)[1], ramps(chain)[-1]
        name = str(events[0].get("name")).rpartition(".")[0]
        back = build.event(parent_of(events[0]), f"{name}.{len(events) + 1}", Priority.OVERRIDE, self._version)
        _add_ramp(back, f"{name}.{len(events) + 1} action", leading(last.target, first.target, chain))
        group = _add_link(build.sub(back, "StartTrigger"), events[-1], PAUSE)
        _add_speed(group, self._entity, MINIMUM_SPEED, "none")
        _add_link(events[1].findall("StartTrigger")[0], back, second.start - first.end)
        for event in (*events[1:], back):
            event.set("maximumExecutionCount", str(TURNS))

    def _start_after(self, act: etree._Element, item: LateralAction) -> None:
        """When it ends, not when it is stopped midway: who is keeps his heading."""
        trigger = build.sub(act, "StartTrigger")
        again = [one for one in self._items if one.repeats and one != item][:MOST_AGAIN]
        # One that runs again may do so with the end: a condition with a delay is looked at all the time, and knows.
        for states in product(("standbyState", "completeState"), repeat=len(again)):
            group = build.sub(trigger, "ConditionGroup")
            state = "completeState" if item.at_once else "endTransition"
            build.state_condition(group, item.kind, item.reference, state, FIRST if again else 0.0)
            for one, state in zip(again, states, strict=True):
                build.state_condition(group, "event", "::".join(one.path[:-1]), state, SLACK / 3.0)
            if item.path in self._last:
                build.state_condition(group, "act", self._last[item.path], "completeState", 0.0)
            _add_speed(group, self._entity, SLOWEST, "none")

    def _start_when_faster(self, act: etree._Element, before: Sequence[PlayedAction]) -> None:
        """Again, if it was fast enough before."""
        group = build.sub(act, "StartTrigger/ConditionGroup")
        if None in self._last:
            build.state_condition(group, "act", self._last[None], "completeState", 0.0)
        elif before and not (item := self._by_path[before[-1].path]).repeats:
            build.state_condition(group, item.kind, item.reference, "completeState", 0.0)
        _add_speed(group, self._entity, MINIMUM_SPEED, "none")

    def _stop(self, act: etree._Element, ran: Collection[tuple[str, ...] | None], following: str | None) -> None:
        """By lateral actions, where the next chain takes over by the clock, or when the car hardly drives any more.

        A condition that is looked at for the first time sees all that was before. So a lateral action that has not run
        yet stops an act, too, that begins in the same frame; one that has run has to begin anew.
        """
        trigger = build.sub(act, "StopTrigger")
        for item in self._items:
            running = "completeState" if item.at_once else "runningState"  # over in the frame that it begins in
            state, edge = ("startTransition", "rising") if item.path in ran else (running, "none")
            if item.repeats or item.path not in ran:
                group = build.sub(trigger, "ConditionGroup")
                build.state_condition(group, item.kind, item.reference, state, 0.0, edge)
        if following is not None:
            build.state_condition(build.sub(trigger, "ConditionGroup"), "act", following, "runningState", 0.0)
        _add_speed(build.sub(trigger, "ConditionGroup"), self._entity, SLOWEST, "falling")


def _may_go_round(chain: OffsetChain) -> bool:
    """Its targets are on the side that +t is on all along, and lead somewhere."""
    return chain.goes_on and not chain.flips and len(ramps(chain)) >= LEAST_RING


def _add_link(trigger: etree._Element, event: etree._Element, gap: float) -> etree._Element:
    """Begin when an event has ended; the player takes a frame or two of the gap."""
    group = build.sub(trigger, "ConditionGroup")
    build.state_condition(group, "event", str(event.get("name")), "endTransition", max(gap - SLACK, 0.0))
    return group


def _add_speed(group: etree._Element, entity: str, speed: float, edge: str) -> None:
    """The car is faster; `edge` "falling": it no longer is."""
    asked = build.entity_condition(group, f"speed {edge}", entity, edge=edge)
    build.sub(asked, "SpeedCondition", value=build.decimal(speed, 4), rule="greaterThan")


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
    action = build.sub(owner, "LateralAction/LaneOffsetAction", continuous="false")
    build.sub(action, "LaneOffsetActionDynamics", **dynamics)
    build.sub(action, "LaneOffsetTarget/AbsoluteTargetLaneOffset", value=build.decimal(offset_t, 4))


def _cause(before: Sequence[PlayedAction], begin: float) -> PlayedAction | None:
    """The lateral action whose end begins the segment."""
    ended = [played for played in before if played.end is not None and abs(begin - played.end) <= AT_ONCE]
    return ended[-1] if ended else None
