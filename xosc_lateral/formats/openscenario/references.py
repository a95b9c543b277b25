"""Which files a scenario may name.

A scenario comes from somewhere else; what it names is read by us. So a reference (road, catalog, scenario of a
distribution) has to stay inside the folders that the user gave: the scenario's own folder, those up to three levels
above it (field layouts are ``xosc/``, ``xodr/`` and ``xosc/Catalogs`` side by side, sometimes deeper), and folders
allowed explicitly. The file system's root is never among them, and its direct children only for a scenario one level
below. Symbolic links are followed before the check. Absolute paths are fine inside these folders, and refused outside.

A scenario that we wrote into another folder names its road and catalogs where they are; reading it there takes the
explicit permission as well. What it states about its inputs could be forged: it opens nothing.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from msgspec import Struct

from xosc_lateral.errors import FormatError
from xosc_lateral.scenario.place import Place

LEVELS_UP = 3
"""How many folders above the scenario's own may still hold what it names."""

_WINDOWS_DRIVE = re.compile(r"[A-Za-z]:[\\/]")


def allowed_roots(scenario: Path, extra: Iterable[Path] = ()) -> tuple[Path, ...]:
    """Folders that files named by this scenario may lie in, real paths.

    Raises `FormatError`: One of the further folders isn't one.
    """
    extra = list(extra)
    require_folders(extra)
    folder = Path(os.path.realpath(scenario)).parent
    beside = Path(os.path.realpath(Path(scenario).absolute().parent))
    return tuple(dict.fromkeys([_highest(folder), _highest(beside), *(Path(os.path.realpath(path)) for path in extra)]))


def require_folders(folders: Iterable[Path]) -> None:
    """Refuse what is no folder: a typing error would otherwise allow nothing without a word."""
    for folder in folders:
        if not Path(folder).is_dir():
            raise FormatError("no such folder to allow", path=folder)


def _highest(folder: Path) -> Path:
    root = folder
    for level in range(1, LEVELS_UP + 1):
        parent = root.parent
        # parts of "/tmp": ("/", "tmp"). One level up may reach such a folder, two may not; "/" is never reached.
        if len(parent.parts) < 1 + level:
            break
        root = parent
    return root


class Boundary(Struct, frozen=True):
    """Where references of one scenario may lead.

    Parameters
    ----------
    folder : Path
        The scenario's: relative references start here.
    roots : tuple of Path
        Real paths of the folders that they have to stay in.
    """

    folder: Path
    roots: tuple[Path, ...]

    def path(self, reference: str, place: Place) -> Path:
        """Path of a file or folder, wherever it is.

        Raises `FormatError`: The reference is empty or no path at all.
        """
        text = reference.strip()
        if not text or "\0" in text:
            raise FormatError("empty file reference", path=place.path, line=place.line, element=place.element)
        return Path(os.path.normpath(self.folder / text.replace("\\", "/")))

    def holds(self, path: Path) -> bool:
        """Whether a file or folder lies inside, once symbolic links are followed."""
        real = Path(os.path.realpath(path))
        return any(real == root or root in real.parents for root in self.roots)

    def refusal(self, reference: str, place: Place) -> FormatError:
        """The error for a reference that leads outside."""
        return FormatError(
            f"'{reference.strip()[:200]}' lies outside the scenario's folders; allow its folder explicitly",
            path=place.path,
            line=place.line,
            element=place.element,
        )

    def inside(self, reference: str, place: Place) -> Path:
        """Path of a file or folder that has to lie inside.

        Raises `FormatError`: It leads outside, is empty, or no path at all.
        """
        path = self.path(reference, place)
        windows = bool(_WINDOWS_DRIVE.match(reference.strip())) and os.name != "nt"
        if windows or not self.holds(path):
            raise self.refusal(reference, place)
        return path
