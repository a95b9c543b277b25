"""What roads are linked to: each other, and junctions with ways through them."""

from __future__ import annotations

from msgspec import Struct


class RoadLink(Struct, frozen=True):
    """What a road is linked to at one of its ends.

    Attributes
    ----------
    element_type : str
        ``"road"`` or ``"junction"``.
    element_id : str
        Its id.
    contact : str
        Where the other road is touched: ``"start"``, ``"end"``, or empty when the file does not say (junctions).
    """

    element_type: str
    element_id: str
    contact: str


class Connection(Struct, frozen=True):
    """A way through a junction: from an incoming road onto a connecting one.

    `lanes` holds (from, to) lane ids; empty: the file gives none.
    """

    incoming_road: str
    connecting_road: str
    contact: str
    lanes: tuple[tuple[int, int], ...]


class Junction(Struct, frozen=True):
    """A junction and its connections."""

    id: str
    name: str
    connections: tuple[Connection, ...]
