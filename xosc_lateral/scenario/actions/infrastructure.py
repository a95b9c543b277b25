"""Traffic signals."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.place import Place


class TrafficSignalStateAction(Struct, frozen=True):
    """One signal gets a state."""

    name: str
    state: str
    place: Place


class TrafficSignalControllerAction(Struct, frozen=True):
    """A signal controller goes to a phase."""

    controller_ref: str
    phase: str
    place: Place
