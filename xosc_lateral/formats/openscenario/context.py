"""What every part of the reader needs to know about the scenario that it is in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.openscenario.catalogs import Catalogs
from xosc_lateral.formats.openscenario.element import XmlElement
from xosc_lateral.scenario.place import Unsupported

MAX_NESTING = 20
"""Routes in positions in routes ...: bounds the recursion."""


@dataclass(slots=True)
class Context:
    """State of one reading.

    Parameters
    ----------
    version : tuple of int
        (major, minor) of the file.
    catalogs : Catalogs
    remarks : list of Unsupported
        Collected on the way.
    entities : set of str
        Names of scenario objects; filled before the storyboard is read.
    selections : mapping of str to tuple of str
        Entity selections and their members.
    strict : bool
        Refuse what could be replaced by something usual (a vehicle whose catalog is missing).
    left_handed : bool
        Written for CARLA; see `left_handed`.
    """

    version: tuple[int, int]
    catalogs: Catalogs
    remarks: list[Unsupported]
    entities: set[str] = field(default_factory=set)
    selections: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    strict: bool = False
    left_handed: bool = False
    _depth: int = 0

    def entity(self, element: XmlElement, name: str = "entityRef") -> str:
        """Attribute naming an entity that must exist."""
        reference = element.text(name)
        if reference not in self.entities:
            known = ", ".join(sorted(self.entities)[:8]) or "none"
            element.fail(f"{name}: no entity '{reference[:60]}' (there are {known})")
        return reference

    def members(self, element: XmlElement) -> tuple[str, ...]:
        """Entities that an EntityRef stands for: one, or those of a selection."""
        reference = element.text("entityRef")
        if reference in self.selections:
            return self.selections[reference]
        return (self.entity(element),)

    def remark(self, element: XmlElement, reason: str = "", kind: str = "") -> Unsupported:
        """Note something that is read over."""
        remark = Unsupported(kind or element.tag, element.place(), reason)
        self.remarks.append(remark)
        return remark

    def optional_entry(self, reference: XmlElement) -> XmlElement | None:
        """Catalog entry that motion does not depend on: a missing one is remarked, not refused."""
        try:
            return self.catalogs.entry(reference)
        except FormatError as error:
            self.remark(reference, error.what)
            return None

    def enter(self, element: XmlElement) -> None:
        """Count nesting; `leave` again."""
        self._depth += 1
        if self._depth > MAX_NESTING:
            element.fail(f"positions, routes and trajectories are nested more than {MAX_NESTING} deep")

    def leave(self) -> None:
        """Undo `enter`."""
        self._depth -= 1
