"""The XML of one OpenDRIVE file, with numbers checked and every complaint located."""

from __future__ import annotations

from collections import Counter
from copy import deepcopy
from dataclasses import dataclass, field
from math import isfinite

from lxml import etree

from xosc_lateral.base.errors import FormatError, meant_for
from xosc_lateral.base.note import Note
from xosc_lateral.files.xml import line_of
from xosc_lateral.world.road.piecewise import Cubic

XmlElement = etree._Element

MAXIMUM_NUMBER = 1e12
"""No number of a road is larger; beyond, squares and cubes would overflow sooner or later."""


@dataclass(slots=True)
class RoadFile:
    """One file being read: its path, the SHA-256 of its bytes, and what was noted on the way."""

    path: str
    sha256: str = ""
    _notes: Counter[str] = field(default_factory=Counter)
    _first_line: dict[str, int] = field(default_factory=dict)

    def note(self, what: str, element: XmlElement) -> None:
        """Remember something that was repaired or ignored; the same note twice is counted, not repeated."""
        self._notes[what] += 1
        self._first_line.setdefault(what, line_of(element) or 0)

    @property
    def notes(self) -> tuple[Note, ...]:
        """One per kind of note, with the line of its first occurrence."""
        return tuple(
            Note(what + (f" (and {count - 1} more)" if count > 1 else ""), self.path, self._first_line[what])
            for what, count in self._notes.items()
        )

    def error(self, what: str, element: XmlElement) -> FormatError:
        """An error at an element."""
        return FormatError(what, path=self.path, line=line_of(element), element=describe(element))

    def number(self, element: XmlElement, name: str, default: float | None = None) -> float:
        """A finite number; `default` where the attribute is absent (None: it must be there)."""
        text = element.get(name)
        if text is None:
            if default is None:
                raise self.error(f"attribute '{name}' is missing", element)
            return default
        try:
            value = float(text)
        except ValueError:
            raise self.error(f"{name}={text!r} is not a number", element) from None
        if not isfinite(value):
            raise self.error(f"{name}={text!r} is not finite", element)
        if abs(value) > MAXIMUM_NUMBER:
            raise self.error(f"{name}={text!r} is larger than {MAXIMUM_NUMBER:g}", element)
        return value

    def appearance(self, element: XmlElement, name: str, default: float) -> float:
        """A number that only matters to the eye: what can't be read is noted and replaced by the default."""
        try:
            return self.number(element, name, default)
        except FormatError as error:
            self.note(f"{error.what}: {default:g} used", element)
            return default

    def cubic(self, element: XmlElement, axis: str = "") -> Cubic:
        """Attributes a, b, c, d, or those of an axis (aU ...); absent ones are 0."""
        a, b, c, d = (self.number(element, letter + axis, 0.0) for letter in "abcd")
        return a, b, c, d

    def integer(self, element: XmlElement, name: str) -> int:
        """A whole number."""
        value = self.number(element, name)
        if value != int(value):
            raise self.error(f"{name}={element.get(name)!r} is not a whole number", element)
        return int(value)


def plain_root(root: XmlElement, path: str) -> XmlElement:
    """The root without namespaces. Raises `FormatError`: it is none of OpenDRIVE."""
    if root.tag.startswith("{"):
        root = deepcopy(root)  # the tree is shared between callers
        for element in root.iter(etree.Element):
            element.tag = element.tag.rpartition("}")[2]
    if root.tag != "OpenDRIVE":
        hint = meant_for(".xosc") if root.tag == "OpenSCENARIO" else ""
        raise FormatError(f"root element is '{root.tag}', expected 'OpenDRIVE'{hint}", path=path, line=line_of(root))
    return root


def describe(element: XmlElement) -> str:
    """Where an element is, as in ``road '3' geometry``."""
    road = next((above for above in element.iterancestors() if above.tag in ("road", "junction")), None)
    identity = next((element.get(key) for key in ("id", "s", "sOffset") if element.get(key) is not None), None)
    name = element.tag if identity is None else f"{element.tag} '{identity}'"
    return name if road is None else f"{road.tag} '{road.get('id')}' {name}"
