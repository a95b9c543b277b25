"""The library of profiles as a team has it: shipped ones, folders of their own, and files in them that are broken."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from msgspec.structs import replace

from xosc_lateral.driver.profile import DriverProfile
from xosc_lateral.driver.provenance import Metadata
from xosc_lateral.errors import FormatError, XoscLateralError
from xosc_lateral.formats.output_paths import file_name
from xosc_lateral.formats.profile_folders import SHIPPED, find_profile, list_profiles
from xosc_lateral.formats.profiles import read_profile

FIELDS = tuple(name for name in Metadata.__struct_fields__ if name != "tags")
"""Metadata of a profile that can be set and searched for, besides its tags."""


@dataclass(frozen=True, eq=False, slots=True)
class Entry:
    """One file of the library.

    Parameters
    ----------
    path : Path
    profile : DriverProfile or None
        None: it can't be read.
    problem : str
        What is wrong with it, in a line; empty if nothing is.
    hidden_by : Path or None
        File of the same name in a folder that is looked through before.
    """

    path: Path
    profile: DriverProfile | None
    problem: str = ""
    hidden_by: Path | None = None

    @property
    def name(self) -> str:
        """What it is looked up by: the file's name without its suffix."""
        return self.path.stem

    @property
    def is_shipped(self) -> bool:
        """Whether it comes with the package."""
        return self.path.parent == SHIPPED


def read_library(folders: Iterable[Path] = ()) -> list[Entry]:
    """Every file of the library; a broken or foreign one costs one entry, not the listing.

    Raises `FormatError` if a folder isn't there.
    """
    first: dict[str, Path] = {}
    entries = []
    for path in list_profiles(folders):
        entries.append(_entry(path, first.get(path.stem)))
        first.setdefault(path.stem, path)
    return entries


def _entry(path: Path, hidden_by: Path | None) -> Entry:
    try:
        profile = read_profile(path)
    except (XoscLateralError, OSError) as error:
        return Entry(path, None, " ".join(str(error).split()), hidden_by)
    problem = ""
    if profile.name != path.stem:
        problem = f"{path}: holds the profile {profile.name!r}, but is looked up as {path.stem!r}: rename one of them"
    return Entry(path, profile, problem, hidden_by)


def matching(entries: Iterable[Entry], tags: Collection[str], where: Mapping[str, str]) -> list[Entry]:
    """Entries that carry all the tags and whose metadata (or `id`, or `model`) are as given, letters big or small.

    Raises `XoscLateralError` if `where` names something that profiles don't have.
    """
    for field in where:
        if field not in (*FIELDS, "id", "model"):
            raise XoscLateralError(f"profiles have no field {field!r}; there are id, model, {', '.join(FIELDS)}")
    wanted = {tag.casefold() for tag in tags}
    return [entry for entry in entries if entry.profile is not None and _matches(entry.profile, wanted, where)]


def _matches(profile: DriverProfile, tags: set[str], where: Mapping[str, str]) -> bool:
    facts = facts_of(profile)
    carried = {tag.casefold() for tag in profile.metadata.tags}
    return tags <= carried and all(facts[field].casefold() == value.casefold() for field, value in where.items())


def facts_of(profile: DriverProfile) -> dict[str, str]:
    """What a profile can be searched by, besides its tags."""
    metadata = {field: str(getattr(profile.metadata, field)) for field in FIELDS}
    return {"id": profile.name, "model": profile.model.kind, **metadata}


def described(
    profile: DriverProfile,
    *,
    name: str | None = None,
    add_tags: Iterable[str] = (),
    remove_tags: Collection[str] = (),
    fields: Mapping[str, str] | None = None,
) -> DriverProfile:
    """The profile under another id, with other tags and metadata; what is not mentioned stays.

    Raises `XoscLateralError` for a field that there is not (`FIELDS` are known) and for an id that is no file name.
    """
    for field in fields or {}:
        if field not in FIELDS:
            raise XoscLateralError(f"profiles have no field {field!r} to set; there are {', '.join(FIELDS)}")
    file_name(profile.name if name is None else name, "profile's id")
    tags = tuple(tag for tag in dict.fromkeys([*profile.metadata.tags, *add_tags]) if tag not in remove_tags)
    metadata = replace(profile.metadata, tags=tags, **(fields or {}))
    return replace(profile, name=name or profile.name, metadata=metadata)


def own_path(name: str, folders: Iterable[Path]) -> Path:
    """Path of a profile that may be changed.

    Raises `FormatError` if it comes with the package.
    """
    path = find_profile(name, folders)
    if path.parent == SHIPPED:
        what = f"comes with the package: profiles add {path.stem} --library FOLDER copies it to where it can be changed"
        raise FormatError(what, path=path)
    return path
