"""What a package holds, one thing a file: found in its folder, so that a new file is in no list that could miss it."""

from __future__ import annotations

import sys
from importlib import import_module
from pkgutil import iter_modules
from typing import TypeVar

T = TypeVar("T")


def defined_in(package: str, kind: type[T]) -> tuple[type[T], ...]:
    """Classes of a kind that a package's modules define and that can be made.

    Ordered by the names of the modules, then as written there: the same on every machine, however folders are listed.

    Parameters
    ----------
    package : str
        Its full name; imported already, or being so.
    kind : type
        What they are subclasses of. Private ones are left out, and those that still have an abstract method.
    """
    names = sorted(module.name for module in iter_modules(sys.modules[package].__path__))
    modules = [import_module(f"{package}.{name}") for name in names]
    own = [(one, module.__name__) for module in modules for one in vars(module).values() if isinstance(one, type)]
    return tuple(one for one, home in own if one.__module__ == home and issubclass(one, kind) and _can_be_made(one))


def _can_be_made(one: type) -> bool:
    """Public, and nothing of it is abstract; structs don't keep count of that, as `abc.ABC` would."""
    members = (getattr(one, name, None) for name in dir(one))
    return not one.__name__.startswith("_") and not any(getattr(one, "__isabstractmethod__", False) for one in members)
