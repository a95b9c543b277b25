"""The user's configuration file, and what it says of libraries."""

from __future__ import annotations

import os
from pathlib import Path

from xosc_lateral.errors import FormatError


def configuration_file() -> Path | None:
    """Where the user's configuration is looked for; None: whoever runs this has no home (a service in a container)."""
    named = os.environ.get("APPDATA" if os.name == "nt" else "XDG_CONFIG_HOME")
    try:
        home = Path(named) if named else Path.home() / ".config"
    except RuntimeError:
        return None
    return home / "xosc-lateral" / "config.toml"


def configured_libraries() -> list[Path]:
    """Folders of profiles that the configuration names.

    Raises
    ------
    FormatError
        If it is no TOML, or says something else.
    """
    path = configuration_file()
    try:
        if path is None or not path.is_file():
            return []
    except PermissionError:  # the home is somebody else's
        return []
    import tomllib

    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FormatError(f"not TOML: {error}", path=path) from error
    unknown = sorted(values.keys() - {"library"})
    library = values.get("library", [])
    if unknown:
        raise FormatError(f"unknown key {unknown[0]!r}; there is library", path=path)
    if isinstance(library, str):
        library = [library]
    if not isinstance(library, list) or not all(isinstance(name, str) for name in library):
        raise FormatError(f"library = {library!r}: expected a list of folders", path=path)
    try:
        return [path.parent / Path(name).expanduser() for name in library]
    except RuntimeError as error:
        raise FormatError(f"library = {library!r}: there is no home that ~ could stand for", path=path) from error
