"""Trajectories in place of some vehicles' maneuvers, in a storyboard that stays as it is for all others.

A maneuver group all of whose actors follow trajectories goes; what happened in it and is no motion happens when it did
in the run. From a group with other actors, too, those that follow trajectories are taken out. Nothing else is touched,
but for conditions on the state of what is gone: they get the time at which the run fulfilled them, and are named.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

from lxml import etree
from msgspec import Struct

from xosc_lateral.base.errors import locate
from xosc_lateral.base.note import warnings
from xosc_lateral.files.openscenario.element import at_node, child_of
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.draft import Draft
from xosc_lateral.files.openscenario.write.moving import Moving, add_trajectories
from xosc_lateral.files.openscenario.write.replay import (
    add_kept_actions,
    kept_actions,
    remove_controllers,
    rewrite_init,
)
from xosc_lateral.world.motion.nominal import PlayedAction
from xosc_lateral.world.scenario.conditions import StoryboardElementStateCondition
from xosc_lateral.world.scenario.dependence import refers_to
from xosc_lateral.world.scenario.enums import StoryboardElementState
from xosc_lateral.world.scenario.global_actions import AddEntityAction, DeleteEntityAction
from xosc_lateral.world.scenario.private_actions import ConnectTrailerAction
from xosc_lateral.world.scenario.scenario import Act, Condition, ManeuverGroup, Scenario, conditions_of

STORY = "xosc-lateral trajectories"
UNREACHED_TIME = 1e9
"""Simulation time in place of a state that the run did not reach. [s]"""

_START_STATES = (StoryboardElementState.START_TRANSITION, StoryboardElementState.RUNNING)
_END_STATES = (StoryboardElementState.END_TRANSITION, StoryboardElementState.COMPLETE)

Path = tuple[str, ...]


class Group(Struct, frozen=True):
    """A maneuver group with its names from the story down, and the act around it."""

    path: Path
    act: Act
    group: ManeuverGroup

    @property
    def actors(self) -> frozenset[str]:
        """Named in the file."""
        return frozenset(self.group.actors.entity_refs)

    def conditions(self) -> Iterator[Condition]:
        """By which its events start."""
        for _, event in self.group.events():
            yield from conditions_of(event.start_trigger)

    def element_of(self, content: StoryboardElementStateCondition) -> Path | None:
        """What a condition is about, if that is in the group or around it."""
        paths = [self.path[:1], self.path[:2], self.path]
        paths += [(*self.path, maneuver.name) for maneuver in self.group.maneuvers]
        for maneuver, event in self.group.events():
            path = (*self.path, maneuver.name, event.name)
            paths += [path, *((*path, action.name) for action in event.actions)]
        return next((path for path in paths if refers_to(content, path)), None)


def groups_of(scenario: Scenario) -> list[Group]:
    """All maneuver groups, in file order."""
    groups = scenario.storyboard.groups()
    return [Group((story.name, act.name, group.name), act, group) for story, act, group in groups]


def replaced_groups(scenario: Scenario, entities: Collection[str]) -> list[Group]:
    """Groups in which nobody acts but these."""
    return [one for one in groups_of(scenario) if _is_theirs(one, entities)]


def _is_theirs(member: Group, entities: Collection[str]) -> bool:
    alone = bool(member.actors) and member.actors <= set(entities)
    return alone and not member.group.actors.select_triggering_entities


def separable(scenario: Scenario, wanted: Collection[str]) -> frozenset[str]:
    """Those of the wanted entities whose maneuvers can go without a trace for anybody else.

    Not those that share a group with others, that act because they trigger, that come, go, or pull a trailer, nor those
    whose maneuvers a condition that stays looks at.
    """
    replaceable = set(wanted) - _coupled(scenario)
    while True:
        before = set(replaceable)
        for group in groups_of(scenario):
            if group.actors & replaceable and not _is_theirs(group, replaceable):
                replaceable -= group.actors
        gone = replaced_groups(scenario, replaceable)
        for condition in _kept_conditions(scenario, gone):
            for group in gone:
                if group.element_of(condition) is not None:
                    replaceable -= group.actors
        if replaceable == before:
            return frozenset(replaceable)


def _coupled(scenario: Scenario) -> set[str]:
    names = {name for entity in scenario.entities if entity.trailer for name in (entity.name, entity.trailer)}
    for at in scenario.storyboard.events():
        if at.group.actors.select_triggering_entities:
            names |= set(at.actors)
        for content in (action.content for action in at.event.actions):
            if isinstance(content, AddEntityAction | DeleteEntityAction):
                names.add(content.entity_ref)
            elif isinstance(content, ConnectTrailerAction):
                names |= {content.trailer_ref, *at.group.actors.entity_refs}
    return names


def _kept_conditions(scenario: Scenario, gone: Collection[Group]) -> list[StoryboardElementStateCondition]:
    """Conditions on states of storyboard elements that are still there without some groups."""
    paths = {one.path for one in gone}
    kept = [one for one in groups_of(scenario) if one.path not in paths]
    triggers = list(conditions_of(scenario.storyboard.stop_trigger))
    for act in dict.fromkeys(one.path[:2] for one in kept):
        of_act = next(one.act for one in kept if one.path[:2] == act)
        triggers += [*conditions_of(of_act.start_trigger), *conditions_of(of_act.stop_trigger)]
    triggers += [condition for one in kept for condition in one.conditions()]
    return [c.content for c in triggers if isinstance(c.content, StoryboardElementStateCondition)]


class ReplacedManeuvers:
    """What is to be taken out of a draft, found before anything in it is changed: `moving` follow trajectories."""

    def __init__(self, draft: Draft, moving: Mapping[str, Moving]) -> None:
        self._draft, self._moving = draft, moving
        gone = replaced_groups(draft.scenario, moving)
        self._gone = {one.path for one in gone}
        self._groups = [at_node(draft.root, one.group.place.node) for one in gone]
        self._shared = [
            (
                at_node(draft.root, one.group.actors.place.node),
                [name for name in one.group.actors.entity_refs if name not in moving],
            )
            for one in groups_of(draft.scenario)
            if one.path not in self._gone and one.actors & set(moving)
        ]
        self._frozen = [
            (content, self._element(content), path)
            for content in _kept_conditions(draft.scenario, gone)
            for one in gone
            if (path := one.element_of(content)) is not None
        ]

    def _element(self, content: StoryboardElementStateCondition) -> etree._Element:
        if content.place.path != str(self._draft.scenario.path):
            raise content.place.error(
                f"waits for '{content.element_ref}', which a trajectory stands for: take --mode auto or lane-offset"
            )
        return at_node(self._draft.root, content.place.node)

    def replace(self) -> None:
        """Take maneuvers, controllers and starts out and put trajectories in."""
        if not self._moving:
            return
        remove_controllers(self._draft, self._moving)
        actions = self._draft.motion.actions
        theirs = (one for one in actions if one.path[:3] in self._gone or one.actor in self._moving)
        kept = kept_actions(self._draft, theirs, self._moving)
        self._draft.notes += warnings(dict.fromkeys(filter(None, map(self._freeze, self._frozen))))
        rewrite_init(self._draft, {name: item.start for name, item in self._moving.items()})
        self._take_out()
        self._put_in(kept)

    def _freeze(self, frozen: tuple[StoryboardElementStateCondition, etree._Element, Path]) -> str:
        content, element, path = frozen
        owner = element.getparent()
        if owner is None:
            return ""  # done, for another group
        moment = self._reached(content, path)
        owner.remove(element)
        build.sub(owner, "SimulationTimeCondition", value=build.decimal(moment, 6), rule="greaterThan")
        when = "never" if moment >= UNREACHED_TIME else f"at {moment:.2f} s"
        what = f"waited for '{content.element_ref}', which a trajectory stands for: now {when}, as in the nominal run"
        return locate(what, path=content.place.path, line=content.place.line, element=content.place.element)

    def _reached(self, content: StoryboardElementStateCondition, path: Path) -> float:
        played = [item for item in self._draft.motion.actions if item.path[: len(path)] == path]
        if content.state in _START_STATES:
            return min((item.start for item in played), default=UNREACHED_TIME)
        ends = [UNREACHED_TIME if item.end is None else item.end for item in played if content.state in _END_STATES]
        return max(ends, default=UNREACHED_TIME)

    def _take_out(self) -> None:
        for actors, names in self._shared:
            actors[:] = []
            for name in names:
                build.sub(actors, "EntityRef", entityRef=name)
        for group in self._groups:
            _remove(group, ("ManeuverGroup", "Act"))

    def _put_in(self, kept: Sequence[PlayedAction]) -> None:
        story = build.story(STORY)
        add_kept_actions(story, f"{STORY} kept actions", self._draft, kept, {})
        items = [item for item in self._moving.values() if item.pieces]
        if items:
            act = build.sub(story, "Act", name=f"{STORY} act")
            for item in items:
                add_trajectories(act, f"{STORY} {item.name}", item, self._draft)
            build.time_trigger(act, "StartTrigger", 0.0, self._draft.version)
        if len(story):
            self._draft.put_last(story)


def _remove(element: etree._Element, kinds: tuple[str, ...]) -> None:
    """Take an element out, and the act and the story around it where nothing else is in them."""
    owner = element.getparent()
    if owner is None:
        return
    owner.remove(element)
    if kinds and child_of(owner, kinds[0]) is None:
        _remove(owner, kinds[1:])
