"""Trailers come and go."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.place import Place


class ConnectTrailerAction(Struct, frozen=True):
    """Hitch that entity."""

    trailer_ref: str
    place: Place


class DisconnectTrailerAction(Struct, frozen=True):
    """Leave it where it is."""

    place: Place
