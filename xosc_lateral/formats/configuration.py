"""The user's configuration file: libraries, vehicles under test, and whose answer to neighbours drivers have."""

from __future__ import annotations

import os
from pathlib import Path

from xosc_lateral.enrich.neighbours import Neighbours
from xosc_lateral.errors import FormatError

NEIGHBOURS = tuple(map(str, Neighbours))

KEYS = ("library", "ego", "neighbours")


def configuration_file() -> Path | None:
    """Where the user's configuration lies; None: whoever runs this has no home (a service in a container)."""
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
    path, library = _configured("library", "folders")
    if path is None or library is None:
        return []
    try:
        return [path.parent / Path(name).expanduser() for name in library]
    except RuntimeError as error:
        raise FormatError(f"library = {library!r}: there is no home that ~ could stand for", path=path) from error


def configured_egos() -> list[str] | None:
    """Vehicles under test that the configuration names; None: it names none.

    Raises
    ------
    FormatError
        If it is no TOML, or says something else.
    """
    return _configured("ego", "entities")[1]


def configured_neighbours() -> str | None:
    """Whose answer to neighbours the configuration names; None: it names none.

    Raises
    ------
    FormatError
        If it is no TOML, or says something else.
    """
    path, found = _configured("neighbours", "texts")
    if found is not None and (len(found) != 1 or found[0] not in NEIGHBOURS):
        raise FormatError(f"neighbours = {found!r}: expected one of {', '.join(NEIGHBOURS)}", path=path)
    return None if found is None else found[0]


def _configured(key: str, what: str) -> tuple[Path | None, list[str] | None]:
    """The file, and a list of texts in it; None where there is none."""
    path = configuration_file()
    try:
        if path is None or not path.is_file():
            return None, None
    except PermissionError:  # the home is somebody else's
        return None, None
    import tomllib

    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FormatError(f"not TOML: {error}", path=path) from error
    unknown = sorted(values.keys() - set(KEYS))
    if unknown:
        raise FormatError(f"unknown key {unknown[0]!r}; there are {', '.join(KEYS)}", path=path)
    if key not in values:
        return path, None
    found = values[key]
    if isinstance(found, str):
        found = [found]
    if not isinstance(found, list) or not all(isinstance(name, str) for name in found):
        raise FormatError(f"{key} = {found!r}: expected a list of {what}", path=path)
    return path, found
