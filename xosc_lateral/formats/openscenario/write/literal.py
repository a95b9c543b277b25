"""Values in place of what stands for them: expressions, parameters, entries of catalogs."""

from __future__ import annotations

import copy
import os
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path

from lxml import etree

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.openscenario.declarations import entry_scope, local_scope, parameter_name
from xosc_lateral.formats.openscenario.element import XmlElement, local_name
from xosc_lateral.formats.openscenario.write.losses import Losses
from xosc_lateral.formats.xml import read_document
from xosc_lateral.scenario import Scenario
from xosc_lateral.scenario.expressions import ExpressionError
from xosc_lateral.scenario.parameters import Scope

NAMES = frozenset({"parameterRef", "variableRef", "parameterName"})
"""Attributes that name a parameter instead of standing for its value."""
_NAMED = frozenset({"Story", "Act", "ManeuverGroup", "Maneuver", "Event", "Action"})
"""Elements that conditions refer to by name."""
_DEEPEST = 20
"""Catalog entries that refer to catalog entries."""


def fill_in(losses: Losses, scope: Scope, *, parameters: bool) -> None:
    """Write values in place of expressions and, if wanted, of parameters; declarations stay.

    Raises
    ------
    FormatError
        One that has no value.
    """
    _fill(losses, losses.root, scope, parameters)


def _fill(losses: Losses, item: etree._Element, scope: Scope, parameters: bool) -> None:
    inner = scope
    if item is not losses.root:
        inner = local_scope(XmlElement(item, losses.path, scope))
    for name, value in item.attrib.items():
        text = str(value)
        if name in NAMES or not text.startswith("$") or not (parameters or text.startswith("${")):
            continue
        try:
            item.set(name, inner.fill(text))
        except ExpressionError as error:
            raise FormatError(str(error), path=losses.path, element=local_name(item)) from error
    for child in item:
        if isinstance(child.tag, str):
            _fill(losses, child, inner, parameters)


def name_literally(root: etree._Element, path: Path, scope: Scope, wanted: Collection[str]) -> None:
    """Storyboard elements and references to them by their names, if one that is wanted is named by an expression.

    Conditions elsewhere refer to such an element by its value; who looks at the file alone would find no element of
    that name.
    """
    found: list[tuple[etree._Element, str, str]] = []
    for storyboard in root.iter("{*}Storyboard"):
        _named_by_expression(storyboard, path, scope, found)
    if any(attribute == "name" and value in wanted for _, attribute, value in found):
        for item, attribute, value in found:
            item.set(attribute, value)


def _named_by_expression(
    item: etree._Element, path: Path, scope: Scope, found: list[tuple[etree._Element, str, str]]
) -> None:
    inner = local_scope(XmlElement(item, path, scope))
    for attribute in ("name", "storyboardElementRef"):
        text = item.get(attribute) or ""
        if text.startswith("$") and (attribute != "name" or local_name(item) in _NAMED):
            with suppress(ExpressionError):  # then nobody can refer to it
                found.append((item, attribute, inner.fill(text)))
    for child in item:
        if isinstance(child.tag, str):
            _named_by_expression(child, path, inner, found)


def inline_catalogs(losses: Losses, scenario: Scenario, scope: Scope) -> None:
    """Entries in place of references to catalogs, which are files of the input's version; then no catalog is named.

    Only catalogs that the reader took something from are looked at. What can't be found stays, and is noted.
    """
    missing = set()
    for _ in range(_DEEPEST):
        references = [
            (item, within)
            for item, within in in_scope(losses, losses.root, scope, "CatalogReference")
            if item not in missing
        ]
        if not references:
            break
        for item, within in references:
            if not _inline(item, within, scenario):
                missing.add(item)
                losses.note(f"CatalogReference: '{_entry_name(item)}' was not found and stays a reference")
    if not missing:
        _name_no_catalog(losses.root)


def _entry_name(reference: etree._Element) -> str:
    return f"{reference.get('catalogName')}/{reference.get('entryName')}"


def _name_no_catalog(root: etree._Element) -> None:
    for locations in root.iter("{*}CatalogLocations"):
        locations[:] = []
        locations.text = None


def inline_maneuvers(root: etree._Element, scenario: Scenario, scope: Scope, wanted: Collection[str]) -> None:
    """Maneuvers of catalogs that hold an element of a wanted name, in place of the references to them.

    Who looks at the file alone would find no element of that name.
    """
    losses = Losses(root, scenario.path, "", reactive=True)
    for item, within in list(in_scope(losses, root, scope, "CatalogReference")):
        owner = item.getparent()
        if owner is None or local_name(owner) != "ManeuverGroup":
            continue
        asking = XmlElement(item, scenario.path, within)
        found = _entry(asking.text("catalogName"), asking.text("entryName"), scenario)
        names = [] if found is None else [inner.get("name") or "" for inner in found[0].iter("{*}Event", "{*}Action")]
        if any(name in wanted or name.startswith("$") for name in names):
            _inline(item, within, scenario)


def in_scope(losses: Losses, item: etree._Element, scope: Scope, tag: str) -> Iterator[tuple[etree._Element, Scope]]:
    """Elements of one tag below another, not within each other, with the scope that each is read in."""
    inner = scope if item is losses.root else local_scope(XmlElement(item, losses.path, scope))
    for child in item:
        if isinstance(child.tag, str):
            if local_name(child) == tag:
                yield child, inner
            else:
                yield from in_scope(losses, child, inner, tag)


def _inline(reference: etree._Element, scope: Scope, scenario: Scenario) -> bool:
    asking = XmlElement(reference, scenario.path, scope)
    found = _entry(asking.text("catalogName"), asking.text("entryName"), scenario)
    if found is None:
        return False
    entry, path = found
    within = entry_scope(XmlElement(entry, path, Scope({})), asking)
    entry = copy.deepcopy(entry)
    entry.tail = reference.tail
    _fill_in(entry, within)
    _seen_from(entry, path, scenario)
    parent = reference.getparent()
    assert parent is not None
    parent.replace(reference, entry)
    return True


def _fill_in(entry: etree._Element, within: Scope) -> None:
    """Its parameters, which are declared nowhere else."""
    for item in [item for item in entry if isinstance(item.tag, str) and local_name(item) == "ParameterDeclarations"]:
        entry.remove(item)
    for item in entry.iter("{*}*"):
        for name, value in item.attrib.items():
            if str(value).startswith("$") and parameter_name(str(name)) not in NAMES:
                item.set(name, within.fill(str(value)))


def _entry(catalog: str, name: str, scenario: Scenario) -> tuple[etree._Element, Path] | None:
    for path in scenario.input_files[1:]:
        document = read_document(path)
        if scenario.input_hashes.get(path, document.sha256) != document.sha256:
            raise FormatError("changed during the conversion", path=path)
        for owner in document.root.iter("{*}Catalog"):
            if catalog in (path.stem, owner.get("name")):
                found = next((item for item in owner if isinstance(item.tag, str) and item.get("name") == name), None)
                if found is not None:
                    return found, path
    return None


def _seen_from(entry: etree._Element, path: Path, scenario: Scenario) -> None:
    """Files that an entry names, as seen from the scenario."""
    for item in entry.iter("{*}*"):
        for name in ("model3d", "filepath"):
            file = path.parent / (item.get(name) or "")
            if item.get(name) and not Path(item.get(name) or "").is_absolute() and file.is_file():
                item.set(name, Path(os.path.relpath(file, scenario.path.parent)).as_posix())
