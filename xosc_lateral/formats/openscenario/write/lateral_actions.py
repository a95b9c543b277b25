"""Lateral actions of a storyboard, and how a condition refers to them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from xosc_lateral.scenario import Action, Event, Scenario
from xosc_lateral.scenario.actions.lateral import LaneChangeAction, LaneOffsetAction, LateralDistanceAction
from xosc_lateral.scenario.actions.routing import FollowTrajectoryAction

LATERAL = (LaneChangeAction, LaneOffsetAction, LateralDistanceAction, FollowTrajectoryAction)


@dataclass(frozen=True, slots=True)
class LateralAction:
    """A lateral action: its names from the story down, and the type and name that a condition refers to it by.

    `repeats`: it may run more than once.
    """

    path: tuple[str, ...]
    kind: str
    reference: str
    repeats: bool = False


@dataclass(frozen=True, slots=True)
class LateralActions:
    """Lateral actions of events, per entity in file order, and by their names."""

    by_entity: Mapping[str, tuple[LateralAction, ...]]
    by_path: Mapping[tuple[str, ...], LateralAction]


def lateral_actions(scenario: Scenario) -> LateralActions:
    """All of a scenario's."""
    names = Counter(_names(scenario))
    by_entity: dict[str, dict[LateralAction, None]] = {}
    by_path = {}
    for above, event, action, actors, repeats in _event_actions(scenario):
        if isinstance(action.content, LATERAL):
            found = _referable((*above, event.name, action.name), len(event.actions) == 1, names)
            found = replace(found, repeats=repeats)
            by_path[found.path] = found
            for actor in actors:
                by_entity.setdefault(actor, {})[found] = None
    return LateralActions({entity: tuple(actions) for entity, actions in by_entity.items()}, by_path)


def _referable(path: tuple[str, ...], is_alone: bool, names: Mapping[str, int]) -> LateralAction:
    """By its own name where no other element has it, else by its event's, else by the whole path.

    An action without a name, which the standard doesn't allow and some tools write, has only its event's.
    """
    if path[-1] and names[path[-1]] == 1:
        return LateralAction(path, "action", path[-1])
    if (is_alone or not path[-1]) and names[path[-2]] == 1:
        return LateralAction(path, "event", path[-2])
    return LateralAction(path, "action", "::".join(path))


def _event_actions(scenario: Scenario) -> Iterator[tuple[tuple[str, ...], Event, Action, tuple[str, ...], bool]]:
    """Every action of every event, with the names above the event, the actors, and whether it may run again."""
    for story in scenario.storyboard.stories:
        for act in story.acts:
            for group in act.maneuver_groups:
                for maneuver in group.maneuvers:
                    for event in maneuver.events:
                        for action in event.actions:
                            above = (story.name, act.name, group.name, maneuver.name)
                            again = group.maximum_execution_count > 1 or event.maximum_execution_count > 1
                            yield above, event, action, group.actors.entity_refs, again


def _names(scenario: Scenario) -> Iterator[str]:
    """Name of every element of the storyboard."""
    for story in scenario.storyboard.stories:
        yield story.name
        for act in story.acts:
            yield act.name
            for group in act.maneuver_groups:
                yield group.name
                for maneuver in group.maneuvers:
                    yield maneuver.name
                    for event in maneuver.events:
                        yield event.name
                        yield from (action.name for action in event.actions)
