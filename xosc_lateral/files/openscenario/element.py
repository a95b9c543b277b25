"""One XML element with its parameters filled in: attributes as typed values, errors with file, line and element."""

from __future__ import annotations

import math
from collections.abc import Iterator
from enum import StrEnum
from pathlib import Path
from typing import Any, NoReturn, TypeVar, cast

from lxml import etree

from xosc_lateral.files.xml import line_of
from xosc_lateral.world.scenario.enums import SYNONYMS
from xosc_lateral.world.scenario.parameters import ExpressionError, Scope
from xosc_lateral.world.scenario.place import Place

V = TypeVar("V")

MAXIMUM_NUMBER = 1e15
"""Largest finite number that is taken: its square is still far from overflow, and no unit makes sense of it."""

_TRUE = {"true", "1", "1.0000000000", "yes"}
_FALSE = {"false", "0", "0.0000000000", "no"}


def means_true(text: str) -> bool:
    """Whether a word is read as true, in any case."""
    return text.strip().lower() in _TRUE


class XmlElement:
    """An element of the scenario or of a catalog, in the scope that its attributes are read in."""

    __slots__ = ("node", "path", "scope", "xml")

    def __init__(self, xml: etree._Element, path: Path, scope: Scope, node: tuple[int, ...] | None = None) -> None:
        self.xml, self.path, self.scope = xml, path, scope
        self.node = node_of(xml) if node is None else node  # child indices from the root down to it, comments counted

    # --- tree ---------------------------------------------------------------------------------------------------

    @property
    def tag(self) -> str:
        """Name without namespace."""
        return local_name(self.xml)

    def children(self, *tags: str) -> Iterator[XmlElement]:
        """Child elements, of these tags or all; comments left out."""
        for index, child in enumerate(self.xml):
            if isinstance(child.tag, str) and (not tags or local_name(child) in tags):
                # looked for among its neighbours, the last of many vertices would take as long as all of them
                yield XmlElement(child, self.path, self.scope, (*self.node, index))

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
        return XmlElement(self.xml, self.path, scope, self.node)

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

    def optional(self, name: str, kind: type[V], *, finite: bool = True) -> V | None:
        """Attribute as a text, number, whole number, truth value or option code; None where it is missing.

        ``2.0000000000`` of an expression is a whole number. Truth values and codes may be in any case, and empty, which
        is missing, too.
        """
        value: Any = self.optional_text(name)
        text = str(value or "")
        word = text.strip()
        if value is not None and kind in (int, float):
            value = self.optional_number(name, finite=finite)
            if kind is int and (value != round(value) or abs(value) > 2**53):
                self.fail(f"{name}='{text}' is not a whole number")
            value = round(value) if kind is int else value
        elif kind is not str and not word:
            value = None
        elif kind is bool:
            if word.lower() not in _TRUE | _FALSE:
                self.fail(f"{name}='{text[:60]}' is neither true nor false")
            value = means_true(word)
        elif issubclass(kind, StrEnum):
            codes = {code.lower(): code for code in kind}
            value = SYNONYMS.get(kind, {}).get(word) or codes.get(word.lower())
            if value is None:
                self.fail(f"{name}='{text[:60]}' is none of {', '.join(kind)}")
        return cast("V | None", value)

    def value(self, name: str, kind: type[V], default: V | None = None, *, finite: bool = True) -> V:
        """Attribute as `optional` has it, or the default; an error without either."""
        value = self.optional(name, kind, finite=finite)
        value = default if value is None else value
        if value is None:
            self.fail(f"attribute '{name}' is missing")
        return value

    def text(self, name: str, default: str | None = None) -> str:
        """Attribute as text."""
        return self.value(name, str, default)

    def number(self, name: str, default: float | None = None, *, finite: bool = True) -> float:
        """Attribute as a number."""
        return self.value(name, float, default, finite=finite)

    # --- place --------------------------------------------------------------------------------------------------

    def place(self) -> Place:
        """File, line, element, and the way to find it again."""
        return Place(str(self.path), line_of(self.xml), self.label(), self.node)

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
