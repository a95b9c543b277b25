"""Trajectories in place of some vehicles' maneuvers, in a storyboard that stays as it is for all others.

A maneuver group all of whose actors follow trajectories goes; what happened in it and is no motion happens when it did
in the run. From a group with other actors, too, those that follow trajectories are taken out. Nothing else is touched,
but for conditions on the state of what is gone: they get the time at which the run fulfilled them, and are named.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from lxml import etree
from msgspec import Struct

from xosc_lateral.errors import FormatError, locate
from xosc_lateral.formats.openscenario.element import at_node, local_name
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.entities import remove_controllers, rewrite_init
from xosc_lateral.formats.openscenario.write.moving import Moving, add_trajectories
from xosc_lateral.formats.openscenario.write.non_motion_actions import (
    CONTROLLER,
    add_non_motion_actions,
    dropped_reason,
    is_replaced,
)
from xosc_lateral.formats.openscenario.write.vertices import Vertices
from xosc_lateral.formats.xml import parse_xml
from xosc_lateral.motion.nominal import NominalMotion, PlayedAction
from xosc_lateral.scenario import Act, ManeuverGroup, Scenario
from xosc_lateral.scenario.conditions import StoryboardElementStateCondition
from xosc_lateral.scenario.dependence import actors_of, conditions_of, refers_to
from xosc_lateral.scenario.enums import StoryboardElementState
from xosc_lateral.scenario.global_actions import AddEntityAction, DeleteEntityAction
from xosc_lateral.scenario.parameters import Scope
from xosc_lateral.scenario.place import Unsupported
from xosc_lateral.scenario.private_actions import ConnectTrailerAction
from xosc_lateral.scenario.storyboard import Condition

STORY = "xosc-lateral trajectories"
NEVER = 1e9
"""Simulation time in place of a state that the run did not reach. [s]"""

_STARTS = (StoryboardElementState.START_TRANSITION, StoryboardElementState.RUNNING)
_ENDS = (StoryboardElementState.END_TRANSITION, StoryboardElementState.COMPLETE)

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
        for maneuver in self.group.maneuvers:
            for event in maneuver.events:
                yield from conditions_of(event.start_trigger)

    def elements(self) -> Iterator[Path]:
        """The story, the act and the group, and all that is in the group."""
        yield from (self.path[:1], self.path[:2], self.path)
        for maneuver in self.group.maneuvers:
            yield (*self.path, maneuver.name)
            for event in maneuver.events:
                yield (*self.path, maneuver.name, event.name)
                yield from ((*self.path, maneuver.name, event.name, action.name) for action in event.actions)


def groups_of(scenario: Scenario) -> list[Group]:
    """All maneuver groups, in file order."""
    return [
        Group((story.name, act.name, group.name), act, group)
        for story in scenario.storyboard.stories
        for act in story.acts
        for group in act.maneuver_groups
    ]


def replaced_groups(scenario: Scenario, entities: Collection[str]) -> list[Group]:
    """Groups in which nobody acts but these."""
    return [one for one in groups_of(scenario) if _is_theirs(one, entities)]


def _is_theirs(one: Group, entities: Collection[str]) -> bool:
    alone = bool(one.actors) and one.actors <= set(entities)
    return alone and not one.group.actors.select_triggering_entities


def separable(scenario: Scenario, wanted: Collection[str]) -> frozenset[str]:
    """Those of the wanted entities whose maneuvers can go without a trace for anybody else.

    Not those that share a group with others, that act because they trigger, that come, go, or pull a trailer, nor those
    whose maneuvers a condition that stays looks at.
    """
    found = set(wanted) - _coupled(scenario)
    while True:
        before = set(found)
        for one in groups_of(scenario):
            if one.actors & found and not _is_theirs(one, found):
                found -= one.actors
        gone = replaced_groups(scenario, found)
        for condition in _kept_conditions(scenario, gone):
            for one in gone:
                if any(refers_to(condition, path) for path in one.elements()):
                    found -= one.actors
        if found == before:
            return frozenset(found)


def _coupled(scenario: Scenario) -> set[str]:
    found = {name for entity in scenario.entities if entity.trailer for name in (entity.name, entity.trailer)}
    for one in groups_of(scenario):
        for maneuver in one.group.maneuvers:
            for event in maneuver.events:
                if one.group.actors.select_triggering_entities:
                    found |= set(actors_of(one.act, one.group, event))
                for action in event.actions:
                    if isinstance(action.content, AddEntityAction | DeleteEntityAction):
                        found.add(action.content.entity_ref)
                    elif isinstance(action.content, ConnectTrailerAction):
                        found |= {action.content.trailer_ref, *one.actors}
    return found


def _kept_conditions(scenario: Scenario, gone: Collection[Group]) -> list[StoryboardElementStateCondition]:
    """Conditions on states of storyboard elements that are still there without some groups."""
    paths = {one.path for one in gone}
    kept = [one for one in groups_of(scenario) if one.path not in paths]
    found = list(conditions_of(scenario.storyboard.stop_trigger))
    for act in dict.fromkeys(one.path[:2] for one in kept):
        of_act = next(one.act for one in kept if one.path[:2] == act)
        found += [*conditions_of(of_act.start_trigger), *conditions_of(of_act.stop_trigger)]
    found += [condition for one in kept for condition in one.conditions()]
    return [c.content for c in found if isinstance(c.content, StoryboardElementStateCondition)]


class ReplacedManeuvers:
    """What is to be taken out of a scenario's tree: found before anything in it is changed.

    Parameters
    ----------
    root : element
        A parse of the scenario's bytes.
    scenario : Scenario
    motion : NominalMotion
    moving : mapping of str to Moving
        Entities that follow trajectories.
    """

    def __init__(
        self, root: etree._Element, scenario: Scenario, motion: NominalMotion, moving: Mapping[str, Moving]
    ) -> None:
        self._root, self._scenario, self._motion, self._moving = root, scenario, motion, moving
        self._gone = replaced_groups(scenario, moving)
        gone = {one.path for one in self._gone}
        self._groups = [at_node(root, one.group.place.node) for one in self._gone]
        self._shared = [
            (
                at_node(root, one.group.actors.place.node),
                [name for name in one.group.actors.entity_refs if name not in moving],
            )
            for one in groups_of(scenario)
            if one.path not in gone and one.actors & set(moving)
        ]
        self._frozen = [
            (content, self._element(content), one)
            for content in _kept_conditions(scenario, self._gone)
            for one in self._gone
            if any(refers_to(content, path) for path in one.elements())
        ]

    def _element(self, content: StoryboardElementStateCondition) -> etree._Element:
        place = content.place
        if place.path != str(self._scenario.path):
            raise FormatError(
                f"waits for '{content.element_ref}', which a trajectory stands for: take --mode auto or lane-offset",
                path=place.path,
                line=place.line,
                element=place.element,
            )
        return at_node(self._root, place.node)

    def replace(self, scope: Scope, version: build.Version, vertices: Vertices) -> tuple[list[Unsupported], list[str]]:
        """Take maneuvers, controllers and starts out and put trajectories in; what was removed, and notes."""
        removed = remove_controllers(self._root, self._scenario, self._moving)
        removed += self._dropped()
        notes = [note for note in map(self._freeze, self._frozen) if note]
        rewrite_init(self._root, self._scenario, {name: item.start for name, item in self._moving.items()})
        self._take_out()
        self._put_in(scope, version, vertices)
        return removed, list(dict.fromkeys(notes))

    def _freeze(self, frozen: tuple[StoryboardElementStateCondition, etree._Element, Group]) -> str:
        content, element, one = frozen
        owner = element.getparent()
        if owner is None:
            return ""  # done, for another group
        moment = self._reached(content, one)
        owner.remove(element)
        build.sub(owner, "SimulationTimeCondition", value=build.decimal(moment, 6), rule="greaterThan")
        when = "never" if moment >= NEVER else f"at {moment:.2f} s"
        what = f"waited for '{content.element_ref}', which a trajectory stands for: now {when}, as in the nominal run"
        return locate(what, path=content.place.path, line=content.place.line, element=content.place.element)

    def _reached(self, content: StoryboardElementStateCondition, one: Group) -> float:
        path = next(path for path in one.elements() if refers_to(content, path))
        played = [item for item in self._motion.actions if item.path[: len(path)] == path]
        if content.state in _STARTS:
            return min((item.start for item in played), default=NEVER)
        if content.state in _ENDS:
            ends = [NEVER if item.end is None else item.end for item in played]
            return max(ends, default=NEVER)
        return NEVER

    def _dropped(self) -> list[Unsupported]:
        found: dict[object, Unsupported] = {}
        for played in self._motion.actions:
            content = played.action.content
            if isinstance(content, CONTROLLER) and played.actor in self._moving:
                reason = f"'{played.actor}' follows a trajectory"
                found[played.action.place] = Unsupported(type(content).__name__, played.action.place, reason)
        return list(found.values())

    def _take_out(self) -> None:
        for actors, names in self._shared:
            actors[:] = []
            for name in names:
                build.sub(actors, "EntityRef", entityRef=name)
        for group in self._groups:
            _remove(group, ("ManeuverGroup", "Act"))

    def _put_in(self, scope: Scope, version: build.Version, vertices: Vertices) -> None:
        story = build.story(STORY)
        gone = {one.path for one in self._gone}
        kept = [played for played in self._motion.actions if self._is_kept(played, gone)]
        if kept:
            act = build.sub(story, "Act", name=f"{STORY} kept actions")
            untouched = parse_xml(self._scenario.source, self._scenario.path)
            add_non_motion_actions(act, kept, {}, self._scenario, untouched, scope, version)
            build.time_trigger(act, "StartTrigger", 0.0, version)
        items = [item for item in self._moving.values() if item.pieces]
        if items:
            act = build.sub(story, "Act", name=f"{STORY} act")
            for item in items:
                add_trajectories(build.maneuver(act, f"{STORY} {item.name}", item.name), item, version, vertices)
            build.time_trigger(act, "StartTrigger", 0.0, version)
        if len(story):
            put_last(self._root, story)

    def _is_kept(self, played: PlayedAction, gone: Collection[Path]) -> bool:
        theirs = played.path[:3] in gone or (played.actor in self._moving and played.path != ("Init",))
        if not theirs or is_replaced(played.action, played.actor, self._moving):
            return False
        return dropped_reason(played.action, self._scenario) is None


def _remove(element: etree._Element, kinds: tuple[str, ...]) -> None:
    """Take an element out, and the act and the story around it where nothing else is in them."""
    owner = element.getparent()
    if owner is None:
        return
    owner.remove(element)
    if kinds and not any(isinstance(item.tag, str) and local_name(item) == kinds[0] for item in owner):
        _remove(owner, kinds[1:])


def put_last(root: etree._Element, story: etree._Element) -> None:
    """A story after all others."""
    storyboard = next(element for element in root if local_name(element) == "Storyboard")
    stop = next((element for element in storyboard if local_name(element) == "StopTrigger"), None)
    build.insert_indented(storyboard, len(storyboard) if stop is None else storyboard.index(stop), story)
