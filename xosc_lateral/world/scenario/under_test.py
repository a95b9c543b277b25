"""Vehicles under test: those that a system outside of the scenario drives, as players' own words for it say."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from xosc_lateral.world.scenario.entity import Controller, Entity
from xosc_lateral.world.scenario.private_actions import AssignControllerAction
from xosc_lateral.world.scenario.scenario import Scenario
from xosc_lateral.world.scenario.storyboard import Action

EXTERNAL_CONTROLLERS: Mapping[str, frozenset[str]] = {
    # esmini, Controllers.md: the application reports the vehicle's state through the library, or over UDP.
    "esminicontroller": frozenset({"externalcontroller", "udpdrivercontroller"}),
    # CARLA's ScenarioRunner, openscenario_support.md: the actor is controlled by another process.
    "module": frozenset({"external_control"}),
}
"""Property of a controller -> values that leave the vehicle to somebody else; both in lower case."""

EXTERNAL_ENTITIES: Mapping[str, frozenset[str]] = {
    # CARLA's ScenarioRunner, openscenario_configuration.py: ego vehicles are those of this type.
    "type": frozenset({"ego_vehicle"}),
}
"""The same for properties of the vehicle itself."""

EXTERNAL_NAMES = frozenset({"hero", "ego_vehicle"})
"""Names by which CARLA's tools look for the vehicle that they drive (its `role_name`)."""


def vehicles_under_test(scenario: Scenario) -> dict[str, str]:
    """Vehicles that the scenario leaves to somebody else, in its order, and what says so."""
    assigned = dict[str, list[Controller]]()
    for actors, action in _private_actions(scenario):
        content = action.content
        if isinstance(content, AssignControllerAction) and content.controller is not None:
            for actor in actors:
                assigned.setdefault(actor, []).append(content.controller)
    found = {}
    for entity in scenario.entities:
        why = _why(entity, (*entity.controllers, *assigned.get(entity.name, ()))) if entity.is_vehicle else ""
        if why:
            found[entity.name] = why
    return found


def controlled_entities(scenario: Scenario) -> frozenset[str]:
    """Entities that have a controller of any kind, from the start or later."""
    assigned = {
        actor
        for actors, action in _private_actions(scenario)
        if isinstance(action.content, AssignControllerAction) and action.content.controller is not None
        for actor in actors
    }
    return frozenset(assigned | {entity.name for entity in scenario.entities if entity.controllers})


def _why(entity: Entity, controllers: tuple[Controller, ...]) -> str:
    for controller in controllers:
        named = _named(controller.properties, EXTERNAL_CONTROLLERS)
        if named:
            return f"controller '{controller.name}': {named}"
    named = _named(entity.properties, EXTERNAL_ENTITIES)
    if named:
        return named
    return f"its name is '{entity.name}'" if entity.name in EXTERNAL_NAMES else ""


def _named(properties: Mapping[str, str], table: Mapping[str, frozenset[str]]) -> str:
    for name, value in properties.items():
        if value.strip().lower() in table.get(name.strip().lower(), ()):
            return f"{name} {value}"
    return ""


def _private_actions(scenario: Scenario) -> Iterator[tuple[tuple[str, ...], Action]]:
    for private in scenario.storyboard.init.privates:
        for action in private.actions:
            yield (private.entity_ref,), action
    for _, _, group in scenario.storyboard.groups():
        for _, event in group.events():
            for action in event.actions:
                yield group.actors.entity_refs, action
