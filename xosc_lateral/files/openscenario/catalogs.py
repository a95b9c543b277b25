"""Files that a scenario names: which may be read, and catalogs, an entry by name in the scope of its own parameters.

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
from xosc_lateral.files.openscenario.declarations import entry_scope
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.files.xml import read_document, read_xml
from xosc_lateral.world.scenario.parameters import Scope
from xosc_lateral.world.scenario.place import Place, Unsupported

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
        if not Path(folder).is_dir():
            raise FormatError("no such folder to allow", path=folder)


def _highest_folder(folder: Path) -> Path:
    root = folder
    for level in range(1, LEVELS_UP + 1):
        parent = root.parent
        # parts of "/tmp": ("/", "tmp"). One level up may reach such a folder, two may not; "/" is never reached.
        if len(parent.parts) < 1 + level:
            break
        root = parent
    return root


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
    remarks: list[Unsupported]  # gets a line for a catalog that was not where the scenario says
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
            if candidate is not None and candidate.is_file() and self.boundary.holds(candidate):
                return candidate
            if self.boundary.holds(folder) or not os.access(folder, os.F_OK):
                folders.append(folder)
            else:
                refused = refused or self.boundary.refusal(written, place)
        for folder in dict.fromkeys(folders):  # a file whose catalog bears that name, whatever its own is
            for path in sorted(folder.glob("*.xosc"))[:MAX_FILES_SCANNED]:
                with suppress(FormatError):
                    inside = read_xml(path)[0].iterfind("{*}Catalog") if self.boundary.holds(path) else ()
                    if any(xml.get("name") == catalog for xml in inside):
                        return path
        # Some field files name stale folders: then the only file of that name at most three levels below the scenario.
        patterns = (f"{levels}{escape(catalog)}.xosc" for levels in ("", "*/", "*/*/", "*/*/*/"))
        near = [path for pattern in patterns for path in self.boundary.folder.glob(pattern) if path.is_file()]
        if len(near) == 1 and self.boundary.holds(near[0]):
            self.remarks.append(Unsupported("CatalogReference", reference.place(), f"catalog taken from {near[0]}"))
            return near[0]
        if refused is not None:
            raise refused
        searched = ", ".join(str(folder) for folder in dict.fromkeys(folders)) or "no folder is named"
        raise reference.place().error(f"catalog '{catalog}' not found ({searched})", MissingFileError)
