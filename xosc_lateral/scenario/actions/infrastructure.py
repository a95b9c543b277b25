"""Traffic signals."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.place import Place


@dataclass(frozen=True, slots=True)
class TrafficSignalStateAction:
    """One signal gets a state."""

    name: str
    state: str
    place: Place


@dataclass(frozen=True, slots=True)
class TrafficSignalControllerAction:
    """A signal controller goes to a phase."""

    controller_ref: str
    phase: str
    place: Place
