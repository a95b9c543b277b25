"""Routes."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.enums import RouteStrategy
from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A place to pass, and how to come to it."""

    position: Position
    strategy: RouteStrategy


@dataclass(frozen=True, slots=True)
class Route:
    """At least two waypoints."""

    name: str
    waypoints: tuple[Waypoint, ...]
    closed: bool
    place: Place
