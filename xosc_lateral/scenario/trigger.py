"""Triggers: groups (or) of conditions (and), with delays and edges."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.enums import ConditionEdge, TriggeringEntitiesRule
from xosc_lateral.scenario.place import Content, Place


@dataclass(frozen=True, slots=True)
class TriggeringEntities:
    """Whose state a condition looks at; entity selections are already replaced by their members."""

    rule: TriggeringEntitiesRule
    entity_refs: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Condition:
    """One condition. `triggering_entities` is None for value conditions. `delay` [s]"""

    name: str
    delay: float
    edge: ConditionEdge
    content: Content
    triggering_entities: TriggeringEntities | None
    place: Place


@dataclass(frozen=True, slots=True)
class ConditionGroup:
    """True when all of its conditions are."""

    conditions: tuple[Condition, ...]


@dataclass(frozen=True, slots=True)
class Trigger:
    """True when one of its groups is. No groups at all: see the player."""

    groups: tuple[ConditionGroup, ...]
    place: Place
