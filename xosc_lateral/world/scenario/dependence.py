"""What in a storyboard depends, directly or through others, on vehicles that somebody else or a controller drives.

A condition depends on them if it looks at such a vehicle, at somebody who depends on one, at a storyboard element whose
start or end does, or at a value that is set by such an event; an event through its condition; a vehicle through an
event that moves it or an action that refers to somebody. In doubt a thing depends: it is then left to react.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from typing import Any

from msgspec import Struct

from xosc_lateral.world.scenario import conditions
from xosc_lateral.world.scenario.enums import StoryboardElementState, StoryboardElementType
from xosc_lateral.world.scenario.global_actions import TrafficSignalControllerAction, TrafficSignalStateAction
from xosc_lateral.world.scenario.private_actions import (
    APPEARANCE,
    TeleportAction,
)
from xosc_lateral.world.scenario.scenario import (
    Act,
    Condition,
    Event,
    ManeuverGroup,
    Scenario,
    Trigger,
    actors_of,
    conditions_of,
)

Path = tuple[str, ...]

_DEPTH = {
    StoryboardElementType.STORY: 1,
    StoryboardElementType.ACT: 2,
    StoryboardElementType.MANEUVER_GROUP: 3,
    StoryboardElementType.MANEUVER: 4,
    StoryboardElementType.EVENT: 5,
    StoryboardElementType.ACTION: 6,
}
"""Names from the story down to an element."""

_REFERENCES = frozenset({"entity_ref", "entity_refs", "master_entity_ref", "trailer_ref"})


@dataclass(eq=False, slots=True)
class Dependence:
    """What depends on vehicles that are unforeseeable; see `dependence`."""

    entities: set[str]  # whose motion does, those vehicles included
    begins: set[Path] = field(default_factory=set)
    ends: set[Path] = field(default_factory=set)
    """Storyboard elements, by their names from the story down, whose start or end does."""
    values: set[str] = field(default_factory=set)
    """Parameters, variables, signals and signal controllers that are set by such an event."""

    def of_trigger(self, trigger: Trigger | None) -> bool:
        """Whether a trigger depends on them."""
        return any(self.of_condition(condition) for condition in conditions_of(trigger))

    def of_condition(self, condition: Condition) -> bool:
        """Whether a condition depends on them."""
        content = condition.content
        if not self.entities.isdisjoint(entity_references(condition)):
            return True
        match content:
            case conditions.CollisionCondition(entity_ref=None) | conditions.RelativeClearanceCondition(entity_refs=()):
                return bool(self.entities)  # anybody
            case conditions.StoryboardElementStateCondition():
                paths = self.begins if content.state is StoryboardElementState.START_TRANSITION else self.ends
                return any(refers_to(content, path) for path in paths)
            case conditions.ParameterCondition() | conditions.VariableCondition() | conditions.TrafficSignalCondition():
                return _value(content) in self.values
            case conditions.TrafficSignalControllerCondition():
                return content.controller_ref in self.values
        return isinstance(content, conditions.UserDefinedValueCondition)  # comes from whoever drives

    def size(self) -> int:
        """Of what was found."""
        return len(self.entities) + len(self.begins) + len(self.ends) + len(self.values)


def dependence(scenario: Scenario, unforeseeable: Collection[str]) -> Dependence:
    """What depends on vehicles under test or with controllers of their own; nothing if there are none."""
    result = Dependence(set(unforeseeable))
    if not unforeseeable:
        return result
    size = -1
    while result.size() != size:
        size = result.size()
        for private in scenario.storyboard.init.privates:
            for action in private.actions:  # where others are at the start is known
                if not isinstance(action.content, TeleportAction) and result.entities & set(
                    entity_references(action.content)
                ):
                    result.entities.add(private.entity_ref)
        for story in scenario.storyboard.stories:
            for act in story.acts:
                _follow_act(result, (story.name,), act)
        result.entities |= {e.trailer for e in scenario.entities if e.trailer is not None and e.name in result.entities}
    return result


def entity_references(content: object) -> Iterator[str]:
    """Entities that an action or a condition refers to, positions inside it included."""
    if isinstance(content, tuple):
        for item in content:
            yield from entity_references(item)
    elif isinstance(content, Struct):
        for name in content.__struct_fields__:
            value: Any = getattr(content, name)
            # A time to collision has an entity's name or a position.
            if isinstance(value, str) and (name in _REFERENCES or name == "target"):
                yield value
            elif name in _REFERENCES and isinstance(value, tuple):
                yield from value
            elif name != "properties":
                yield from entity_references(value)


def refers_to(content: conditions.StoryboardElementStateCondition, path: Path) -> bool:
    """Whether a state condition is about the element with these names from the story down."""
    wanted = tuple(content.element_ref.split("::"))
    return _DEPTH.get(content.element_type) == len(path) and path[len(path) - len(wanted) :] == wanted


def _follow_act(dependence: Dependence, above: Path, act: Act) -> None:
    path = (*above, act.name)
    begins = dependence.of_trigger(act.start_trigger)
    stops = dependence.of_trigger(act.stop_trigger)
    if begins:
        dependence.begins.add(path)
    if begins or stops:
        dependence.ends |= {path, above}
    for group in act.maneuver_groups:
        again = group.maximum_execution_count > 1 and (*path, group.name) in dependence.ends
        for maneuver, event in group.events():
            here = (*path, group.name, maneuver.name, event.name)
            _follow_event(dependence, here, act, group, event, cut=begins or stops or again)


def _follow_event(
    dependence: Dependence, path: Path, act: Act, group: ManeuverGroup, event: Event, *, cut: bool
) -> None:
    depends = cut or dependence.of_trigger(event.start_trigger)
    actors = set(actors_of(act, group, event))
    refers = False
    for action in event.actions:
        references = set(entity_references(action.content))
        moves = action.is_private and not isinstance(action.content, APPEARANCE)
        steered = bool(references & dependence.entities)
        refers |= steered
        if moves and (depends or steered):
            dependence.entities |= actors
        if not action.is_private and depends:
            dependence.entities |= references  # appears or is gone then
            dependence.values |= {_value(action.content)} - {""}
    if depends:
        dependence.begins |= {path, *((*path, action.name) for action in event.actions)}
    if depends or refers or actors & dependence.entities:
        dependence.ends |= {path[:depth] for depth in range(1, len(path) + 1)}
        dependence.ends |= {(*path, action.name) for action in event.actions}


def _value(content: object) -> str:
    """Name of the parameter, variable or signal that an action sets or a condition looks at; empty: none."""
    if isinstance(content, TrafficSignalStateAction | conditions.TrafficSignalCondition):
        return content.name
    if isinstance(content, TrafficSignalControllerAction):
        return content.controller_ref
    return str(getattr(content, "parameter_ref", "") or getattr(content, "variable_ref", ""))
