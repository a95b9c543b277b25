"""Which files a scenario may name.

A scenario comes from somewhere else; what it names is read by us. So a reference (road, catalog, scenario of a
distribution) has to stay inside the folders that the user gave: the scenario's own folder, its parent and grandparent
(field layouts are ``xosc/``, ``xodr/`` and ``xosc/Catalogs`` side by side, sometimes one level deeper), and folders
allowed explicitly. The file system's root and its direct children are never reached by going up twice. Symbolic links
are followed before the check. Absolute paths are fine inside these folders, and refused outside.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path

from xosc_lateral.errors import FormatError
from xosc_lateral.scenario.place import Place

LEVELS_UP = 2
"""How many folders above the scenario's own may still hold what it names."""

_WINDOWS_DRIVE = re.compile(r"[A-Za-z]:[\\/]")


def allowed_roots(scenario: Path, extra: Iterable[Path] = ()) -> tuple[Path, ...]:
    """Folders that files named by this scenario may lie in, real paths."""
    folder = Path(os.path.realpath(scenario)).parent
    beside = Path(os.path.realpath(Path(scenario).absolute().parent))
    return tuple(dict.fromkeys([_highest(folder), _highest(beside), *(Path(os.path.realpath(path)) for path in extra)]))


def _highest(folder: Path) -> Path:
    root = folder
    for level in range(1, LEVELS_UP + 1):
        parent = root.parent
        # parts of "/tmp": ("/", "tmp"). One level up may reach such a folder, two may not; "/" is never reached.
        if len(parent.parts) < 1 + level:
            break
        root = parent
    return root


def resolve_reference(reference: str, folder: Path, roots: Iterable[Path], place: Place) -> Path:
    """Path of a file or folder that a scenario names, relative to the scenario's folder.

    Raises
    ------
    FormatError
        The reference is empty, no path at all, or leads outside of `roots`.
    """
    text = reference.strip()
    if not text or "\0" in text:
        raise FormatError("empty file reference", path=place.path, line=place.line, element=place.element)
    outside = bool(_WINDOWS_DRIVE.match(text)) and os.name != "nt"
    path = Path(os.path.normpath(folder / text.replace("\\", "/")))
    if not outside:
        real = Path(os.path.realpath(path))
        outside = not any(real == root or root in real.parents for root in roots)
    if outside:
        raise FormatError(
            f"'{text}' lies outside the scenario's folders; allow its folder explicitly or use a relative path inside",
            path=place.path,
            line=place.line,
            element=place.element,
        )
    return path
