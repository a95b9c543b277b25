"""Triggers: groups (or) of conditions (and), with delays and edges."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.enums import ConditionEdge, TriggeringEntitiesRule
from xosc_lateral.scenario.place import Content, Place


class TriggeringEntities(Struct, frozen=True):
    """Whose state a condition looks at; entity selections are already replaced by their members."""

    rule: TriggeringEntitiesRule
    entity_refs: tuple[str, ...]


class Condition(Struct, frozen=True):
    """One condition. `triggering_entities` is None for value conditions. `delay` [s]"""

    name: str
    delay: float
    edge: ConditionEdge
    content: Content
    triggering_entities: TriggeringEntities | None
    place: Place


class ConditionGroup(Struct, frozen=True):
    """True when all of its conditions are."""

    conditions: tuple[Condition, ...]


class Trigger(Struct, frozen=True):
    """True when one of its groups is. No groups at all: see the player."""

    groups: tuple[ConditionGroup, ...]
    place: Place
