"""Weather, time of day, road condition."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.environment import Environment
from xosc_lateral.scenario.place import Place


class EnvironmentAction(Struct, frozen=True):
    """Set the environment; parts that are None stay as they are."""

    environment: Environment
    place: Place
