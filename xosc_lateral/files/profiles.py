"""Profile files (JSON, canonical to the byte), where they are looked up by name, and libraries of them."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from xosc_lateral.base.errors import (
    DriverProfileError,
    FormatError,
    XoscLateralError,
    did_you_mean,
    meant_for,
    names_beside,
)
from xosc_lateral.base.limits import PROFILE_SIZE
from xosc_lateral.base.plugins import plugins, shipped_folder
from xosc_lateral.base.texts import composed
from xosc_lateral.drivers.model.plausibility import check_profile
from xosc_lateral.drivers.model.profile import DriverProfile, Metadata
from xosc_lateral.drivers.model.records import plain
from xosc_lateral.files.atomic import at_once, mend, write_atomically
from xosc_lateral.files.configuration import configured_libraries
from xosc_lateral.files.json_text import canonical_json, parse_json
from xosc_lateral.files.output_paths import file_name, is_own
from xosc_lateral.files.remote import is_url, local
from xosc_lateral.files.source import check_regular, guard_input, read_source, state_key
from xosc_lateral.files.tables import foreign_errors

SHIPPED = shipped_folder("driver_profiles")  # profiles that come with the package
LONGEST_NAME = 200  # characters of a profile's name; file systems take 255 bytes, the suffix included
SUFFIX = ".json"
LIBRARY_VARIABLE = "XOSC_LATERAL_LIBRARY"  # environment variable with folders of profiles, separated as in PATH
GROUP = "xosc_lateral.profiles"  # entry points of folders with further profiles


def find_profile(name_or_path: str | Path, folders: Iterable[str | Path] = ()) -> Path:
    """Path of a profile; see `read_profile`."""
    text = str(name_or_path)
    path = local(name_or_path) if is_url(text) else Path(name_or_path)
    if isinstance(name_or_path, Path) or text.endswith(SUFFIX) or path.name != text:
        if not path.exists() or path.is_dir():
            what = "no such file" + did_you_mean(path.stem, [one.stem for one in list_profiles(folders)])
            what = "is a folder, not a profile; --library FOLDER finds its profiles by name" if path.is_dir() else what
            raise FormatError(what, path=path)
        return path
    if hint := meant_for(text):
        raise FormatError(f"not a profile{hint}", path=path)
    if len(text) > LONGEST_NAME:
        raise DriverProfileError(f"{text[:20]!r}...: no profile has a name of {len(text)} characters")
    for folder in (*library_folders(folders), SHIPPED):
        candidate = folder / f"{text}{SUFFIX}"
        if candidate.is_file():
            return candidate
        for other in () if text.isascii() else sorted(folder.glob(f"*{SUFFIX}")):
            if composed(other.stem) == composed(text):
                return other
    if (offered := _from_plugins().get(text)) is not None:
        return offered
    known = sorted({path.stem for path in list_profiles(folders)})
    error = DriverProfileError(
        f"no profile {text!r}{did_you_mean(text, known + names_beside(text))}; known are {', '.join(known) or 'none'}, "
        "or give the path of a file"
    )
    error.unknown = text
    raise error


def list_profiles(folders: Iterable[str | Path] = ()) -> list[Path]:
    """Profile files in the folders (see `library_folders`), among those shipped and of plug-ins, by name within each.

    Raises `FormatError` if a folder isn't one.
    """
    searched = _each_once((*library_folders(folders), SHIPPED))
    paths = [path for folder in searched for path in sorted(folder.glob(f"*{SUFFIX}"))]
    return paths + [path for _, path in sorted(_from_plugins().items())]


def library_folders(folders: Iterable[str | Path] = ()) -> tuple[Path, ...]:
    """Folders with profiles besides those shipped: named ones, the environment's, the configuration's.

    ``XOSC_LATERAL_LIBRARY`` holds folders, separated as in PATH. The configuration is ``xosc-lateral/config.toml`` in
    ``XDG_CONFIG_HOME`` (else ``~/.config``; on Windows ``APPDATA``) with ``library = ["FOLDER", ...]``.
    """
    from_environment = [Path(name) for name in os.environ.get(LIBRARY_VARIABLE, "").split(os.pathsep) if name]
    places = [*map(Path, folders), *from_environment, *configured_libraries()]
    for folder in places:
        if not folder.is_dir():
            raise FormatError("no such folder", path=folder)
    return _each_once(places)


def _each_once(folders: Iterable[Path]) -> tuple[Path, ...]:
    """A folder that is named twice, however it is spelled, counts where it comes first."""
    unique: dict[Path, Path] = {}
    for folder in folders:
        unique.setdefault(folder.resolve(), folder)
    return tuple(unique.values())


def _from_plugins() -> dict[str, Path]:
    """Profiles that other packages offer: entry points that are a folder, or a function that gives one."""
    paths: dict[str, Path] = {}
    for offered in plugins(GROUP).values():
        with at_once():
            folder = Path(offered() if callable(offered) else offered)
        paths |= {path.stem: path for path in sorted(folder.glob(f"[!.]*{SUFFIX}"))}
    return paths


SCHEMA = Path(__file__).resolve().parents[1] / "resources" / "driver_profile.schema.json"  # of a profile file


def read_profile(name_or_path: str | Path, folders: Iterable[str | Path] = ()) -> DriverProfile:
    """Read a profile by its path or name, once per process for as long as its file stays the same.

    A name is looked for in the folders, in their order, then among those shipped. Raises `DriverProfileError`: no
    profile of that name is known; `FormatError`: the file is not there or no valid profile, or a folder isn't one.
    """
    path = find_profile(name_or_path, folders)
    state = check_regular(path)
    guard_input(path)
    return _read_profile(path, state_key(state))


@lru_cache(maxsize=128)
def _read_profile(path: Path, _state: tuple[int, ...]) -> DriverProfile:
    values = parse_json(read_source(path, PROFILE_SIZE).data, path)
    try:
        with foreign_errors(path, "not a driver profile"):
            profile = DriverProfile.from_dict(_with_law(values))
            check_profile(profile)
            return profile
    except DriverProfileError as error:
        raise FormatError(str(error), path=path) from error


def _with_law(values: Any) -> Any:
    """Files of older versions hold rows of lane changes, and no law."""
    held = values.get("maneuvers") if isinstance(values, dict) else None
    if not isinstance(held, dict) or "sample" not in held:
        return values
    from xosc_lateral.drivers.fitting.maneuvers import law_of_rows

    return {**values, "maneuvers": law_of_rows(held).to_dict()}


def write_profile(profile: DriverProfile, path: str | Path) -> None:
    """Write a profile file, whole or not at all; the same profile gives the same bytes. Raises `OSError`.

    What a killed run has left of it is removed.
    """
    mend([Path(path)], is_own)
    write_atomically(Path(path), profile_bytes(profile))


def profile_bytes(profile: DriverProfile) -> bytes:
    """The profile file's bytes."""
    return (canonical_json(profile.to_dict()) + "\n").encode("utf-8")


_HASHES: dict[int, tuple[DriverProfile, str]] = {}  # by identity: a profile never changes, and can't all be hashed


def profile_hash(profile: DriverProfile) -> str:
    """SHA-256 of the profile file's bytes, in hexadecimal: what outputs name their profile by."""
    known = _HASHES.get(id(profile))
    if known is None:
        if len(_HASHES) >= 32:  # a batch names the same few profiles in thousands of outputs
            _HASHES.pop(next(iter(_HASHES)))
        known = _HASHES[id(profile)] = profile, hashlib.sha256(profile_bytes(profile)).hexdigest()
    return known[1]


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
    if valid := profile.validity.in_words():
        text += f"\nvalid: {valid}"
    if "offset_mean_m" in known.fit:
        text += f"\n{_measured(known.fit, known.hours)}"
    if share := known.fit.get("one_marking"):
        text += (
            f"\n{100 * share:.1f} % of the rows follow one lane marking, because the other was misjudged; "
            f"{100 * known.fit['no_marking']:.1f} % are left out, because both were"
        )
    return text if profile.sensor is None else f"{text}\n{profile.sensor.in_words()}"


def _measured(fit: Mapping[str, Any], hours: float) -> str:
    """What was measured, in two lines, so that exchanged sides and wrong units are seen."""
    mean, spread = fit["offset_mean_m"], fit["offset_sd_m"]
    speed = "no speed"
    if "speed_5" in fit:
        speed = f"{3.6 * fit['speed_5']:.0f} to {3.6 * fit['speed_95']:.0f} km/h"
    side = "left" if mean > 0.0 else "right"
    text = (
        f"measured: {abs(mean):.2f} m {side} of the lane's centre on average, spread {spread:.2f} m, "
        f"lanes {fit['lane_width_m']:.2f} m wide, {speed}\nused: {hours:.2f} of {fit['driven_h']:.2f} h"
    )
    if "drivers" in fit:
        text += f" of {fit['drivers']:g} driver{'s' if fit['drivers'] > 1 else ''}"
    left_out = ", ".join(f"{count} {reason}" for reason, count in fit.get("left_out", {}).items())
    return f"{text}; rows left out: {left_out}" if left_out else text


FIELDS = tuple(name for name in Metadata.__struct_fields__ if name != "tags")  # that can be set and searched for


@dataclass(frozen=True, eq=False, slots=True)
class Entry:
    """One file of the library."""

    path: Path
    profile: DriverProfile | None  # None: it can't be read
    problem: str = ""  # what is wrong with it, in a line; empty if nothing is
    hidden_by: Path | None = None  # file of the same name in a folder that is looked through before

    @property
    def name(self) -> str:
        """What it is looked up by: the file's name without its suffix."""
        return self.path.stem

    @property
    def is_shipped(self) -> bool:
        """Whether it comes with the package."""
        return self.path.parent == SHIPPED


def read_library(folders: Iterable[Path] = ()) -> list[Entry]:
    """Every file of the library; a broken or foreign one costs one entry, not the listing. Raises `FormatError`."""
    first: dict[str, Path] = {}
    entries = []
    for path in list_profiles(folders):
        profile, problem = None, ""
        try:
            profile = read_profile(path)
            if composed(profile.name) != composed(path.stem):
                what = f"holds the profile {profile.name!r}, but is looked up as {path.stem!r}"
                problem = f"{path}: {what}: rename one of them"
        except (XoscLateralError, OSError) as error:
            problem = " ".join(str(error).split())
        entries.append(Entry(path, profile, problem, first.get(path.stem)))
        first.setdefault(path.stem, path)
    return entries


def matching(entries: Iterable[Entry], tags: Collection[str], where: Mapping[str, str]) -> list[Entry]:
    """Entries that carry all the tags and whose metadata (or `id`, or `model`) are as given, letters big or small."""
    for field in where:
        if field not in (*FIELDS, "id", "model"):
            raise XoscLateralError(f"profiles have no field {field!r}; there are id, model, {', '.join(FIELDS)}")
    wanted, matches = {tag.casefold() for tag in tags}, []
    for entry in entries:
        if entry.profile is not None and wanted <= {tag.casefold() for tag in entry.profile.metadata.tags}:
            facts = facts_of(entry.profile)
            if all(facts[field].casefold() == value.casefold() for field, value in where.items()):
                matches.append(entry)
    return matches


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
    """The profile under another id, with other tags and metadata; what is not mentioned stays."""
    for field in fields or {}:
        if field not in FIELDS:
            raise XoscLateralError(f"profiles have no field {field!r} to set; there are {', '.join(FIELDS)}")
    file_name(profile.name if name is None else name, "profile's id")
    tags = tuple(tag for tag in dict.fromkeys([*profile.metadata.tags, *add_tags]) if tag not in remove_tags)
    metadata = replace(profile.metadata, tags=tags, **(fields or {}))
    return replace(profile, name=name or profile.name, metadata=metadata)


def own_path(name: str, folders: Iterable[Path]) -> Path:
    """Path of a profile that may be changed. Raises `FormatError` if it comes with the package or a plug-in."""
    path = find_profile(name, folders)
    offered = {one.resolve() for one in _from_plugins().values()}
    if path.parent.resolve() == SHIPPED.resolve() or path.resolve() in offered:
        whose = "a plug-in" if path.resolve() in offered else "the package"
        what = f"comes with {whose}: profiles add {path.stem} --library FOLDER copies it to where it can be changed"
        raise FormatError(what, path=path)
    return path
