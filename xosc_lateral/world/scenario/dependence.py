"""What in a storyboard depends, directly or through others, on vehicles that somebody else or a controller drives.

A condition depends on them if it looks at such a vehicle, at somebody who depends on one, at a storyboard element whose
start or end does, or at a value that is set by such an event; an event through its condition; a vehicle through an
event that moves it or an action that refers to somebody. In doubt a thing depends: it is then left to react.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from msgspec import Struct

from xosc_lateral.world.scenario.conditions import (
    CollisionCondition,
    ParameterCondition,
    RelativeClearanceCondition,
    StoryboardElementStateCondition,
    TrafficSignalCondition,
    TrafficSignalControllerCondition,
    UserDefinedValueCondition,
    VariableCondition,
)
from xosc_lateral.world.scenario.controllers import AUTOPILOT, Domains, is_meant, kind_of, named, switches
from xosc_lateral.world.scenario.entity import Controller, Entity
from xosc_lateral.world.scenario.enums import StoryboardElementState, StoryboardElementType
from xosc_lateral.world.scenario.global_actions import TrafficSignalControllerAction, TrafficSignalStateAction
from xosc_lateral.world.scenario.private_actions import (
    APPEARANCE,
    CONTROLLER,
    ActivateControllerAction,
    AssignControllerAction,
    TeleportAction,
)
from xosc_lateral.world.scenario.scenario import Act, Action, Condition, Event, ManeuverGroup, Scenario, Trigger

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
        looked_at = set(entity_references(content))
        if condition.triggering_entities is not None:
            looked_at |= set(condition.triggering_entities.entity_refs)
        if looked_at & self.entities:
            return True
        match content:
            case CollisionCondition(entity_ref=None) | RelativeClearanceCondition(entity_refs=()):
                return bool(self.entities)  # anybody
            case StoryboardElementStateCondition():
                paths = self.begins if content.state is StoryboardElementState.START_TRANSITION else self.ends
                return any(refers_to(content, path) for path in paths)
            case ParameterCondition() | VariableCondition() | TrafficSignalCondition():
                return _value(content) in self.values
            case TrafficSignalControllerCondition():
                return content.controller_ref in self.values
        return isinstance(content, UserDefinedValueCondition)  # comes from whoever drives

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
        _follow_init(scenario, result)
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


def conditions_of(trigger: Trigger | None) -> Iterator[Condition]:
    """Every condition of a trigger, if there is one."""
    if trigger is not None:
        for group in trigger.groups:
            yield from group.conditions


def refers_to(content: StoryboardElementStateCondition, path: Path) -> bool:
    """Whether a state condition is about the element with these names from the story down."""
    wanted = tuple(content.element_ref.split("::"))
    return _DEPTH.get(content.element_type) == len(path) and path[len(path) - len(wanted) :] == wanted


def _follow_init(scenario: Scenario, dependence: Dependence) -> None:
    for private in scenario.storyboard.init.privates:
        for action in private.actions:
            # Where others are at the start is known.
            if not isinstance(action.content, TeleportAction) and dependence.entities & set(
                entity_references(action.content)
            ):
                dependence.entities.add(private.entity_ref)


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


def actors_of(act: Act, group: ManeuverGroup, event: Event) -> tuple[str, ...]:
    """Who may act in an event: the group's actors, and whoever triggers it where it is about them."""
    if not group.actors.select_triggering_entities:
        return group.actors.entity_refs
    triggering = [
        name
        for trigger in (act.start_trigger, event.start_trigger)
        for condition in conditions_of(trigger)
        if condition.triggering_entities is not None
        for name in condition.triggering_entities.entity_refs
    ]
    return tuple(dict.fromkeys([*group.actors.entity_refs, *triggering]))


def _value(content: object) -> str:
    """Name of the parameter, variable or signal that an action sets or a condition looks at; empty: none."""
    if isinstance(content, TrafficSignalStateAction | TrafficSignalCondition):
        return content.name
    if isinstance(content, TrafficSignalControllerAction):
        return content.controller_ref
    return str(getattr(content, "parameter_ref", "") or getattr(content, "variable_ref", ""))


# ---- vehicles that the storyboard does not drive: those under test, and those that a controller has ----
EXTERNAL_ENTITIES: Mapping[str, frozenset[str]] = {
    # CARLA's ScenarioRunner, openscenario_configuration.py: ego vehicles are those of this type.
    "type": frozenset({"ego_vehicle"}),
}
"""Property of a vehicle -> values that leave it to somebody else; both in lower case."""

EXTERNAL_NAMES = frozenset({"hero", "ego_vehicle"})
"""Names by which CARLA's tools look for the vehicle that they drive (its `role_name`)."""


def vehicles_under_test(scenario: Scenario) -> dict[str, str]:
    """Vehicles that the scenario leaves to somebody else, in its order, and what says so."""
    assigned = assigned_controllers(scenario)
    egos = {}
    for entity in scenario.entities:
        why = _why(entity, assigned[entity.name]) if entity.is_vehicle else ""
        if why:
            egos[entity.name] = why
    return egos


@dataclass(frozen=True, slots=True)
class Control:
    """Controllers that drive an entity at some time: their names, and the domains that they have then."""

    controllers: tuple[str, ...]
    domains: Domains

    def __str__(self) -> str:
        return f"{' and '.join(self.controllers)}: {self.domains.words()}"


def controlled_entities(scenario: Scenario) -> dict[str, Control]:
    """Entities that controllers drive at some time, by an action that makes them active, in the scenario's order."""
    assigned, actions = assigned_controllers(scenario), dict[str, list[object]]()
    for actors, action in _private_actions(scenario):
        for actor in actors if isinstance(action.content, CONTROLLER) else ():
            actions.setdefault(actor, []).append(action.content)
    reasons = {}
    for entity in scenario.entities:
        names, domains = dict[str, None](), Domains.NONE
        contents = actions.get(entity.name, [])
        for controller in assigned[entity.name]:
            kind = kind_of(controller)
            asked = Domains.BOTH if kind.at_once else Domains.NONE
            for domain in _switched_on(content for content in contents if is_meant(controller, content)):
                asked |= domain
            if kind.active(asked):
                names[named(controller)] = None
                domains |= kind.active(asked)
        activations = (content for content in contents if isinstance(content, ActivateControllerAction))
        if scenario.header.is_left_handed and any(_switched_on(activations)):
            names[AUTOPILOT.name] = None
            domains = Domains.BOTH
        if domains:
            reasons[entity.name] = Control(tuple(names), domains)
    return reasons


def _switched_on(contents: Iterable[object]) -> Iterator[Domains]:
    return (domain for content in contents for domain, on in switches(content) if on)


def assigned_controllers(scenario: Scenario) -> dict[str, list[Controller]]:
    """Controllers of each entity, from the start or later."""
    assigned = {entity.name: list(entity.controllers) for entity in scenario.entities}
    for actors, action in _private_actions(scenario):
        content = action.content
        if isinstance(content, AssignControllerAction) and content.controller is not None:
            for actor in actors:
                assigned.setdefault(actor, []).append(content.controller)
    return assigned


def _why(entity: Entity, controllers: Iterable[Controller]) -> str:
    for controller in controllers:
        if kind_of(controller).is_external:
            return f"controller {named(controller)}"
    for name, value in entity.properties.items():
        if value.strip().lower() in EXTERNAL_ENTITIES.get(name.strip().lower(), ()):
            return f"{name} {value}"
    return f"its name is '{entity.name}'" if entity.name in EXTERNAL_NAMES else ""


def _private_actions(scenario: Scenario) -> Iterator[tuple[tuple[str, ...], Action]]:
    for private in scenario.storyboard.init.privates:
        for action in private.actions:
            yield (private.entity_ref,), action
    for _, act, group in scenario.storyboard.groups():
        for _, event in group.events():
            actors = actors_of(act, group, event)
            for action in event.actions:
                yield actors, action
