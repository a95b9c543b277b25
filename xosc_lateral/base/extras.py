"""What extras offer, by the tables of `xosc_lateral/extras`; nothing where that folder is not there."""

from __future__ import annotations

from importlib import import_module

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any


def table(name: str) -> dict[str, Any]:
    """A table of the registry."""
    try:
        registry = import_module("xosc_lateral.extras")
    except ModuleNotFoundError:
        return {}
    return dict(getattr(registry, name))


def service(name: str) -> Any:
    """What a verb of the core has an extra do, loaded."""
    return getattr(import_module(f"xosc_lateral.{table('SERVICES')[name]}"), name)
