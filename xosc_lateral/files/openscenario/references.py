"""What a scenario refers to by name: files, and which may be read; entries of catalogs; parameters, in their scopes.

A scenario comes from somewhere else; what it names (road, catalog, scenario of a distribution) is read by us. So it has
to lie in the scenario's own folder, up to three levels above it (field layouts are ``xosc/``, ``xodr/`` and
``xosc/Catalogs`` side by side, sometimes deeper), or in folders allowed explicitly, symbolic links followed. The file
system's root is never among them, and its direct children only for a scenario one level below. This holds for what we
wrote as well: what it states about its inputs could be forged, and opens nothing.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from glob import escape
from pathlib import Path

from xosc_lateral.base.errors import FormatError, MissingFileError
from xosc_lateral.base.note import Note
from xosc_lateral.files.held import exists, glob, is_file
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.xml import read_document, read_xml
from xosc_lateral.world.scenario.enums import ParameterType, Rule
from xosc_lateral.world.scenario.parameters import ExpressionError, Scope, satisfies
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.scenario import Parameter

LEVELS_UP = 3
"""How many folders above the scenario's own may still hold what it names."""

_WINDOWS_DRIVE = re.compile(r"[A-Za-z]:[\\/]")


def allowed_roots(scenario: Path, extra: Iterable[Path] = ()) -> tuple[Path, ...]:
    """Real paths of folders that files named by this scenario may lie in; `FormatError` if an extra one isn't one."""
    extra = list(extra)
    require_folders(extra)
    folder = Path(os.path.realpath(scenario)).parent
    beside = Path(os.path.realpath(Path(scenario).absolute().parent))
    allowed = [_highest_folder(folder), _highest_folder(beside), *(Path(os.path.realpath(path)) for path in extra)]
    return tuple(dict.fromkeys(allowed))


def require_folders(folders: Iterable[Path]) -> None:
    """Refuse what is no folder: a typing error would otherwise allow nothing without a word."""
    for folder in folders:
        if not exists(Path(folder)) or is_file(Path(folder)):
            raise FormatError("no such folder to allow", path=folder)


def _highest_folder(folder: Path) -> Path:
    for level in range(1, LEVELS_UP + 1):
        # parts of "/tmp": ("/", "tmp"). One level up may reach such a folder, two may not; "/" is never reached.
        if len(folder.parent.parts) < 1 + level:
            break
        folder = folder.parent
    return folder


@dataclass(frozen=True, slots=True)
class Boundary:
    """Where references of one scenario may lead."""

    folder: Path  # the scenario's: relative references start here
    roots: tuple[Path, ...]  # real paths of the folders that they have to stay in

    def path(self, reference: str, place: Place) -> Path:
        """Path of a file or folder, wherever it is; `FormatError` for a reference that is empty or no path at all."""
        text = reference.strip()
        if not text or "\0" in text:
            raise place.error("empty file reference")
        return Path(os.path.normpath(self.folder / text.replace("\\", "/")))

    def holds(self, path: Path) -> bool:
        """Whether a file or folder lies inside, once symbolic links are followed."""
        real = Path(os.path.realpath(path))
        return any(real == root or root in real.parents for root in self.roots)

    def refusal(self, reference: str, place: Place) -> FormatError:
        """The error for a reference that leads outside."""
        return place.error(
            f"'{reference.strip()[:200]}' lies outside the scenario's folders; allow its folder explicitly"
        )

    def inside(self, reference: str, place: Place) -> Path:
        """Path of a file or folder; `FormatError` for a reference that leads outside, is empty, or no path at all."""
        path = self.path(reference, place)
        windows = bool(_WINDOWS_DRIVE.match(reference.strip())) and os.name != "nt"
        if windows or not self.holds(path):
            raise self.refusal(reference, place)
        return path


MAX_FILES_SCANNED = 200
"""Catalog files looked into per folder when no file is named like the catalog."""


@dataclass(slots=True)
class Catalogs:
    """Folders of catalogs named by a scenario."""

    locations: Mapping[str, tuple[str, Place]]
    """``VehicleCatalog`` ... to the folder or file as written, and where."""
    boundary: Boundary  # where references may lead
    notes: list[Note]  # gets a line for a catalog that was not where the scenario says
    used: dict[Path, str] = field(default_factory=dict)  # files that entries were taken from so far, and their SHA-256
    _files: dict[str, Path] = field(default_factory=dict)

    def entry(self, reference: XmlElement) -> XmlElement:
        """The element that a CatalogReference names, in the scope of its parameters and the assigned values.

        Raises `FormatError`: No such entry, or a catalog folder that is there, outside the allowed ones; a
        `MissingFileError` without the catalog.
        """
        catalog, name = reference.text("catalogName"), reference.text("entryName")
        path = self._files.get(catalog) or self._files.setdefault(catalog, self._search(catalog, reference))
        document = read_document(path)
        if self.used.setdefault(path, document.sha256) != document.sha256:
            reference.fail(f"catalog {path} changed while the scenario was being read")
        entries = document.root.findall("{*}Catalog/{*}*")
        # Names of entries are plain text: no scope is needed to find them.
        element = next((XmlElement(xml, path, Scope({})) for xml in entries if xml.get("name") == name), None)
        if element is None:
            names = ", ".join(sorted(str(xml.get("name")) for xml in entries)[:8])
            reference.fail(f"catalog '{catalog}' has no entry '{name}' (it has {names})")
        return element.within(entry_scope(element, reference))

    def _search(self, catalog: str, reference: XmlElement) -> Path:
        """By file name in every location, as the reference player does; then by the name inside; then near by."""
        if not catalog or any(separator in catalog for separator in "/\\\0"):
            reference.fail(f"'{catalog[:60]}' is not a catalog name")
        refused: FormatError | None = None
        folders: list[Path] = []
        for written, place in self.locations.values():
            path = self.boundary.path(written, place)
            if path.suffix.lower() == ".xosc":
                folder, candidate = path.parent, path if path.stem == catalog else None
            else:
                folder, candidate = path, path / f"{catalog}.xosc"
            if candidate is not None and is_file(candidate) and self.boundary.holds(candidate):
                return candidate
            if self.boundary.holds(folder) or not os.access(folder, os.F_OK):
                folders.append(folder)
            else:
                refused = refused or self.boundary.refusal(written, place)
        for folder in dict.fromkeys(folders):  # a file whose catalog bears that name, whatever its own is
            for path in sorted(glob(folder, "*.xosc"))[:MAX_FILES_SCANNED]:
                with suppress(FormatError):
                    inside = read_xml(path)[0].iterfind("{*}Catalog") if self.boundary.holds(path) else ()
                    if any(xml.get("name") == catalog for xml in inside):
                        return path
        # Some field files name stale folders: then the only file of that name at most three levels below the scenario.
        patterns = (f"{levels}{escape(catalog)}.xosc" for levels in ("", "*/", "*/*/", "*/*/*/"))
        near = [path for pattern in patterns for path in glob(self.boundary.folder, pattern) if is_file(path)]
        if len(near) == 1 and self.boundary.holds(near[0]):
            self.notes.append(reference.place().note(f"catalog taken from {near[0]}"))
            return near[0]
        if refused is not None:
            raise refused
        searched = ", ".join(str(folder) for folder in dict.fromkeys(folders)) or "no folder is named"
        raise reference.place().error(f"catalog '{catalog}' not found ({searched})", MissingFileError)


# ---- declarations of parameters and variables, assignments, and the constraints on values ----
NAMES = frozenset({"parameterRef", "variableRef", "parameterName"})
"""Attributes that name a parameter instead of standing for its value."""


def parameter_name(text: str) -> str:
    """Name without the ``$`` that references in field files carry."""
    return text[1:] if text.startswith("$") else text


def declared_values(owner: XmlElement) -> dict[str, str]:
    """Names and values as written; of declarations with the same name the last counts, as in the reference player."""
    values = {}
    for declaration in owner.listed("ParameterDeclarations", "ParameterDeclaration"):
        name = parameter_name(declaration.raw("name") or "")
        if not name:
            declaration.fail("attribute 'name' is missing")
        values[name] = declaration.raw("value") or ""
    return values


def local_scope(owner: XmlElement) -> Scope:
    """Scope inside an element that may declare parameters (Story, Maneuver, inline Vehicle, Route, Trajectory ...)."""
    values = declared_values(owner)
    return Scope(values, owner.scope) if values else owner.scope


def entry_scope(entry: XmlElement, reference: XmlElement) -> Scope:
    """Scope inside a catalog entry: its declarations, overridden by what the reference assigns.

    Assigned values are read in the scope of the reference. Names that the entry does not declare are looked up there,
    too: field catalogs use the scenario's parameters.
    """
    assigned = {
        parameter_name(assignment.raw("parameterRef") or ""): final(assignment.text("value"))
        for assignment in reference.listed("ParameterAssignments", "ParameterAssignment")
    }
    return Scope({**declared_values(entry), **assigned}, reference.scope)


def final(value: str) -> str:
    """A value in which a leading ``$`` is text: nobody fills it in again."""
    return f"\\{value}" if value.startswith("$") else value


def read_declarations(
    root: XmlElement, overrides: Mapping[str, str], notes: list[Note]
) -> tuple[Scope, dict[str, Parameter]]:
    """Global scope and parameters, with overrides in place.

    Raises `FormatError`: An override of a parameter that is not declared or that violates its constraints, or a value
    that can't be evaluated. A declared value that violates the constraints beside it is only remarked: it plays.
    """
    values = declared_values(root)
    unknown = sorted(set(overrides) - set(values))
    if unknown:
        known = ", ".join(sorted(values)[:10]) or "none"
        root.fail(f"parameter '{unknown[0]}' is not declared (declared: {known})")
    scope = Scope({**values, **overrides})
    parameters = {}
    for declaration in root.listed("ParameterDeclarations", "ParameterDeclaration"):
        item = declaration.within(scope)
        name, value = parameter_name(item.raw("name") or ""), value_of(item)
        kind = item.value("parameterType", ParameterType, ParameterType.STRING)
        parameters[name] = Parameter(name, kind, value, item.place())
        broken = broken_constraint(item, value)
        if broken and name in overrides:
            item.fail(f"value '{value}' violates {broken}")
        if broken:
            notes.append(item.place().note(f"'{value}' violates {broken}"))
    return scope, parameters


def value_of(declaration: XmlElement) -> str:
    """Value of the parameter that an element declares, in its scope."""
    try:
        return declaration.scope.value(parameter_name(declaration.raw("name") or ""))
    except ExpressionError as error:
        declaration.fail(f"value: {error}")


def read_variables(root: XmlElement) -> dict[str, Parameter]:
    """Variable declarations (1.2)."""
    variables = {}
    for declaration in root.listed("VariableDeclarations", "VariableDeclaration"):
        name, value = parameter_name(declaration.text("name")), declaration.text("value", "")
        kind = declaration.value("variableType", ParameterType, ParameterType.STRING)
        variables[name] = Parameter(name, kind, value, declaration.place())
    return variables


def broken_constraint(declaration: XmlElement, value: str) -> str | None:
    """Words for the constraints that a value violates; None if it satisfies one of the groups, or there is none."""
    groups = []
    for group in declaration.children("ConstraintGroup"):
        constraints = [(item.value("rule", Rule), item.text("value")) for item in group.children("ValueConstraint")]
        if all(satisfies(value, rule, limit) for rule, limit in constraints):
            return None
        groups.append(" and ".join(f"{rule} {limit}" for rule, limit in constraints))
    return " or ".join(groups) or None
