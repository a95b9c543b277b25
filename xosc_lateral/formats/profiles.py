"""Profile files: JSON, canonical to the byte; names looked up in the user's folders, then among those shipped."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.errors import DriverProfileError, FormatError
from xosc_lateral.formats.atomic import write_atomically

SHIPPED = Path(__file__).resolve().parents[1] / "resources" / "driver_profiles"
"""Profiles that come with the package."""

SCHEMA = SHIPPED.parent / "driver_profile.schema.json"
"""JSON Schema of a profile file."""

SUFFIX = ".json"

MAX_BYTES = 50_000_000
"""A file larger than this is no profile. [byte]"""


def read_profile(name_or_path: str | Path, folders: Iterable[str | Path] = ()) -> DriverProfile:
    """Read a profile by its path, or by its name in the folders or among those shipped.

    Parameters
    ----------
    name_or_path : str or Path
        ``motorway-car`` or ``somewhere/mine.json``.
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
    size = path.stat().st_size
    if size > MAX_BYTES:
        raise FormatError(f"{size} bytes, a profile has at most {MAX_BYTES}", path=path)
    try:
        values = json.loads(path.read_bytes().decode("utf-8-sig"), parse_constant=_refuse_constant)
    except json.JSONDecodeError as error:
        raise FormatError(f"not JSON: {error.msg}", path=path, line=error.lineno) from error
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        raise FormatError(f"not JSON: {error}", path=path) from error
    try:
        return DriverProfile.from_dict(values)
    except DriverProfileError as error:
        raise FormatError(str(error), path=path) from error


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


def describe_profile(profile: DriverProfile, *, as_json: bool = False) -> str:
    """What was fitted, in a line, or as one line of JSON."""
    known = profile.provenance
    if as_json:
        facts: dict[str, Any] = {"name": profile.name, "model": profile.model.kind, "sha256": profile_hash(profile)}
        facts |= {"hours": known.hours, "drives": known.drives, "runs": known.runs, "lane_width": profile.lane_width}
        return json.dumps(facts)
    return (
        f"{profile.name}: {profile.model.kind} model from {known.hours:.2f} h in {known.runs} runs of {known.drives} "
        f"drives, {len(profile.effects)} effects"
    )


def find_profile(name_or_path: str | Path, folders: Iterable[str | Path] = ()) -> Path:
    """Path of a profile; see `read_profile`."""
    text = str(name_or_path)
    path = Path(name_or_path)
    if isinstance(name_or_path, Path) or text.endswith(SUFFIX) or path.name != text:
        if not path.exists() or path.is_dir():
            raise FormatError("is a folder, not a profile" if path.is_dir() else "no such file", path=path)
        return path
    for folder in (*map(Path, folders), SHIPPED):
        if not folder.is_dir():
            raise FormatError("no such folder", path=folder)
        found = folder / f"{text}{SUFFIX}"
        if found.is_file():
            return found
    known = sorted(path.stem for path in list_profiles(folders))
    raise DriverProfileError(f"no profile {text!r}; known are {', '.join(known) or 'none'}, or give the path of a file")


def list_profiles(folders: Iterable[str | Path] = ()) -> list[Path]:
    """Profile files in the folders and among those shipped, in this order, by name within each.

    Raises
    ------
    FormatError
        If a folder isn't one.
    """
    found: list[Path] = []
    for folder in map(Path, folders):
        if not folder.is_dir():
            raise FormatError("no such folder", path=folder)
        found += sorted(folder.glob(f"*{SUFFIX}"))
    return found + sorted(SHIPPED.glob(f"*{SUFFIX}"))


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
    raise ValueError(f"{name} is no number of JSON")
