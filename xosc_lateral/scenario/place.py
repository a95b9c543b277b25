"""Where an element stands in its file: every element that can be complained about carries one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

from msgspec import Struct


@dataclass(frozen=True, slots=True)
class Place:
    """File, line and element of something read.

    Parameters
    ----------
    path : str
        The file (a scenario or a catalog).
    line : int or None
        Line, from 1.
    element : str
        The element as errors name it, as in ``Event 'brake'``.
    node : tuple of int
        Child indices from the root element down: finds the same XML element again in a new parse of the same bytes.
    """

    path: str
    line: int | None
    element: str
    node: tuple[int, ...] = field(default=(), repr=False, compare=False)


class Unsupported(Struct, frozen=True):
    """Something that was understood to be there, but that the model holds no more of: the player names it.

    Parameters
    ----------
    kind : str
        The standard's element name, as in ``RandomRouteAction``.
    place : Place
        Where it stands.
    reason : str
        Why, if there is more to say than that it is unknown.
    """

    kind: str
    place: Place
    reason: str = ""


class Content(Protocol):
    """What an action or a condition says: any frozen struct that knows where it stands."""

    @property
    def place(self) -> Place:
        """Where it stands."""
        ...
