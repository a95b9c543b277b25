"""Profile files: JSON, canonical to the byte."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from typing import Any

from msgspec import Struct

from xosc_lateral.driver.plausibility import check_profile
from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.records import plain
from xosc_lateral.errors import DriverProfileError, FormatError
from xosc_lateral.formats.atomic import write_atomically
from xosc_lateral.formats.json_text import canonical_json, parse_json
from xosc_lateral.formats.profile_folders import find_profile
from xosc_lateral.formats.source import read_source
from xosc_lateral.formats.tables import foreign_errors
from xosc_lateral.limits import PROFILE_SIZE

SCHEMA = Path(__file__).resolve().parents[1] / "resources" / "driver_profile.schema.json"
"""JSON Schema of a profile file."""


def read_profile(name_or_path: str | Path, folders: Iterable[str | Path] = ()) -> DriverProfile:
    """Read a profile by its path, or by its name in the folders or among those shipped.

    Raises `DriverProfileError` if no profile of that name is known; lists those that are; `FormatError` if the file is
    not there or no valid profile, or a folder isn't one.

    Parameters
    ----------
    name_or_path : str or Path
        ``motorway`` or ``somewhere/mine.json``.
    folders : iterable of path
        Looked through first, in this order.
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


def write_profile(profile: DriverProfile, path: str | Path) -> None:
    """Write a profile file, whole or not at all; the same profile gives the same bytes.

    Raises `OSError` when it can't be written.
    """
    write_atomically(Path(path), profile_bytes(profile))


def profile_bytes(profile: DriverProfile) -> bytes:
    """The profile file's bytes."""
    return (canonical_json(profile.to_dict()) + "\n").encode("utf-8")


def profile_hash(profile: DriverProfile) -> str:
    """SHA-256 of the profile file's bytes, in hexadecimal: what outputs name their profile by."""
    return _hash_of(_Identity(profile))


class _Identity(Struct, frozen=True, eq=False):
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
    facts |= {"effects": len(profile.effects), "columns": list(profile.columns)}
    return facts | {"hours": known.hours, "drives": known.drives, "runs": known.runs, "lane_width": profile.lane_width}


def describe_profile(profile: DriverProfile) -> str:
    """What was fitted, in a line; others for lane markings that a camera had misjudged, and for the sensor's part."""
    known = profile.provenance
    text = (
        f"{profile.name}: {profile.model.kind} model from {known.hours:.2f} h in {known.runs} runs of {known.drives} "
        f"drives, {len(profile.effects)} effects"
    )
    if profile.columns:
        text += f" of {', '.join(profile.columns)}"
    if one := known.fit.get("one_marking"):
        text += (
            f"\n{100 * one:.1f} % of the rows follow one lane marking, because the other was misjudged; "
            f"{100 * known.fit['no_marking']:.1f} % are left out, because both were"
        )
    return text if profile.sensor is None else f"{text}\n{profile.sensor.in_words()}"
