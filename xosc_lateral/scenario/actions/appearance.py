"""What can be seen of an entity: kept by the writer, played as nothing."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.place import Place


class VisibilityAction(Struct, frozen=True):
    """Seen by graphics, sensors, other traffic."""

    graphics: bool
    sensors: bool
    traffic: bool
    place: Place


class LightStateAction(Struct, frozen=True):
    """A light goes on, off, or flashes."""

    light: str
    mode: str
    place: Place
    transition_time: float = 0.0


class AnimationAction(Struct, frozen=True):
    """A component or a pedestrian is animated; `duration` [s]."""

    kind: str
    place: Place
    loop: bool = False
    duration: float = 0.0
