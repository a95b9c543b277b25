"""Commands for a simulator: kept by the writer, played as nothing."""

from __future__ import annotations

from dataclasses import dataclass

from xosc_lateral.scenario.place import Place


@dataclass(frozen=True, slots=True)
class UserDefinedAction:
    """`type` and the text of a CustomCommandAction."""

    type: str
    content: str
    place: Place
