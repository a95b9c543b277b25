"""Where profiles are looked up by name: the user's folders, those shipped, those of plug-ins."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from xosc_lateral.errors import DriverProfileError, FormatError
from xosc_lateral.formats.configuration import configured_libraries
from xosc_lateral.plugins import plugins
from xosc_lateral.shipped import shipped_folder

SHIPPED = shipped_folder("driver_profiles")
"""Profiles that come with the package."""

LONGEST_NAME = 200
"""Characters of a profile's name; file systems take 255 bytes, the suffix included."""

SUFFIX = ".json"

LIBRARY_VARIABLE = "XOSC_LATERAL_LIBRARY"
"""Environment variable with folders of profiles, separated as in PATH."""

GROUP = "xosc_lateral.profiles"
"""Entry points of folders with further profiles."""


def find_profile(name_or_path: str | Path, folders: Iterable[str | Path] = ()) -> Path:
    """Path of a profile; see `read_profile`."""
    text = str(name_or_path)
    path = Path(name_or_path)
    if isinstance(name_or_path, Path) or text.endswith(SUFFIX) or path.name != text:
        if not path.exists() or path.is_dir():
            raise FormatError("is a folder, not a profile" if path.is_dir() else "no such file", path=path)
        return path
    if len(text) > LONGEST_NAME:
        raise DriverProfileError(f"{text[:20]!r}...: no profile has a name of {len(text)} characters")
    for folder in (*library_folders(folders), SHIPPED):
        found = folder / f"{text}{SUFFIX}"
        if found.is_file():
            return found
    if (offered := _from_plugins().get(text)) is not None:
        return offered
    known = sorted({path.stem for path in list_profiles(folders)})
    raise DriverProfileError(f"no profile {text!r}; known are {', '.join(known) or 'none'}, or give the path of a file")


def list_profiles(folders: Iterable[str | Path] = ()) -> list[Path]:
    """Profile files in the folders (see `library_folders`), among those shipped and of plug-ins, by name within each.

    Raises `FormatError` if a folder isn't one.
    """
    searched = _each_once((*library_folders(folders), SHIPPED))
    found = [path for folder in searched for path in sorted(folder.glob(f"*{SUFFIX}"))]
    return found + [path for _, path in sorted(_from_plugins().items())]


def library_folders(folders: Iterable[str | Path] = ()) -> tuple[Path, ...]:
    """Folders with profiles besides those shipped: named ones, the environment's, the configuration's.

    ``XOSC_LATERAL_LIBRARY`` holds folders, separated as in PATH. The configuration is ``xosc-lateral/config.toml`` in
    ``XDG_CONFIG_HOME`` (else ``~/.config``; on Windows ``APPDATA``) with ``library = ["FOLDER", ...]``.

    Raises `FormatError` if one of them isn't there.
    """
    from_environment = [Path(name) for name in os.environ.get(LIBRARY_VARIABLE, "").split(os.pathsep) if name]
    found = [*map(Path, folders), *from_environment, *configured_libraries()]
    for folder in found:
        if not folder.is_dir():
            raise FormatError("no such folder", path=folder)
    return _each_once(found)


def _each_once(folders: Iterable[Path]) -> tuple[Path, ...]:
    """A folder that is named twice, however it is spelled, counts where it comes first."""
    found: dict[Path, Path] = {}
    for folder in folders:
        found.setdefault(folder.resolve(), folder)
    return tuple(found.values())


def _from_plugins() -> dict[str, Path]:
    """Profiles that other packages offer: entry points that are a folder, or a function that gives one."""
    found: dict[str, Path] = {}
    for offered in plugins(GROUP).values():
        folder = Path(offered() if callable(offered) else offered)
        found |= {path.stem: path for path in sorted(folder.glob(f"*{SUFFIX}"))}
    return found
