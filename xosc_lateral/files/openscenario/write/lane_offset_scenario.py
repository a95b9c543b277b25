"""Write a scenario that keeps its maneuvers and gets the offsets as lane offset actions on top.

For scenarios that have to stay reactive: triggers look at what happens, an ego under test may drive itself. Each entity
moves from the start, and anew after each of its lateral actions, whenever that ends. Its moves are a maneuver group
that runs again and again: each event begins once the one before is complete, the first one of the next turn once the
group is. An act holds one such ring, and is stopped by any lateral action of the entity.

Offsets are relative to where the car is: so they are to the left of travel on whatever road, and last as long as
planned from wherever an action has left it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from lxml import etree
from msgspec import Struct

from xosc_lateral.base.limits import REPEATED_RUNS
from xosc_lateral.base.track import Track
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.draft import Draft
from xosc_lateral.files.openscenario.write.literal import inline_maneuvers, name_literally
from xosc_lateral.files.openscenario.write.moving import moving_entities
from xosc_lateral.files.openscenario.write.replaced_maneuvers import ReplacedManeuvers
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.motion.offset_chain import REST_TIME, Move, OffsetChain, OffsetPath, Ring
from xosc_lateral.world.scenario.controllers import Domains, controlled_entities, gives_lateral
from xosc_lateral.world.scenario.enums import Priority
from xosc_lateral.world.scenario.global_actions import AddEntityAction
from xosc_lateral.world.scenario.private_actions import LATERAL, LONGITUDINAL, TeleportAction
from xosc_lateral.world.scenario.scenario import Scenario

CHAIN_NAME = "xosc-lateral offsets"
RING_TURNS = 10000
"""Turns of a ring: as good as for ever. [-]"""
LOOK_DELAY = 0.06
"""So long after an act has begun its conditions look at what is, not at what has been: a frame of up to 0.05 s. [s]"""
FIRST_WAIT = 0.12
"""The first move waits so long, two such frames: what is to stop it may begin with the act. [s]"""
MOVING_SPEED = 15.0
"""A car whose speed changes begins a move above it alone: braking with 4 m/s2, it is over before it is slow. [m/s]"""
SLOW_SHARE = 0.9
"""Of its least nominal speed, above which one begins that never is that fast, nor near to where moves end. [-]"""
HALTING_SPEED = 8.0
"""Below it, a move under way ends: a car that brakes harder does not slide sideways when it stands. [m/s]"""
SPARE_ACTS = 3
"""Acts more than runs in the nominal run, after an action that may run again. [-]"""


def add_lane_offsets(
    draft: Draft,
    chains: Sequence[OffsetChain],
    lateral: LateralActions,
    trajectories: Mapping[str, Track],
) -> tuple[str, ...]:
    """Add lane offset actions to maneuvers that stay as they are; who has them or follows a trajectory instead."""
    moving = moving_entities(draft, trajectories)
    maneuvers = ReplacedManeuvers(draft, moving)
    story = build.story("xosc-lateral")
    for chain in chains:
        _Acts(story, chain, draft, lateral).add()
    _place_aside(draft, chains)
    if len(story):
        # Last: a lane change that starts in the same frame has started before ours are looked at.
        draft.put_last(story)
    # Names of the elements that our conditions look at, with those above them where they are needed.
    references = (item.get("storyboardElementRef") or "" for item in story.iter("StoryboardElementStateCondition"))
    referred = {name for reference in references for name in reference.split("::")}
    name_literally(draft.root, draft.scenario.path, draft.scope, referred)
    inline_maneuvers(draft, referred)
    maneuvers.replace()
    return tuple(dict.fromkeys([*moving, *(chain.entity for chain in chains)]))


def _place_aside(draft: Draft, chains: Sequence[OffsetChain]) -> None:
    """Put those whose offsets begin with the scenario down there, after all else that places them."""
    placed = {chain.entity: chain.placed_t for chain in chains if chain.placed_t is not None}
    owners = draft.init_actions.findall("{*}Private")
    # The reader's order is the file's: names need no parameters filled in again.
    last = {
        private.entity_ref: owner
        for owner, private in zip(owners, draft.scenario.storyboard.init.privates, strict=True)
        if private.entity_ref in placed
    }
    for entity, owner in last.items():
        action = etree.Element("PrivateAction")
        aside = _lane_offset(action, {"dynamicsShape": "step"})
        build.sub(aside, "AbsoluteTargetLaneOffset", value=build.decimal(placed[entity], 4))
        build.insert_indented(owner, len(owner), action)


class _Acts:
    """The acts of one chain: one, or several after an action that may run again."""

    def __init__(self, story: etree._Element, chain: OffsetChain, draft: Draft, lateral: LateralActions) -> None:
        self._story, self._chain, self._version, self._notes = story, chain, draft.version, draft.notes
        self._items = lateral.by_entity.get(chain.entity, ())
        self._changes_speed = chain.entity in lateral.changing_speed
        self._moving_speed = _moving_speed(draft.motion, chain)
        self._runs = sum(one.path == chain.after and one.actor == chain.entity for one in draft.motion.actions)

    def add(self) -> None:
        """Add them to the story."""
        item = next((one for one in self._items if one.path == self._chain.after), None)
        before: str | None = None
        if self._runs > REPEATED_RUNS.value:
            what = f"{' / '.join(self._chain.after or ())}: {REPEATED_RUNS.refusal(self._runs)}"
            self._notes.append(f"'{self._chain.entity}' has no offsets after more of them; {what}")
        runs = min(self._runs, int(REPEATED_RUNS.value)) + SPARE_ACTS
        for _ in range(1 if item is None or not item.repeats else runs):
            act = build.sub(self._story, "Act", name=f"{CHAIN_NAME} {len(self._story) + 1}")
            name = str(act.get("name"))
            path = None if self._chain.path is None else self._add_path(act, name, self._chain.path)
            self._add_ring(act, name, path)
            if self._changes_speed:
                self._add_halt(act, name, path)
            if item is None:
                build.time_trigger(act, "StartTrigger", 0.0, self._version)
            else:
                trigger = build.sub(act, "StartTrigger")
                for transition in ("endTransition", "stopTransition"):
                    group = build.sub(trigger, "ConditionGroup")
                    build.state_condition(group, item.kind, item.reference, transition, 0.0)
                    if before is not None:
                        build.state_condition(group, "act", before, "completeState", 0.0)
            self._add_stop(act, name)
            before = name

    def _add_path(self, act: etree._Element, name: str, path: OffsetPath) -> etree._Element:
        """A trajectory without times, from where the entity is: its speed stays as written.

        The reference player finds the places of the vertices when it starts first: it may run once.
        """
        side, entity = self._chain.side, self._chain.entity
        group = build.maneuver_group(act, f"{name} path", entity)
        event = build.event(
            build.sub(group, "Maneuver", name=f"{name} path"), f"{name} path event", Priority.OVERRIDE, self._version
        )
        follow = build.sub(build.private_action(event, f"{name} path action"), "RoutingAction/FollowTrajectoryAction")
        holder = follow if self._version < (1, 1) else build.sub(follow, "TrajectoryRef")
        polyline = build.sub(build.sub(holder, "Trajectory", name=f"{name} path", closed="false"), "Shape/Polyline")
        middle_t = (self._chain.placed_t or 0.0) - side * path.offset[0]
        for number, (ahead, aside) in enumerate(zip(path.distance, path.offset, strict=True)):
            vertex = build.sub(polyline, "Vertex", time=build.decimal(0.1 * number, 1))
            ds, offset = build.decimal(side * ahead, 3), build.decimal(middle_t + side * aside, 4)
            build.sub(vertex, "Position/RelativeLanePosition", entityRef=entity, dLane="0", ds=ds, offset=offset)
        build.sub(follow, "TimeReference/None")
        build.sub(follow, "TrajectoryFollowingMode", followingMode="position")
        group = build.sub(event, "StartTrigger/ConditionGroup")
        build.state_condition(group, "act", name, "runningState", FIRST_WAIT)
        return event

    def _add_ring(self, act: etree._Element, name: str, path: etree._Element | None) -> None:
        """Moves that begin one after the other, over and over; before them a path, or a move that leads there."""
        ring, entity = self._chain.ring, self._chain.entity
        lead = path
        if self._chain.placed_t is None and ring.origin != 0.0:
            group = build.maneuver_group(act, f"{name} lead", entity)
            lead = self._event(build.sub(group, "Maneuver", name=f"{name} lead"), f"{name} lead event", leading(ring))
            self._begin(lead, "act", name, "runningState", FIRST_WAIT)
        group = build.maneuver_group(act, f"{name} ring", entity)
        group.set("maximumExecutionCount", str(RING_TURNS))
        maneuver = build.sub(group, "Maneuver", name=f"{name} ring")
        before = lead
        for number, move in enumerate(ring.moves, start=1):
            event = self._event(maneuver, f"{name}.{number}", move)
            if before is None:
                self._begin(event, "act", name, "runningState", FIRST_WAIT + move.wait)
            else:
                self._begin(event, "event", str(before.get("name")), "completeState", max(move.wait - REST_TIME, 0.0))
            before = event

    def _event(self, maneuver: etree._Element, name: str, move: Move) -> etree._Element:
        event = build.event(maneuver, name, Priority.OVERRIDE, self._version)
        dynamics = {"dynamicsShape": "sinusoidal", "maxLateralAcc": build.decimal(move.acceleration, 8)}
        self._add_offset(event, dynamics, move.change)
        return event

    def _add_offset(self, event: etree._Element, dynamics: Mapping[str, str], change: float) -> None:
        target = _lane_offset(build.private_action(event, f"{event.get('name')} action"), dynamics)
        value = build.decimal(change, 4)
        build.sub(target, "RelativeTargetLaneOffset", entityRef=self._chain.entity, value=value)

    def _begin(self, event: etree._Element, kind: str, reference: str, state: str, delay: float) -> None:
        group = build.sub(event, "StartTrigger/ConditionGroup")
        build.state_condition(group, kind, reference, state, delay)
        if self._changes_speed:
            _add_speed(group, self._chain.entity, self._moving_speed, "none")

    def _add_halt(self, act: etree._Element, name: str, path: etree._Element | None) -> None:
        """Sideways by nothing, at once: what ends a move under way; a path is no move."""
        group = build.maneuver_group(act, f"{name} halt", self._chain.entity)
        maneuver = build.sub(group, "Maneuver", name=f"{name} halt")
        event = build.event(maneuver, f"{name} halt event", Priority.OVERRIDE, self._version)
        event.set("maximumExecutionCount", str(RING_TURNS))
        self._add_offset(event, {"dynamicsShape": "step"}, 0.0)
        group = build.sub(event, "StartTrigger/ConditionGroup")
        if path is not None:
            build.state_condition(group, "event", str(path.get("name")), "completeState", 0.0)
        _add_speed(group, self._chain.entity, HALTING_SPEED, "falling")

    def _add_stop(self, act: etree._Element, name: str) -> None:
        """By any lateral action that runs; the second condition is true later than what was before its first look."""
        trigger = None
        for item in self._items:
            if (item.path == self._chain.after and not item.repeats) or item.adds:
                continue
            trigger = build.sub(act, "StopTrigger") if trigger is None else trigger
            group = build.sub(trigger, "ConditionGroup")
            # A controller is given its domain at once, and some players' assignments run for ever.
            state = "runningState" if item.steers is None else "startTransition"
            build.state_condition(group, item.kind, item.reference, state, 0.0)
            build.state_condition(group, "act", name, "runningState", LOOK_DELAY)


def _moving_speed(motion: NominalMotion, chain: OffsetChain) -> float:
    """Above which an entity whose speed may change begins a move: below `MOVING_SPEED` where it steadily is slower."""
    entity = next(entity for entity in motion.entities if entity.name == chain.entity)
    ends = [played.end for played in motion.actions if played.path == chain.after and played.end is not None]
    rows = entity.time >= (0.0 if chain.after is None else min(ends, default=np.inf))
    slowest = SLOW_SHARE * float(entity.speed[rows].min(initial=np.inf))
    return slowest if HALTING_SPEED < slowest < MOVING_SPEED else MOVING_SPEED


def leading(ring: Ring) -> Move:
    """From where the maneuvers leave the car to where a ring begins, as fast as its fastest move."""
    fastest = max(move.acceleration for move in ring.moves)
    duration = max(3.0, (0.5 * 3.1416**2 * abs(ring.origin) / fastest) ** 0.5)
    return Move(0.0, duration, ring.origin)


def _add_speed(group: etree._Element, entity: str, speed: float, edge: str) -> None:
    """The car is faster; `edge` "falling": it no longer is."""
    asked = build.entity_condition(group, f"speed {edge}", entity, edge=edge)
    build.sub(asked, "SpeedCondition", value=build.decimal(speed, 4), rule="greaterThan")


def _lane_offset(owner: etree._Element, dynamics: Mapping[str, str]) -> etree._Element:
    """A lane offset action; what comes back holds its target."""
    action = build.sub(owner, "LateralAction/LaneOffsetAction", continuous="false")
    build.sub(action, "LaneOffsetActionDynamics", **dynamics)
    return build.sub(action, "LaneOffsetTarget")


# ---- What moves entities sideways in a storyboard or puts them th ----
class LateralAction(Struct, frozen=True):
    """A lateral action, a teleport or the adding of an entity."""

    path: tuple[str, ...]  # its names from the story down
    kind: str  # type and name that a condition refers to it by
    reference: str
    repeats: bool = False  # it may run more than once
    adds: bool = False  # it adds the entity
    steers: bool | None = None  # it gives the lateral domain to a controller; False: it takes it back


class LateralActions(Struct, frozen=True):
    """Of a scenario's events, by entity, in file order; and who changes its speed or has a controller."""

    by_entity: Mapping[str, tuple[LateralAction, ...]]
    changing_speed: frozenset[str]

    @classmethod
    def of(cls, scenario: Scenario) -> LateralActions:
        """Those of a scenario."""
        names, controls = Counter(_names(scenario)), controlled_entities(scenario)
        by_entity: dict[str, dict[LateralAction, None]] = {}
        changing = set(controls)
        for at in scenario.storyboard.events():
            repeats = at.group.maximum_execution_count > 1 or at.event.maximum_execution_count > 1
            for action in at.event.actions:
                content, actors, steers = action.content, at.actors, gives_lateral(action.content)
                if isinstance(content, LONGITUDINAL):
                    changing |= set(actors)
                adds = isinstance(content, AddEntityAction)
                if isinstance(content, AddEntityAction):
                    actors = (content.entity_ref,)
                elif steers is not None:
                    actors = tuple(a for a in actors if a in controls and Domains.LATERAL in controls[a].domains)
                elif not isinstance(content, (*LATERAL, TeleportAction)):
                    continue
                path = (*at.path, action.name)
                reference = _reference(path, len(at.event.actions) == 1, names)
                lateral = LateralAction(path, *reference, repeats, adds, steers)
                for actor in actors:
                    by_entity.setdefault(actor, {})[lateral] = None
        return cls({entity: tuple(actions) for entity, actions in by_entity.items()}, frozenset(changing))


def _reference(path: tuple[str, ...], is_alone: bool, names: Mapping[str, int]) -> tuple[str, str]:
    """By its own name where no other element has it, else by its event's, else by the whole path.

    An action without a name, which the standard doesn't allow and some tools write, has only its event's.
    """
    if path[-1] and names[path[-1]] == 1:
        return "action", path[-1]
    if (is_alone or not path[-1]) and names[path[-2]] == 1:
        return "event", path[-2]
    return "action", "::".join(path)


def _names(scenario: Scenario) -> Iterator[str]:
    """Name of every element of the storyboard."""
    for story in scenario.storyboard.stories:
        yield from (story.name, *(act.name for act in story.acts))
    for _, _, group in scenario.storyboard.groups():
        yield from (group.name, *(maneuver.name for maneuver in group.maneuvers))
        for _, event in group.events():
            yield from (event.name, *(action.name for action in event.actions))
