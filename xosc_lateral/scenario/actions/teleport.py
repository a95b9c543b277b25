"""Put an entity somewhere."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.place import Place
from xosc_lateral.scenario.position import Position


class TeleportAction(Struct, frozen=True):
    """At once."""

    position: Position
    place: Place
