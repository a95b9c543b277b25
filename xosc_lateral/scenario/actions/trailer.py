"""Trailers come and go."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.place import Place


@dataclass(frozen=True, slots=True)
class ConnectTrailerAction:
    """Hitch that entity."""

    trailer_ref: str
    place: Place


@dataclass(frozen=True, slots=True)
class DisconnectTrailerAction:
    """Leave it where it is."""

    place: Place
