"""Entities that come and go."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position


class AddEntityAction(Struct, frozen=True):
    """The entity appears."""

    entity_ref: str
    position: Position
    place: Place


class DeleteEntityAction(Struct, frozen=True):
    """The entity is gone."""

    entity_ref: str
    place: Place


class TrafficAction(Struct, frozen=True):
    """Traffic source, sink, swarm, area, stop: kept and named, not played: its cars are the tool's own."""

    kind: str
    place: Place
