"""What can be seen of an entity: kept by the writer, played as nothing."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.place import Place


@dataclass(frozen=True, slots=True)
class VisibilityAction:
    """Seen by graphics, sensors, other traffic."""

    graphics: bool
    sensors: bool
    traffic: bool
    place: Place


@dataclass(frozen=True, slots=True)
class LightStateAction:
    """A light goes on, off, or flashes."""

    light: str
    mode: str
    place: Place
    transition_time: float = 0.0


@dataclass(frozen=True, slots=True)
class AnimationAction:
    """A component or a pedestrian is animated; `duration` [s]."""

    kind: str
    place: Place
    loop: bool = False
    duration: float = 0.0
