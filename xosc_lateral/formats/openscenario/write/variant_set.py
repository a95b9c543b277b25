"""Variants of one scenario as a logical scenario: one file in which parameters choose, and a distribution of them.

What differs between converted variants is taken out: trajectories become entries of a catalog, numbers (where a car
starts) become parameters. Any tool that reads parameter value distributions can then draw a variant and play it.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lxml import etree

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.provenance import HEADER_MARK, mark, provenance_of
from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.xml import read_document

VARIANT = "variant"
"""Parameter that says which variant it is, from 1; with a number where the scenario has one of that name."""
SOURCE = "source"
"""In the provenance of a set: where the scenario lies that it was made from, and the parameter of the variant."""
_POSE = frozenset("xyzhpr")
_FIRST_WITH_DISTRIBUTIONS = (1, 1)


@dataclass(frozen=True, slots=True)
class VariantFiles:
    """Names of the files of a set."""

    logical: Path
    catalog: Path
    distribution: Path

    @classmethod
    def beside(cls, output: Path) -> VariantFiles:
        """For variants that are called like an output, with numbers."""
        names = (f"{output.stem}_{part}.xosc" for part in ("set", "trajectories", "distribution"))
        return cls(*(output.with_name(name) for name in names))

    def __iter__(self) -> Any:
        """One after another."""
        return iter((self.logical, self.catalog, self.distribution))


@dataclass(slots=True)
class _Difference:
    """What differs between variants, collected on the way through all of them at once."""

    catalog_name: str
    taken: set[str] = field(default_factory=set)  # names of the scenario's own parameters
    entries: list[etree._Element] = field(default_factory=list)
    values: dict[str, tuple[str, list[str]]] = field(default_factory=dict)  # name -> type, a value per variant

    def parameter(self, name: str, kind: str, values: list[str]) -> str:
        """Declare one, under a name that is free."""
        name = re.sub(r"\W", "_", name, flags=re.ASCII)
        name = f"_{name}" if name[:1].isdigit() else name
        unique, number = name, 1
        while unique in self.values or unique in self.taken:
            number += 1
            unique = f"{name}_{number}"
        self.values[unique] = kind, values
        return f"${unique}"


def write_variant_set(variants: Sequence[Path], files: VariantFiles, source: str) -> None:
    """Write the logical scenario, its catalog of trajectories and the distribution.

    Parameters
    ----------
    variants : sequence of Path
        Converted scenarios, in order, with trajectories.
    files : VariantFiles
        In the variants' folder: references are taken over.
    source : str
        Where the scenario lies that they were made from, as seen from there.

    Raises
    ------
    FormatError
        The files are no variants of one scenario.
    """
    roots = [read_document(path).root for path in variants]
    root = copy.deepcopy(roots[0])
    header = root.find("{*}FileHeader")
    assert header is not None
    version = int(header.get("revMajor") or 1), int(header.get("revMinor") or 0)
    whole = "integer" if version < (1, 2) else "int"
    declared = (item for item in root.iterfind("{*}ParameterDeclarations/{*}ParameterDeclaration"))
    difference = _Difference(files.catalog.stem, {str(item.get("name")) for item in declared})
    number = difference.parameter(VARIANT, whole, [str(k + 1) for k in range(len(roots))]).removeprefix("$")
    try:
        _compare(root, roots, difference)
    except _NotAlikeError as error:
        raise FormatError(f"is not a variant of the same scenario ({error})", path=variants[0]) from error
    facts = dict(provenance_of(roots[0]) or {})
    facts |= {"variant": None, "variants": len(roots), SOURCE: [source, number]}
    _unmark(root, header)
    summary = f"set of {len(roots)} variants, seed {facts.get('seed')}"
    _declare(root, header, difference)
    if difference.entries:
        _locate(root, header, files.logical)
    mark(root, facts, summary)
    write_atomically(files.catalog, _catalog(difference, version, summary))
    write_atomically(files.logical, build.document(root))
    write_atomically(files.distribution, _distribution(difference, files.logical.name, version, summary))


def source_of_set(path: Path) -> tuple[str, str] | None:
    """Where the scenario lies that a set was made from, and the parameter that says which variant it is.

    As the set's provenance has it; None for any other file.
    """
    facts = provenance_of(read_document(path).root)
    match None if facts is None else facts.get(SOURCE):
        case [str(source), str(parameter)]:
            return source, parameter
    return None


class _NotAlikeError(Exception):
    """Something other than a trajectory or a value differs."""


def _compare(item: etree._Element, others: Sequence[etree._Element], difference: _Difference) -> None:
    if any(other.tag != item.tag for other in others):
        raise _NotAlikeError(f"{local_name(item)} is not in all of them")
    if local_name(item) == "FileHeader":
        return  # says which variant it is
    if local_name(item) == "Trajectory":
        _into_catalog(item, others, difference)
        return
    for name in sorted({str(name) for other in others for name in other.attrib}):
        values = [other.get(name) for other in others]
        if len(set(values)) > 1:
            if not all(values):
                raise _NotAlikeError(f"{local_name(item)}/@{name}")
            what = name if name in _POSE else local_name(item)
            item.set(name, difference.parameter(f"{_owner(item)}_{what}", "double", [str(value) for value in values]))
    children = [[child for child in other if isinstance(child.tag, str)] for other in others]
    own = [child for child in item if isinstance(child.tag, str)]
    if len({len(items) for items in children}) > 1:
        raise _NotAlikeError(f"what {local_name(item)} holds")
    for child, *rest in zip(own, *children, strict=True):
        _compare(child, rest, difference)


def _into_catalog(item: etree._Element, others: Sequence[etree._Element], difference: _Difference) -> None:
    texts = {etree.tostring(other, with_tail=False) for other in others}
    parent = item.getparent()
    if len(texts) == 1 or parent is None:
        return
    digits = len(str(len(others)))
    names = [f"{item.get('name')}, variant {k + 1:0{digits}d}" for k in range(len(others))]
    for name, other in zip(names, others, strict=True):
        entry = copy.deepcopy(other)
        entry.set("name", name)
        entry.tail = None
        difference.entries.append(entry)
    chosen = difference.parameter(str(item.get("name")), "string", names)
    reference = etree.Element("CatalogReference", {"catalogName": difference.catalog_name, "entryName": chosen})
    reference.tail = item.tail
    parent.replace(item, reference)


def _owner(item: etree._Element) -> str:
    """Whom or what a value belongs to, for its parameter's name."""
    for above in item.iterancestors():
        name = above.get("entityRef") or (above.get("name") if local_name(above) in ("Event", "Act") else None)
        if name:
            return name
    return local_name(item)


def _unmark(root: etree._Element, header: etree._Element) -> None:
    for comment in list(root.iterchildren(etree.Comment)):
        if "xosc-lateral provenance:" in (comment.text or ""):
            root.remove(comment)
    header.set("description", (header.get("description") or "").partition(HEADER_MARK)[0].rstrip())


def _declare(root: etree._Element, header: etree._Element, difference: _Difference) -> None:
    owner = next((item for item in root if local_name(item) == "ParameterDeclarations"), None)
    if owner is None:
        owner = etree.Element("ParameterDeclarations")
        build.insert_indented(root, root.index(header) + 1, owner)
    for name, (kind, values) in difference.values.items():
        attributes = {"name": name, "parameterType": kind, "value": values[0]}
        build.insert_indented(owner, len(owner), etree.Element("ParameterDeclaration", attributes))


def _locate(root: etree._Element, header: etree._Element, logical: Path) -> None:
    """Say where the catalog lies: beside the scenario."""
    locations = next((item for item in root if local_name(item) == "CatalogLocations"), None)
    if locations is None:
        locations = etree.Element("CatalogLocations")
        build.insert_indented(root, root.index(header) + 2, locations)
    for old in [item for item in locations if local_name(item) == "TrajectoryCatalog"]:
        locations.remove(old)  # of trajectories that were played out
    place = etree.Element("TrajectoryCatalog")
    build.sub(place, "Directory", path=".")
    build.insert_indented(locations, len(locations), place)


def _catalog(difference: _Difference, version: build.Version, summary: str) -> bytes:
    root = _file(version, "trajectories", summary)
    catalog = build.sub(root, "Catalog", name=difference.catalog_name)
    catalog.extend(difference.entries)
    etree.indent(root)
    return build.document(root)


def _distribution(difference: _Difference, logical: str, version: build.Version, summary: str) -> bytes:
    root = _file(max(version, _FIRST_WITH_DISTRIBUTIONS), "distribution", summary)
    owner = build.sub(root, "ParameterValueDistribution")
    build.sub(owner, "ScenarioFile", filepath=logical)
    several = build.sub(build.sub(owner, "Deterministic"), "DeterministicMultiParameterDistribution")
    sets = build.sub(several, "ValueSetDistribution")
    for k in range(len(next(iter(difference.values.values()))[1])):
        one = build.sub(sets, "ParameterValueSet")
        for name, (_, values) in difference.values.items():
            build.sub(one, "ParameterAssignment", parameterRef=name, value=values[k])
    etree.indent(root)
    return build.document(root)


def _file(version: build.Version, what: str, summary: str) -> etree._Element:
    root = etree.Element("OpenSCENARIO")
    facts: Mapping[str, str] = {"revMajor": str(version[0]), "revMinor": str(version[1])}
    description = f"{what} {HEADER_MARK}{summary}]"
    build.sub(root, "FileHeader", **facts, date="1970-01-01T00:00:00", description=description, author="xosc-lateral")
    return root
