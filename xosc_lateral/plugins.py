"""What other packages add through entry points. Imports nothing of this package, so that every layer can ask."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

GROUPS = ("xosc_lateral.effects", "xosc_lateral.importers", "xosc_lateral.templates", "xosc_lateral.profiles")
"""Entry point groups that are looked at."""


def entry_points(group: str) -> Iterable[Any]:
    """Entry points of a group; `importlib.metadata`, which takes 40 ms to load and search, only where there are any."""
    if not _any_offered(tuple(sys.path)):
        return ()
    from importlib import metadata

    return metadata.entry_points(group=group)


@lru_cache(maxsize=1)
def _any_offered(folders: tuple[str, ...]) -> bool:
    """Whether an installed package may offer something in any group of ours; one in an archive may."""
    for folder in map(Path, folders):
        if folder.is_file() or any(
            b"[xosc_lateral." in path.read_bytes() for path in folder.glob("*-info/entry_points.txt")
        ):
            return True
    return False


@lru_cache(maxsize=len(GROUPS))
def plugins(group: str) -> dict[str, Any]:
    """Everything that installed packages offer in a group, by its name; loaded once.

    Raises
    ------
    Exception
        Whatever the import of a broken plug-in raises: it is that package's bug, and its traceback names it.
    """
    return {point.name: point.load() for point in sorted(entry_points(group=group), key=lambda one: one.name)}


@lru_cache(maxsize=len(GROUPS))
def plugin_names(group: str) -> tuple[str, ...]:
    """Names of what `plugins` would load, nothing loaded."""
    return tuple(sorted(point.name for point in entry_points(group=group)))
