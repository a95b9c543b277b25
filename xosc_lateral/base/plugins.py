"""What is found, not listed: shipped files, other packages' entry points, what modules of a package define."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import cache, lru_cache
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, TypeVar

from xosc_lateral.base.errors import XoscLateralError

EXTRAS = "xosc_lateral.extras"
"""Where our own extras are, and the entry point group of those of other packages."""

GROUPS = ("xosc_lateral.effects", "xosc_lateral.importers", "xosc_lateral.templates", "xosc_lateral.profiles", EXTRAS)
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
    """All that installed packages offer in a group, by name; loaded once. A broken one raises, traceback and all."""
    return {point.name: point.load() for point in sorted(entry_points(group=group), key=lambda point: point.name)}


@lru_cache(maxsize=len(GROUPS))
def plugin_names(group: str) -> tuple[str, ...]:
    """Names of what `plugins` would load, nothing loaded."""
    return tuple(sorted(point.name for point in entry_points(group=group)))


@cache
def offered(table: str) -> dict[str, Any]:
    """What extras offer in a table (`xosc_lateral/extras/__init__.py`): ours, then those of other packages."""
    try:
        folder = import_module(EXTRAS).__path__
    except ModuleNotFoundError:  # the core alone
        folder = []
    ours = [import_module(f"{EXTRAS}.{found.name}") for found in iter_modules(folder)]
    return {
        name: told for each in (*ours, *plugins(EXTRAS).values()) for name, told in getattr(each, table, {}).items()
    }


def service(name: str) -> Any:
    """What a verb of the core has an extra do, loaded; `XoscLateralError`: it is not here."""
    home = (offered("CALLS") | offered("SERVICES")).get(name)
    if home is None:
        raise XoscLateralError(f"what this takes ({name}) is done by an extra that is not installed here")
    return getattr(import_module(home), name)


T = TypeVar("T")


def defined_in(package: str, kind: type[T]) -> tuple[type[T], ...]:
    """Public classes of a kind that modules of a package, imported already or being so, define and that can be made.

    Ordered by the names of the modules, then as written there: the same on every machine, however folders are listed.
    """
    names = sorted(module.name for module in iter_modules(sys.modules[package].__path__))
    modules = [import_module(f"{package}.{name}") for name in names]
    members = [(member, module.__name__) for module in modules for member in vars(module).values()]
    classes = [member for member, home in members if isinstance(member, type) and member.__module__ == home]
    return tuple(each for each in classes if issubclass(each, kind) and _can_be_made(each))


def _can_be_made(cls: type) -> bool:
    """Public, and nothing of it is abstract; structs don't keep count of that, as `abc.ABC` would."""
    members = (getattr(cls, name, None) for name in dir(cls))
    return not cls.__name__.startswith("_") and not any(
        getattr(member, "__isabstractmethod__", False) for member in members
    )


# ---- plain files that ship: folders at the top of a checkout, where people add to them; in a wheel, below the package
_PACKAGE = Path(__file__).resolve().parents[1]


def shipped_folder(name: str) -> Path:
    """The folder ``driver_profiles`` or ``templates``."""
    packed = _PACKAGE / "resources" / name
    return packed if packed.is_dir() else _PACKAGE.parent / name
