"""Variants of one scenario as a logical scenario: one parameter chooses among them, and distributions of its value.

Whoever draws from a stochastic distribution draws every parameter by itself. So what belongs together has to hang on
one: its value is the name of a catalog, which holds all trajectories of that variant and, as trajectories to stand at
the beginning of, the places where vehicles are put. A `CatalogReference` takes a parameter as its `catalogName` in
every version of the standard, and a `TrajectoryPosition` is a position since 1.1, the first version with distributions.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lxml import etree

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.openscenario.element import local_name
from xosc_lateral.formats.openscenario.provenance import CONTENT, HEADER_MARK, mark, provenance_of
from xosc_lateral.formats.openscenario.write import build, distributions
from xosc_lateral.formats.openscenario.write.distributions import VariantFiles, variant_name
from xosc_lateral.formats.xml import read_document

VARIANT = "variant"
"""Parameter that says which variant it is; with a number where the scenario has one of that name."""
SOURCE = "source"
"""In the provenance of a set: where the scenario lies that it was made from, and the parameter of the variant."""
_FIRST_WITH_DISTRIBUTIONS = (1, 1)


@dataclass(slots=True)
class _Difference:
    """What differs between variants, collected on the way through all of them at once."""

    parameter: str
    catalogs: list[list[etree._Element]]  # trajectories of each variant
    places: int = 0
    _names: set[str] = field(default_factory=set)

    def reference(self, entries: Sequence[etree._Element]) -> etree._Element:
        """Put an entry into each variant's catalog, all of one name; a reference to the one that is chosen."""
        name = unique = str(entries[0].get("name"))
        number = 1
        while unique in self._names:
            number += 1
            unique = f"{name} ({number})"
        self._names.add(unique)
        for catalog, entry in zip(self.catalogs, entries, strict=True):
            entry.set("name", unique)
            entry.tail = None
            catalog.append(entry)
        return etree.Element("CatalogReference", {"catalogName": f"${self.parameter}", "entryName": unique})


def write_variant_set(
    variants: Sequence[Path], files: VariantFiles, source: str, *, weights: Sequence[float] | None = None
) -> None:
    """Write the logical scenario, a catalog of trajectories per variant, and the distributions.

    Parameters
    ----------
    variants : sequence of Path
        Converted scenarios, in order, with trajectories.
    files : VariantFiles
        In the variants' folder: references are taken over.
    source : str
        Where the scenario lies that they were made from, as seen from there.
    weights : sequence of float, optional
        How probable each variant is, in any unit; alike by default, since each was sampled as probable as it is.

    Raises
    ------
    FormatError
        The files are no variants of one scenario.
    """
    roots = [read_document(path).root for path in variants]
    root = copy.deepcopy(roots[0])
    header = root.find("{*}FileHeader")
    assert header is not None
    version = max((int(header.get("revMajor") or 1), int(header.get("revMinor") or 0)), _FIRST_WITH_DISTRIBUTIONS)
    header.set("revMinor", str(version[1]))
    difference = _Difference(_free_name(root), [[] for _ in roots])
    try:
        _compare(root, roots, difference)
    except _NotAlikeError as error:
        raise FormatError(f"is not a variant of the same scenario ({error})", path=variants[0]) from error
    facts = {name: value for name, value in (provenance_of(roots[0]) or {}).items() if name != CONTENT}
    seed = facts.get("options", {}).get("seed")
    facts |= {"variant": None, "variants": len(roots), SOURCE: [source, difference.parameter]}
    _unmark(root, header)
    summary = f"set of {len(roots)} variants, seed {seed}"
    names = [variant_name(k, len(roots)) for k in range(len(roots))]
    _declare(root, header, difference.parameter, names[0])
    if any(difference.catalogs):
        _locate(root, header, files, difference.parameter)
    mark(root, facts, summary)
    for name, catalog in zip(names, difference.catalogs, strict=True):
        if catalog:
            write_atomically(files.catalog(name), distributions.catalog(name, catalog, version, summary))
    write_atomically(files.logical, build.document(root))
    drawn = distributions.Drawn(difference.parameter, names, files.logical.name, version, summary)
    _write_distributions(files, drawn, weights, seed)


def _write_distributions(
    files: VariantFiles, drawn: distributions.Drawn, weights: Sequence[float] | None, seed: object
) -> None:
    """One after another, and at random."""
    write_atomically(files.distribution, drawn.one_after_another())
    runs = drawn.at_random(weights or [1.0] * len(drawn.names), seed if isinstance(seed, int) else 0)
    write_atomically(files.stochastic, runs)


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
    """Something other than a trajectory, a place or a speed to begin with differs."""


def _compare(item: etree._Element, others: Sequence[etree._Element], difference: _Difference) -> None:
    if any(other.tag != item.tag for other in others):
        raise _NotAlikeError(f"{local_name(item)} is not in all of them")
    tag = local_name(item)
    if tag == "FileHeader":
        return  # says which variant it is
    if tag in ("Trajectory", "WorldPosition") and len({etree.tostring(other, with_tail=False) for other in others}) > 1:
        _into_catalogs(item, others, difference)
        return
    if not _begins_with_a_speed(item):
        for name in sorted({str(name) for other in others for name in other.attrib}):
            if len({other.get(name) for other in others}) > 1:
                raise _NotAlikeError(f"{tag}/@{name}")
    children = [[child for child in other if isinstance(child.tag, str)] for other in others]
    own = [child for child in item if isinstance(child.tag, str)]
    if len({len(items) for items in children}) > 1:
        raise _NotAlikeError(f"what {tag} holds")
    for child, *rest in zip(own, *children, strict=True):
        _compare(child, rest, difference)


def _begins_with_a_speed(item: etree._Element) -> bool:
    """A vehicle's speed along its path at time 0 counts until its trajectory does: in the same frame."""
    return local_name(item) == "AbsoluteTargetSpeed" and any(
        local_name(above) == "Init" for above in item.iterancestors()
    )


def _into_catalogs(item: etree._Element, others: Sequence[etree._Element], difference: _Difference) -> None:
    parent = item.getparent()
    assert parent is not None
    if local_name(item) == "Trajectory":
        chosen = difference.reference([copy.deepcopy(other) for other in others])
    else:
        if not any(local_name(above) == "TeleportAction" for above in item.iterancestors()):
            raise _NotAlikeError("a WorldPosition")
        difference.places += 1
        chosen = etree.Element("TrajectoryPosition", {"s": "0", "t": "0"})
        name = f"{_owner(item)} is put here, {difference.places}"
        build.sub(chosen, "TrajectoryRef").append(difference.reference([_standing(other, name) for other in others]))
    index = parent.index(item)
    parent.remove(item)
    build.insert_indented(parent, index, chosen)


def _standing(place: etree._Element, name: str) -> etree._Element:
    """A place as the beginning of a trajectory of one metre, along the heading."""
    trajectory = etree.Element("Trajectory", {"name": name, "closed": "false"})
    line = build.sub(build.sub(trajectory, "Shape"), "Polyline")
    heading = float(place.get("h") or 0.0)
    for metres in (0.0, 1.0):
        there = copy.deepcopy(place)
        there.tail = None
        if metres:
            there.set("x", build.decimal(float(place.get("x") or 0.0) + metres * math.cos(heading), 5))
            there.set("y", build.decimal(float(place.get("y") or 0.0) + metres * math.sin(heading), 5))
        build.sub(build.sub(line, "Vertex", time=build.decimal(metres, 0)), "Position").append(there)
    return trajectory


def _owner(item: etree._Element) -> str:
    """Whom a place belongs to."""
    return next(name for above in item.iterancestors() if (name := above.get("entityRef") or above.get("name")))


def _free_name(root: etree._Element) -> str:
    """Of a parameter, that the scenario does not have."""
    declared = {str(item.get("name")) for item in root.iterfind("{*}ParameterDeclarations/{*}ParameterDeclaration")}
    name, number = VARIANT, 1
    while name in declared:
        number += 1
        name = f"{VARIANT}_{number}"
    return name


def _unmark(root: etree._Element, header: etree._Element) -> None:
    for comment in list(root.iterchildren(etree.Comment)):
        if "xosc-lateral provenance:" in (comment.text or ""):
            root.remove(comment)
    header.set("description", (header.get("description") or "").partition(HEADER_MARK)[0].rstrip())


def _declare(root: etree._Element, header: etree._Element, name: str, value: str) -> None:
    owner = next((item for item in root if local_name(item) == "ParameterDeclarations"), None)
    if owner is None:
        owner = etree.Element("ParameterDeclarations")
        build.insert_indented(root, root.index(header) + 1, owner)
    attributes = {"name": name, "parameterType": "string", "value": value}
    build.insert_indented(owner, len(owner), etree.Element("ParameterDeclaration", attributes))


def _locate(root: etree._Element, header: etree._Element, files: VariantFiles, parameter: str) -> None:
    """Say where the catalogs lie: in a folder beside the scenario, with those that others still follow."""
    locations = next((item for item in root if local_name(item) == "CatalogLocations"), None)
    if locations is None:
        locations = etree.Element("CatalogLocations")
        build.insert_indented(root, root.index(header) + 2, locations)
    needed = _still_needed(root, parameter)
    for old in [item for item in locations if local_name(item) == "TrajectoryCatalog"]:
        for name in needed:
            there = files.logical.parent / old[0].get("path", "") / f"{name}.xosc"
            if not there.is_file():
                raise FormatError(
                    f"trajectories of catalog '{name}' are needed (looked for {there})", path=files.logical
                )
            write_atomically(files.catalog(name), there.read_bytes())
        locations.remove(old)  # a scenario has one folder of trajectories
    place = etree.Element("TrajectoryCatalog")
    build.sub(place, "Directory", path=files.folder.name)
    build.insert_indented(locations, len(locations), place)


def _still_needed(root: etree._Element, parameter: str) -> list[str]:
    """Catalogs of trajectories that vehicles without offsets follow."""
    references = root.iterfind(".//{*}CatalogReference")
    found = {
        str(item.get("catalogName"))
        for item in references
        if any(local_name(above) in ("TrajectoryRef", "FollowTrajectoryAction") for above in item.iterancestors())
    }
    return sorted(found - {f"${parameter}"})
