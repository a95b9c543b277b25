"""Put an entity somewhere."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position


@dataclass(frozen=True, slots=True)
class TeleportAction:
    """At once."""

    position: Position
    place: Place
