"""Controllers: named and reported; the default driver plays instead."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.entity import Controller
from xosc_lateral.scenario.place import Place


@dataclass(frozen=True, slots=True)
class AssignControllerAction:
    """Assign, and perhaps activate on a domain (None: not said)."""

    controller: Controller | None
    place: Place
    activate_lateral: bool | None = None
    activate_longitudinal: bool | None = None


@dataclass(frozen=True, slots=True)
class ActivateControllerAction:
    """Activate or deactivate on a domain (None: unchanged)."""

    place: Place
    lateral: bool | None = None
    longitudinal: bool | None = None
    controller_ref: str | None = None


@dataclass(frozen=True, slots=True)
class OverrideControllerValueAction:
    """Pedals, gear, steering wheel; `overrides` holds their names and values."""

    overrides: tuple[tuple[str, bool, float | None], ...]
    place: Place
