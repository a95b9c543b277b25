"""Commands for a simulator: kept by the writer, played as nothing."""

from __future__ import annotations

from msgspec import Struct

from xosc_lateral.scenario.place import Place


class UserDefinedAction(Struct, frozen=True):
    """`type` and the text of a CustomCommandAction."""

    type: str
    content: str
    place: Place
