"""The user's configuration file: libraries, vehicles under test, and whose answer to neighbours drivers have."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.source import read_toml

SETTINGS = frozenset({"ego", "lane_changes", "neighbours"})  # of a conversion, that may stand there
KEYS = ("library", *sorted(SETTINGS))


def configuration_file() -> Path | None:
    """Where the user's configuration lies; None: whoever runs this has no home (a service in a container)."""
    named = os.environ.get("APPDATA" if os.name == "nt" else "XDG_CONFIG_HOME")
    try:
        home = Path(named) if named else Path.home() / ".config"
    except RuntimeError:
        return None
    return home / "xosc-lateral" / "config.toml"


def configuration() -> tuple[Path | None, Mapping[str, list[str]]]:
    """The file, None where there is none, and what it says, each key's value as a list. Raises `FormatError`."""
    path = configuration_file()
    try:
        if path is None or not path.is_file():
            return None, {}
    except PermissionError:  # the home is somebody else's
        return None, {}
    state = path.stat()
    return path, _read(path, state.st_mtime_ns, state.st_size, state.st_ino)


def configured_libraries() -> list[Path]:
    """Folders of profiles that the configuration names. Raises `FormatError`: see `configuration`."""
    path, settings = configuration()
    library = settings.get("library", [])
    try:
        folders = [path.parent / Path(name).expanduser() for name in library] if path is not None else []
    except RuntimeError as error:
        raise FormatError(f"library = {library!r}: there is no home that ~ could stand for", path=path) from error
    for folder in folders:
        if not folder.is_dir():
            raise FormatError(f"library: no such folder {str(folder)!r}", path=path)
    return folders


@lru_cache(maxsize=8)
def _read(path: Path, *_state: int) -> Mapping[str, list[str]]:
    settings = {}
    for key, value in read_toml(path, "not TOML").items():
        if key not in KEYS:
            raise FormatError(f"unknown key {key!r}; there are {', '.join(KEYS)}", path=path)
        settings[key] = [value] if isinstance(value, str) else value
        if not isinstance(settings[key], list) or not all(isinstance(name, str) for name in settings[key]):
            raise FormatError(f"{key} = {value!r}: expected a list of texts", path=path)
    return settings
