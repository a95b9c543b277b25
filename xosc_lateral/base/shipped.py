"""Where the plain files lie that come with the package: driver profiles and templates.

In a checkout they are top-level folders, where a person finds them and adds to them; in a wheel they are packed below
the package. Imports nothing of this package.
"""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]


def shipped_folder(name: str) -> Path:
    """The folder ``driver_profiles`` or ``templates``."""
    packed = _PACKAGE / "resources" / name
    return packed if packed.is_dir() else _PACKAGE.parent / name
