"""Vehicles that the storyboard does not drive: those under test, and those of a player's own controllers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from xosc_lateral.world.scenario.controllers import AUTOPILOT, Domains, is_meant, kind_of, named, switches
from xosc_lateral.world.scenario.dependence import actors_of
from xosc_lateral.world.scenario.entity import Controller, Entity
from xosc_lateral.world.scenario.private_actions import CONTROLLER, ActivateControllerAction, AssignControllerAction
from xosc_lateral.world.scenario.scenario import Scenario
from xosc_lateral.world.scenario.storyboard import Action

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
    """Entities whose motion controllers decide at some time, in the scenario's order.

    Those alone that some action makes active: an assigned one that nothing activates drives nobody.
    """
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
