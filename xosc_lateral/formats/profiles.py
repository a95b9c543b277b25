"""Profile files: JSON, canonical to the byte; names looked up in the user's folders, then among those shipped."""

from __future__ import annotations

import hashlib
import json
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from xosc_lateral.driver.plausibility import check_profile
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.records import plain
from xosc_lateral.errors import DriverProfileError, FormatError
from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.source import read_source
from xosc_lateral.formats.tables import foreign_errors
from xosc_lateral.limits import JSON_DEPTH, PROFILE_SIZE
from xosc_lateral.plugins import plugins
from xosc_lateral.shipped import shipped_folder

SHIPPED = shipped_folder("driver_profiles")
"""Profiles that come with the package."""

LONGEST_NAME = 200
"""Characters of a profile's name; file systems take 255 bytes, the suffix included."""

SCHEMA = Path(__file__).resolve().parents[1] / "resources" / "driver_profile.schema.json"
"""JSON Schema of a profile file."""

SUFFIX = ".json"

_STRINGS = re.compile(r'"(?:[^"\\]|\\.)*"')
_BRACKETS = re.compile(r"[\[\]{}]")
LIBRARY_VARIABLE = "XOSC_LATERAL_LIBRARY"
"""Environment variable with folders of profiles, separated as in PATH."""

GROUP = "xosc_lateral.profiles"
"""Entry points of folders with further profiles."""


def read_profile(name_or_path: str | Path, folders: Iterable[str | Path] = ()) -> DriverProfile:
    """Read a profile by its path, or by its name in the folders or among those shipped.

    Parameters
    ----------
    name_or_path : str or Path
        ``motorway`` or ``somewhere/mine.json``.
    folders : iterable of path
        Looked through first, in this order.

    Raises
    ------
    DriverProfileError
        If no profile of that name is known; lists those that are.
    FormatError
        If the file is not there or no valid profile, or a folder isn't one.
    """
    path = find_profile(name_or_path, folders)
    values = parse_json(read_source(path, PROFILE_SIZE).data, path)
    try:
        with foreign_errors(path, "not a driver profile"):
            profile = DriverProfile.from_dict(values)
            check_profile(profile)
            return profile
    except DriverProfileError as error:
        raise FormatError(str(error), path=path) from error


def parse_json(data: bytes, path: Path) -> Any:
    """JSON of an input file.

    Raises
    ------
    FormatError
        Not UTF-8, no JSON, NaN or infinity in it, or nested deeper than `limits.JSON_DEPTH`.
    """
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"not JSON: {error}", path=path) from error
    depth = deepest = 0
    for bracket in _BRACKETS.finditer(_STRINGS.sub("", text)):
        depth += 1 if bracket[0] in "[{" else -1
        deepest = max(deepest, depth)
    if deepest > JSON_DEPTH.value:
        raise FormatError(JSON_DEPTH.refusal(deepest), path=path)
    try:
        return json.loads(text, parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise FormatError(f"not JSON: {error.msg}", path=path, line=error.lineno) from error
    except ValueError as error:
        raise FormatError(f"not JSON: {error}", path=path) from error


def write_profile(profile: DriverProfile, path: str | Path) -> None:
    """Write a profile file, whole or not at all; the same profile gives the same bytes.

    Raises
    ------
    OSError
        When it can't be written.
    """
    write_atomically(Path(path), profile_bytes(profile))


def profile_bytes(profile: DriverProfile) -> bytes:
    """The profile file's bytes."""
    return (canonical_json(profile.to_dict()) + "\n").encode("utf-8")


def profile_hash(profile: DriverProfile) -> str:
    """SHA-256 of the profile file's bytes, in hexadecimal: what outputs name their profile by."""
    return _hash_of(_Identity(profile))


@dataclass(frozen=True, eq=False, slots=True)
class _Identity:
    """A profile as a key: by identity, for it never changes and its parts can't all be hashed."""

    profile: DriverProfile

    def __hash__(self) -> int:
        return id(self.profile)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Identity) and other.profile is self.profile


@lru_cache(maxsize=32)  # a batch names the same few profiles in thousands of outputs
def _hash_of(key: _Identity) -> str:
    return hashlib.sha256(profile_bytes(key.profile)).hexdigest()


def profile_record(profile: DriverProfile) -> dict[str, Any]:
    """What was fitted, as plain values."""
    known = profile.provenance
    facts: dict[str, Any] = {"id": profile.name, "model": profile.model.kind, "sha256": profile_hash(profile)}
    if profile.sensor is not None:
        facts["sensor"] = plain(profile.sensor) | {"share": profile.sensor.share}
    return facts | {"hours": known.hours, "drives": known.drives, "runs": known.runs, "lane_width": profile.lane_width}


def describe_profile(profile: DriverProfile) -> str:
    """What was fitted, in a line; another for what of it is the sensor's."""
    known = profile.provenance
    said = (
        f"{profile.name}: {profile.model.kind} model from {known.hours:.2f} h in {known.runs} runs of {known.drives} "
        f"drives, {len(profile.effects)} effects"
    )
    return said if profile.sensor is None else f"{said}\n{profile.sensor.in_words()}"


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

    Raises
    ------
    FormatError
        If a folder isn't one.
    """
    searched = _each_once((*library_folders(folders), SHIPPED))
    found = [path for folder in searched for path in sorted(folder.glob(f"*{SUFFIX}"))]
    return found + [path for _, path in sorted(_from_plugins().items())]


def library_folders(folders: Iterable[str | Path] = ()) -> tuple[Path, ...]:
    """Folders with profiles besides those shipped: named ones, the environment's, the configuration's.

    ``XOSC_LATERAL_LIBRARY`` holds folders, separated as in PATH. The configuration is ``xosc-lateral/config.toml`` in
    ``XDG_CONFIG_HOME`` (else ``~/.config``; on Windows ``APPDATA``) with ``library = ["FOLDER", ...]``.

    Raises
    ------
    FormatError
        If one of them isn't there.
    """
    said = [Path(name) for name in os.environ.get(LIBRARY_VARIABLE, "").split(os.pathsep) if name]
    found = [*map(Path, folders), *said, *_configured()]
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


def configuration_file() -> Path | None:
    """Where the user's configuration is looked for; None: whoever runs this has no home (a service in a container)."""
    named = os.environ.get("APPDATA" if os.name == "nt" else "XDG_CONFIG_HOME")
    try:
        home = Path(named) if named else Path.home() / ".config"
    except RuntimeError:
        return None
    return home / "xosc-lateral" / "config.toml"


def _configured() -> list[Path]:
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


def _from_plugins() -> dict[str, Path]:
    """Profiles that other packages offer: entry points that are a folder, or a function that gives one."""
    found: dict[str, Path] = {}
    for offered in plugins(GROUP).values():
        folder = Path(offered() if callable(offered) else offered)
        found |= {path.stem: path for path in sorted(folder.glob(f"*{SUFFIX}"))}
    return found


def canonical_json(value: Any, indent: int = 0) -> str:
    """JSON text of plain values: keys as they come, one item a line, lists of numbers on one line.

    Raises
    ------
    ValueError
        For a number that is not finite: JSON has none.
    """
    pad = " " * (indent + 1)
    if isinstance(value, Mapping):
        items = [f"{pad}{json.dumps(str(key))}: {canonical_json(item, indent + 1)}" for key, item in value.items()]
        return "{\n" + ",\n".join(items) + "\n" + " " * indent + "}" if items else "{}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        if all(_is_scalar(item) for item in value):
            return "[" + ", ".join(canonical_json(item) for item in value) + "]"
        return "[\n" + ",\n".join(pad + canonical_json(item, indent + 1) for item in value) + "\n" + " " * indent + "]"
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{value} can't be written as JSON")
    return json.dumps(value, ensure_ascii=False)


def _is_scalar(value: Any) -> bool:
    return isinstance(value, str | int | float) or value is None


def _refuse_constant(name: str) -> float:
    raise ValueError(f"{name} is not a number in JSON")
