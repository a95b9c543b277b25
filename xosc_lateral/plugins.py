"""What other packages add through entry points. Imports nothing of this package, so that every layer can ask."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

GROUPS = ("xosc_lateral.effects", "xosc_lateral.importers", "xosc_lateral.templates", "xosc_lateral.profiles")
"""Entry point groups that are looked at."""


@lru_cache(maxsize=len(GROUPS))
def plugins(group: str) -> dict[str, Any]:
    """Everything that installed packages offer in a group, by its name; loaded once.

    Raises
    ------
    Exception
        Whatever the import of a broken plug-in raises: it is that package's bug, and its traceback names it.
    """
    from importlib.metadata import entry_points

    return {point.name: point.load() for point in sorted(entry_points(group=group), key=lambda one: one.name)}


@lru_cache(maxsize=len(GROUPS))
def plugin_names(group: str) -> tuple[str, ...]:
    """Names of what `plugins` would load, nothing loaded."""
    from importlib.metadata import entry_points

    return tuple(sorted(point.name for point in entry_points(group=group)))
