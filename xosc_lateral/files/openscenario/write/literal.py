"""Values in place of what stands for them: expressions, parameters, entries of catalogs."""

from __future__ import annotations

import copy
import os
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path

from lxml import etree

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.held import is_file
from xosc_lateral.files.openscenario.element import XmlElement, children_of, elements, local_name, parent_of
from xosc_lateral.files.openscenario.references import NAMES, entry_scope, local_scope
from xosc_lateral.files.openscenario.write.draft import Draft, Losses, unchanged
from xosc_lateral.world.scenario.parameters import ExpressionError, Scope
from xosc_lateral.world.scenario.scenario import Scenario

_REFERENCED_ELEMENTS = frozenset({"Story", "Act", "ManeuverGroup", "Maneuver", "Event", "Action"})
"""Elements that conditions refer to by name."""
_MAXIMUM_CATALOG_DEPTH = 20
"""Catalog entries that refer to catalog entries."""


def in_scope(item: etree._Element, path: Path, scope: Scope) -> Iterator[tuple[etree._Element, Scope]]:
    """An element and all below it, each with the scope that it is read in; the first with the given one."""
    yield item, scope
    for child in children_of(item):
        yield from in_scope(child, path, local_scope(XmlElement(child, path, scope)))


def fill_in(losses: Losses, scope: Scope, *, parameters: bool) -> None:
    """Values in place of expressions and, if wanted, of parameters; `FormatError` for one that has no value."""
    for item, within in in_scope(losses.root, losses.path, scope):
        for name, value in item.attrib.items():
            text = str(value)
            if name not in NAMES and text.startswith("$" if parameters else "${"):
                try:
                    item.set(name, within.fill(text))
                except ExpressionError as error:
                    raise FormatError(str(error), path=losses.path, element=local_name(item)) from error


def name_literally(root: etree._Element, path: Path, scope: Scope, wanted: Collection[str]) -> None:
    """Storyboard elements and references to them by their names, if a wanted one is named by an expression."""
    attributes: list[tuple[etree._Element, str, str]] = []
    for storyboard in elements(root, "Storyboard"):
        for item, within in in_scope(storyboard, path, scope):
            for attribute in ("name", "storyboardElementRef"):
                text = item.get(attribute) or ""
                if text.startswith("$") and (attribute != "name" or local_name(item) in _REFERENCED_ELEMENTS):
                    with suppress(ExpressionError):  # then nobody can refer to it
                        attributes.append((item, attribute, within.fill(text)))
    if any(attribute == "name" and value in wanted for _, attribute, value in attributes):
        for item, attribute, value in attributes:
            item.set(attribute, value)


def inline_catalogs(losses: Losses, draft: Draft) -> None:
    """Entries in place of references to catalogs, of the input's version; what is not found stays, and is noted."""
    missing = set()
    for _ in range(_MAXIMUM_CATALOG_DEPTH):
        references = [reference for reference in _references(draft) if reference.xml not in missing]
        if not references:
            break
        for reference in references:
            entry = _entry(reference, draft.scenario)
            if entry is None:
                missing.add(reference.xml)
                name = f"{reference.raw('catalogName')}/{reference.raw('entryName')}"
                losses.note(f"CatalogReference: '{name}' was not found and stays a reference")
            else:
                _inline(reference, *entry, draft.scenario)
    if not missing:
        for locations in elements(draft.root, "CatalogLocations"):
            locations[:] = []
            locations.text = None


def inline_maneuvers(draft: Draft, wanted: Collection[str]) -> None:
    """Catalog maneuvers that hold an element of a wanted name, in place of their references: who looks finds it."""
    for reference in _references(draft):
        if local_name(parent_of(reference.xml)) != "ManeuverGroup":
            continue
        entry = _entry(reference, draft.scenario)
        names = [] if entry is None else [item.get("name") or "" for item in elements(entry[0], "Event", "Action")]
        if entry is not None and any(name in wanted or name.startswith("$") for name in names):
            _inline(reference, *entry, draft.scenario)


def _references(draft: Draft) -> list[XmlElement]:
    path, places = draft.scenario.path, in_scope(draft.root, draft.scenario.path, draft.scope)
    return [XmlElement(item, path, within) for item, within in places if local_name(item) == "CatalogReference"]


def _entry(reference: XmlElement, scenario: Scenario) -> tuple[etree._Element, Path] | None:
    """What a reference names, and its file."""
    catalog, name = reference.text("catalogName"), reference.text("entryName")
    for path in scenario.input_files[1:]:
        for owner in elements(unchanged(path, scenario), "Catalog"):
            if catalog in (path.stem, owner.get("name")):
                match = next((item for item in children_of(owner) if item.get("name") == name), None)
                if match is not None:
                    return match, path
    return None


def _inline(reference: XmlElement, entry: etree._Element, path: Path, scenario: Scenario) -> None:
    """A copy of an entry with its parameters filled in, which are declared nowhere else."""
    within = entry_scope(XmlElement(entry, path, Scope({})), reference)
    entry = copy.deepcopy(entry)
    entry.tail = reference.xml.tail
    for declarations in entry.findall("{*}ParameterDeclarations"):
        entry.remove(declarations)
    for item in elements(entry):
        for name, value in item.attrib.items():
            if str(value).startswith("$") and name not in NAMES:
                item.set(name, within.fill(str(value)))
        for name in ("model3d", "filepath"):
            # As seen from the scenario.
            file = path.parent / (item.get(name) or "")
            if item.get(name) and not Path(item.get(name) or "").is_absolute() and is_file(file):
                item.set(name, Path(os.path.relpath(file, scenario.path.parent)).as_posix())
    parent_of(reference.xml).replace(reference.xml, entry)
