"""Weather, time of day, road condition."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.environment import Environment
from xosc_lateral.scenario.place import Place


@dataclass(frozen=True, slots=True)
class EnvironmentAction:
    """Set the environment; parts that are None stay as they are."""

    environment: Environment
    place: Place
