"""Entities that come and go."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position


@dataclass(frozen=True, slots=True)
class AddEntityAction:
    """The entity appears."""

    entity_ref: str
    position: Position
    place: Place


@dataclass(frozen=True, slots=True)
class DeleteEntityAction:
    """The entity is gone."""

    entity_ref: str
    place: Place


@dataclass(frozen=True, slots=True)
class TrafficAction:
    """Traffic source, sink, swarm, area, stop: kept and named, not played: its cars are the tool's own."""

    kind: str
    place: Place
