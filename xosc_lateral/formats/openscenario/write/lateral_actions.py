"""Lateral actions of a storyboard, and how a condition refers to them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.motion.nominal import NominalMotion
from xosc_lateral.scenario import Action, Event, Scenario
from xosc_lateral.scenario.dependence import Dependence
from xosc_lateral.scenario.private_actions import LATERAL


class LateralAction(Struct, frozen=True):
    """A lateral action: its names from the story down, and the type and name that a condition refers to it by.

    `repeats`: it may run more than once.
    """

    path: tuple[str, ...]
    kind: str
    reference: str
    repeats: bool = False


def lateral_actions(scenario: Scenario) -> dict[str, tuple[LateralAction, ...]]:
    """Lateral actions of events, by entity, in file order."""
    names = Counter(_names(scenario))
    by_entity: dict[str, dict[LateralAction, None]] = {}
    for above, event, action, actors, repeats in _event_actions(scenario):
        if isinstance(action.content, LATERAL):
            found = _referable((*above, event.name, action.name), len(event.actions) == 1, names)
            found = replace(found, repeats=repeats)
            for actor in actors:
                by_entity.setdefault(actor, {})[found] = None
    return {entity: tuple(actions) for entity, actions in by_entity.items()}


def awaited(items: Collection[LateralAction], depends: Dependence) -> list[LateralAction]:
    """Those whose start depends on a vehicle under test."""
    return [item for item in items if item.path in depends.begins]


def overruled_until(items: Collection[LateralAction], motion: NominalMotion) -> float:
    """Until when one of them may still come: its last start, for ever if it may run again or never did. [s]"""
    last = dict[tuple[str, ...], float]()
    for played in motion.actions:
        last[played.path] = max(played.start, last.get(played.path, played.start))
    return max((inf if item.repeats else last.get(item.path, inf) for item in items), default=-inf)


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
