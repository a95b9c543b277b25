"""One XML element with its parameters filled in: attributes as typed values, errors with file, line and element."""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import NoReturn, TypeVar, cast

from lxml import etree

from xosc_lateral.world.scenario.enums import SYNONYMS
from xosc_lateral.world.scenario.parameters import ExpressionError, Scope
from xosc_lateral.world.scenario.place import Place

E = TypeVar("E", bound=StrEnum)
V = TypeVar("V")

MAXIMUM_NUMBER = 1e15
"""Largest finite number that is taken: its square is still far from overflow, and no unit makes sense of it."""

_TRUE = {"true", "1", "1.0000000000", "yes"}
_FALSE = {"false", "0", "0.0000000000", "no"}


def means_true(text: str) -> bool:
    """Whether a word is read as true, in any case."""
    return text.strip().lower() in _TRUE


class XmlElement:
    """An element of the scenario or of a catalog, in the scope that its attributes are read in.

    Optional attributes: `default` comes back where the attribute is missing or empty. Required ones raise.
    """

    __slots__ = ("path", "scope", "xml")

    def __init__(self, xml: etree._Element, path: Path, scope: Scope) -> None:
        self.xml, self.path, self.scope = xml, path, scope

    # --- tree ---------------------------------------------------------------------------------------------------

    @property
    def tag(self) -> str:
        """Name without namespace."""
        return local_name(self.xml)

    def children(self, *tags: str) -> Iterator[XmlElement]:
        """Child elements, of these tags or all; comments left out."""
        for child in self.xml:
            if isinstance(child.tag, str) and (not tags or local_name(child) in tags):
                yield XmlElement(child, self.path, self.scope)

    def listed(self, holder: str, tag: str) -> Iterator[XmlElement]:
        """Elements of one tag in a child that holds them; none without it."""
        owner = self.child(holder)
        return iter(()) if owner is None else owner.children(tag)

    def child(self, *tags: str) -> XmlElement | None:
        """First child of one of these tags."""
        return next(self.children(*tags), None)

    def required(self, *tags: str) -> XmlElement:
        """First child of one of these tags; an error without."""
        inner = self.child(*tags)
        if inner is None:
            self.fail(f"{' or '.join(tags)} is missing")
        return inner

    def within(self, scope: Scope) -> XmlElement:
        """The same element in another scope."""
        return XmlElement(self.xml, self.path, scope)

    # --- attributes ---------------------------------------------------------------------------------------------

    def raw(self, name: str) -> str | None:
        """Attribute as written."""
        return self.xml.get(name)

    def optional_text(self, name: str) -> str | None:
        """Attribute with its parameter filled in; None where it is missing."""
        raw = self.xml.get(name)
        if raw is None or not raw.startswith(("$", "\\")):
            return raw
        try:
            return self.scope.fill(raw)
        except ExpressionError as error:
            self.fail(f"{name}: {error}")

    def optional_number(self, name: str, *, finite: bool = True) -> float | None:
        """Attribute as a number; None where it is missing. NaN is refused, infinity where `finite`."""
        text = self.optional_text(name)
        if text is None:
            return None
        try:
            value = float(text)
        except ValueError:
            self.fail(f"{name}='{text[:60]}' is not a number")
        if math.isnan(value) or (finite and math.isinf(value)):
            self.fail(f"{name}='{text[:60]}' is not finite")
        if finite and abs(value) > MAXIMUM_NUMBER:
            self.fail(f"{name}='{text[:60]}' is implausibly large (at most {MAXIMUM_NUMBER:g})")
        return value

    def optional_integer(self, name: str) -> int | None:
        """Attribute as a whole number; ``2.0000000000`` of an expression is one."""
        value = self.optional_number(name)
        if value is None:
            return None
        if value != round(value) or abs(value) > 2**53:
            self.fail(f"{name}='{self.text(name)}' is not a whole number")
        return round(value)

    def optional_boolean(self, name: str) -> bool | None:
        """Attribute as a truth value, in any case and as 0 and 1; None where it is missing or empty."""
        text = self.optional_text(name)
        if text is None or not text.strip():
            return None
        if means_true(text):
            return True
        if text.strip().lower() in _FALSE:
            return False
        self.fail(f"{name}='{text[:60]}' is neither true nor false")

    def optional_choice(self, name: str, kind: type[E]) -> E | None:
        """Attribute as an option code; None where it is missing or empty. The case of letters does not count."""
        text = self.optional_text(name)
        if text is None or not text.strip():
            return None
        word = text.strip()
        older = SYNONYMS.get(kind, {}).get(word)
        if older is not None:
            return cast("E", older)
        for member in kind:
            if member.value.lower() == word.lower():
                return member
        self.fail(f"{name}='{text[:60]}' is none of {', '.join(kind)}")

    def text(self, name: str, default: str | None = None) -> str:
        """Attribute as text."""
        return self._required(name, self.optional_text(name), default)

    def number(self, name: str, default: float | None = None, *, finite: bool = True) -> float:
        """Attribute as a number."""
        return self._required(name, self.optional_number(name, finite=finite), default)

    def integer(self, name: str, default: int | None = None) -> int:
        """Attribute as a whole number."""
        return self._required(name, self.optional_integer(name), default)

    def boolean(self, name: str, default: bool | None = None) -> bool:
        """Attribute as a truth value."""
        return self._required(name, self.optional_boolean(name), default)

    def choice(self, name: str, kind: type[E], default: E | None = None) -> E:
        """Attribute as an option code."""
        return self._required(name, self.optional_choice(name, kind), default)

    def _required(self, name: str, value: V | None, default: V | None) -> V:
        value = default if value is None else value
        if value is None:
            self.fail(f"attribute '{name}' is missing")
        return value

    # --- place --------------------------------------------------------------------------------------------------

    def place(self) -> Place:
        """File, line, element, and the way to find it again."""
        return Place(str(self.path), line_of(self.xml), self.label(), node_of(self.xml))

    def label(self) -> str:
        """``Event 'brake'``, or ``SpeedAction of Event 'brake'`` for an element without a name."""
        named = _name(self.xml)
        if named:
            return f"{self.tag} '{named}'"
        for ancestor in self.xml.iterancestors():
            name = _name(ancestor)
            if name:
                return f"{self.tag} of {local_name(ancestor)} '{name}'"
        return self.tag

    def fail(self, what: str) -> NoReturn:
        """Raise a `FormatError` that names this element."""
        raise self.place().error(what)


def local_name(xml: etree._Element) -> str:
    """Tag without namespace."""
    return str(xml.tag).rpartition("}")[2]


def elements(xml: etree._Element, *tags: str) -> list[etree._Element]:
    """An element and all below it, of these tags or all; no comments. A list, for what changes the tree."""
    return list(xml.iter(*(f"{{*}}{tag}" for tag in tags or ("*",))))


def children_of(xml: etree._Element) -> list[etree._Element]:
    """Child elements; no comments."""
    return [child for child in xml if isinstance(child.tag, str)]


def child_of(xml: etree._Element, tag: str) -> etree._Element | None:
    """First child of a tag."""
    return xml.find(f"{{*}}{tag}")


def parent_of(xml: etree._Element) -> etree._Element:
    """Parent of an element that is not the root."""
    parent = xml.getparent()
    assert parent is not None
    return parent


def line_of(xml: etree._Element) -> int | None:
    """Line in the file, from 1; None for an element that was made, not read."""
    return cast("int | None", xml.sourceline)  # the stubs have an ellipsis there


def node_of(xml: etree._Element) -> tuple[int, ...]:
    """Child indices from the root down to this element, comments counted."""
    indices = []
    parent = xml.getparent()
    while parent is not None:
        indices.append(parent.index(xml))
        xml, parent = parent, parent.getparent()
    return tuple(reversed(indices))


def at_node(root: etree._Element, node: tuple[int, ...]) -> etree._Element:
    """The element that `node_of` described, in another parse of the same bytes."""
    for index in node:
        root = root[index]
    return root


def _name(xml: etree._Element) -> str | None:
    name = xml.get("name") or xml.get("entityRef")
    return name[:60] if name else None
