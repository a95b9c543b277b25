"""What moves entities sideways in a storyboard or puts them there, and how a condition refers to it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping

from msgspec import Struct

from xosc_lateral.world.scenario.controllers import Domains, gives_lateral
from xosc_lateral.world.scenario.dependence import actors_of, controlled_entities
from xosc_lateral.world.scenario.global_actions import AddEntityAction
from xosc_lateral.world.scenario.private_actions import LATERAL, LONGITUDINAL, TeleportAction
from xosc_lateral.world.scenario.scenario import Action, Scenario


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
        for path, actors, action, repeats, is_alone in _actions(scenario):
            content, steers = action.content, gives_lateral(action.content)
            if isinstance(content, LONGITUDINAL):
                changing |= set(actors)
            if steers is not None:
                actors = tuple(a for a in actors if a in controls and Domains.LATERAL in controls[a].domains)
            adds = isinstance(content, AddEntityAction)
            if adds or steers is not None or isinstance(content, (*LATERAL, TeleportAction)):
                lateral = LateralAction(path, *_reference(path, is_alone, names), repeats, adds, steers)
                for actor in (content.entity_ref,) if isinstance(content, AddEntityAction) else actors:
                    by_entity.setdefault(actor, {})[lateral] = None
        return cls({entity: tuple(actions) for entity, actions in by_entity.items()}, frozenset(changing))


def _actions(scenario: Scenario) -> Iterator[tuple[tuple[str, ...], tuple[str, ...], Action, bool, bool]]:
    """Path and actors of each action of an event, whether it may run again, and whether it is alone in its event."""
    for story, act, group in scenario.storyboard.groups():
        for maneuver, event in group.events():
            repeats = group.maximum_execution_count > 1 or event.maximum_execution_count > 1
            for action in event.actions:
                path = (story.name, act.name, group.name, maneuver.name, event.name, action.name)
                yield path, actors_of(act, group, event), action, repeats, len(event.actions) == 1


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
