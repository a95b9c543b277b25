"""Lateral actions of a storyboard, and how a condition refers to them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from math import inf

from msgspec import Struct

from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.scenario import Scenario
from xosc_lateral.world.scenario.controllers import Domains, switches_lateral
from xosc_lateral.world.scenario.dependence import Dependence
from xosc_lateral.world.scenario.private_actions import LATERAL
from xosc_lateral.world.scenario.under_test import controlled_entities


class LateralAction(Struct, frozen=True):
    """A lateral action: its names from the story down, and the type and name that a condition refers to it by.

    `repeats`: it may run more than once; `at_once`: it gives the lateral domain to a controller, or takes it back.
    """

    path: tuple[str, ...]
    kind: str
    reference: str
    repeats: bool = False
    at_once: bool = False


def lateral_actions(scenario: Scenario) -> dict[str, tuple[LateralAction, ...]]:
    """Lateral actions of events, by entity, in file order."""
    names = Counter(_names(scenario))
    steered = {name for name, one in controlled_entities(scenario).items() if Domains.LATERAL in one.domains}
    by_entity: dict[str, dict[LateralAction, None]] = {}
    for story, act, group in scenario.storyboard.groups():
        for maneuver, event in group.events():
            repeats = group.maximum_execution_count > 1 or event.maximum_execution_count > 1
            for action in event.actions:
                at_once = switches_lateral(action.content)
                actors = [one for one in group.actors.entity_refs if one in steered or not at_once]
                if at_once or isinstance(action.content, LATERAL):
                    path = (story.name, act.name, group.name, maneuver.name, event.name, action.name)
                    found = LateralAction(path, *_reference(path, len(event.actions) == 1, names), repeats, at_once)
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
