"""Controllers: named and reported; the default driver plays instead."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.entity import Controller
from xosc_lateral.scenario.place import Place


class AssignControllerAction(Struct, frozen=True):
    """Assign, and perhaps activate on a domain (None: not said)."""

    controller: Controller | None
    place: Place
    activate_lateral: bool | None = None
    activate_longitudinal: bool | None = None


class ActivateControllerAction(Struct, frozen=True):
    """Activate or deactivate on a domain (None: unchanged)."""

    place: Place
    lateral: bool | None = None
    longitudinal: bool | None = None
    controller_ref: str | None = None


class OverrideControllerValueAction(Struct, frozen=True):
    """Pedals, gear, steering wheel; `overrides` holds their names and values."""

    overrides: tuple[tuple[str, bool, float | None], ...]
    place: Place
