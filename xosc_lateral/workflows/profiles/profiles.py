"""The library of drivers: profiles read, written, listed, compared, derived, tagged, renamed, removed and looked up."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from msgspec import structs

from xosc_lateral.base.errors import DriverProfileError, FormatError, XoscLateralError
from xosc_lateral.base.lazy import pd
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files import profiles
from xosc_lateral.files.output_paths import claim, output_file, output_folder
from xosc_lateral.files.profiles import Entry, described, matching, own_path, profile_hash, read_library
from xosc_lateral.files.source import edit_in_place
from xosc_lateral.workflows.options import declare_options, flag, texts
from xosc_lateral.workflows.profiles.cards import card_page, list_record, list_text
from xosc_lateral.workflows.result import (
    PROFILE_SUFFIXES,
    PathLike,
    Paths,
    ProfileLike,
    Result,
    as_paths,
    given_profile,
    write_page,
)

if TYPE_CHECKING:
    from xosc_lateral.drivers.fitting.derive import Derived
    from xosc_lateral.workflows.profiles.comparison_page import ProfileComparison

TAGS = flag("--tag", kind=list[str] | None, metavar="TAG", help="Tag to add; may be repeated.")
METADATA = flag("--set", kind=list[str] | None, read=texts, metavar="FIELD=VALUE",
    help="Metadata: version, driver, vehicle, road, country, date or licence.")  # fmt: skip


@declare_options
def read_profile(profile: PathLike, library: Paths = ()) -> DriverProfile:
    """Read a profile by its path or its name.

    Raises `DriverProfileError`: No profile of that name; lists those that are there; `FormatError`: The file is not
    there, or no valid profile.

    Parameters
    ----------
    profile : str or Path
        ``motorway`` or ``somewhere/mine.json``. A name is looked up in `library`, in the folders of
        ``XOSC_LATERAL_LIBRARY`` and of the configuration file, among those of plug-ins and those shipped.
    library : path or paths
        Folders with further profiles.
    """
    return given_profile(profile, library)


def write_profile(profile: DriverProfile, path: PathLike, *, force: bool = False) -> Path:
    """Write a profile file; in a folder it is called after the profile. Same profile, same bytes.

    Raises `FormatError`: The file is there and no profile that this package wrote.
    """
    output = output_file(path, f"{profile.name}.json", PROFILE_SUFFIXES)
    claim([output], force=force)
    profiles.write_profile(profile, output)
    return output


def write_card(profile: DriverProfile, path: PathLike, *, force: bool = False) -> Path:
    """Write a profile's card as a page: what it does, where it comes from, how true it is."""
    return write_page(path, f"{profile.name}.html", lambda: card_page(profile), force=force)


@declare_options
def derive_profile(
    base: ProfileLike = "motorway", *,
    preset: Annotated[str | None,
        flag(help="alcohol-0.5, drowsy or truck: figures with a source, as changes of the base's.")] = None,
    sdlp: Annotated[float | None, flag(help="Standard deviation of lateral position. [m]")] = None,
    mean: Annotated[float | None, flag(help="Mean offset, positive left. [m]")] = None,
    restlessness: Annotated[float | None, flag(help="Standard deviation of lateral speed. [m/s]")] = None,
    memory: Annotated[float | None, flag(help="After which the autocorrelation is 1/e. [s]")] = None,
    near_line: Annotated[float | None,
        flag(help="Share of time with a side within 0.2 m of a marking. [0 to 1]")] = None,
    speed: Annotated[float | None, flag(help="At which the figures hold; default 26.4. [m/s]")] = None,
    vehicle: Annotated[str | None, flag("--class", metavar="truck", help="What the base knows of trucks.")] = None,
    name: Annotated[str, flag(help="Id of the new profile.")] = "",
    library: Paths = (),
    **asked: float | None,
) -> Derived:  # fmt: skip
    """A driver from stated figures: what a profile does, made larger, slower or elsewhere until it has them.

    Raises `DriverProfileError`: If figures contradict each other, are too far from the base's, or no car could drive
    them.

    Parameters
    ----------
    base : DriverProfile, path or name
        Gives what is not stated; of a population its typical driver.
    name : str
        Id of the new profile; else the preset's or the base's name with ``-derived``.
    **asked
        Other fields of `fitting.derive.Asked`: ``sdlp_change=0.03``.
    """
    from xosc_lateral.drivers.fitting.derive import Asked, derive, preset_called

    known = given_profile(base, library)
    chosen = None if preset is None else preset_called(preset)
    asked |= {"sdlp": sdlp, "mean": mean, "restlessness": restlessness, "memory": memory, "near_line": near_line}
    stated = {key: value for key, value in {**asked, "speed": speed, "vehicle": vehicle}.items() if value is not None}
    figures = Asked(**stated) if chosen is None else replace(chosen.asked, **stated)  # type: ignore[arg-type]
    made = derive(known, figures, name or preset or f"{known.name}-derived", preset=chosen)
    origin = made.profile.provenance
    origin = structs.replace(origin, fit={"derived_from": known.name, "sha256": profile_hash(known), **origin.fit})
    return made._replace(profile=structs.replace(made.profile, provenance=origin))


@declare_options
def list_profiles(
    library: Paths = (), *,
    tags: Annotated[Collection[str], flag("--tag", kind=list[str] | None, metavar="TAG",
        help="Only profiles with this tag; may be repeated.")] = (),
    where: Annotated[Mapping[str, str] | None, flag(kind=list[str] | None, read=texts, metavar="FIELD=VALUE",
        help="Only profiles with this value, e.g. country=DE; may be repeated.")] = None,
) -> ProfileList:  # fmt: skip
    """Everything in the library: `library`, the environment's and the configuration's folders, shipped, plug-ins'.

    A file that is no valid profile is listed with what is wrong with it.
    """
    entries = read_library(as_paths(library))
    return ProfileList(tuple(matching(entries, tags, where or {}) if tags or where else entries))


@declare_options
def add_profile(
    profile: ProfileLike,
    library: Annotated[PathLike, flag(kind=Path, metavar="FOLDER",
        help="Folder of the library; created if missing.")], *,
    name: Annotated[str | None, flag("--name", help="Id in the library; default: its own.")] = None,
    tags: Annotated[Collection[str], TAGS] = (),
    metadata: Annotated[Mapping[str, str] | None, METADATA] = None,
    force: bool = False,
) -> Path:  # fmt: skip
    """Put a profile into a library's folder, under its id, with tags and metadata.

    Raises `FormatError`: There is a profile of that id.
    """
    folders = [library] if Path(library).is_dir() else []
    added = described(given_profile(profile, folders), name=name, add_tags=tags, fields=metadata)
    output = output_folder(library) / f"{added.name}.json"
    if output.exists() and not force:
        raise FormatError("there is a profile of this id; --name gives it another, --force replaces it", path=output)
    profiles.write_profile(added, output)
    return output


@declare_options
def tag_profile(
    name: PathLike,
    library: Paths = (),
    *,
    add: Annotated[Collection[str], TAGS] = (),
    remove: Annotated[
        Collection[str], flag(kind=list[str] | None, metavar="TAG", help="Tag to remove; may be repeated.")
    ] = (),
    metadata: Annotated[Mapping[str, str] | None, METADATA] = None,
) -> DriverProfile:
    """Change tags and metadata of a profile in its file.

    Raises `FormatError`: It comes with the package, or can't be read.
    """
    path = own_path(str(name), as_paths(library))
    changed = described(profiles.read_profile(path), add_tags=add, remove_tags=remove, fields=metadata)
    edit_in_place(path)
    profiles.write_profile(changed, path)
    return changed


@declare_options
def compare_profiles(*profiles: ProfileLike, library: Paths = (), seed: int = 0) -> ProfileComparison:
    """How profiles differ in even traffic: a summary of each, and the distance of each from each.

    Parameters
    ----------
    profiles : DriverProfile, path or name
        Two or more.
    seed : int
        Of the free runs that are compared.
    """
    from xosc_lateral.workflows.profiles.comparison_page import ProfileComparison, compare

    if len(profiles) < 2:
        raise ValueError(f"{len(profiles)} profile to compare, two are needed")
    return ProfileComparison(compare([given_profile(profile, library) for profile in profiles], seed))


@dataclass(frozen=True, eq=False, repr=False)
class ProfileList(Result):
    """Profiles of a library; those that can't be read among them, with the reason."""

    entries: tuple[Entry, ...]

    def __iter__(self) -> Iterator[Entry]:
        return iter(self.entries)

    def __len__(self) -> int:
        return len(self.entries)

    @property
    def names(self) -> tuple[str, ...]:
        """Of those that can be read, each once."""
        return tuple(dict.fromkeys(entry.name for entry in self.entries if entry.profile is not None))

    def headline(self) -> str:
        """One line."""
        broken = sum(entry.profile is None for entry in self.entries)
        return f"{len(self.names)} profiles{f', {broken} that cannot be read' if broken else ''}"

    def __str__(self) -> str:
        return list_text(self.entries)

    def to_frame(self) -> pd.DataFrame:
        """One row per file."""
        return pd.DataFrame(self.to_dict()["profiles"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        return {"profiles": list_record(self.entries)}


# ---- profiles that are removed or get another id, and outputs that used one ----
@declare_options
def remove_profiles(names: Sequence[PathLike], library: Paths = ()) -> tuple[Path, ...]:
    """Delete the files of profiles of your own, all or none; those that can't be read go by their id only.

    Raises `FormatError`: One comes with the package or another, or the file of a path is no profile.
    """
    paths = [own_path(str(name), as_paths(library)) for name in names]
    for name, path in zip(names, paths, strict=True):
        if str(name) != path.stem:  # a file of any folder
            profiles.read_profile(path)
        edit_in_place(path)
    for path in dict.fromkeys(paths):
        path.unlink()
    return tuple(dict.fromkeys(paths))


@declare_options
def rename_profile(name: PathLike, new: str, library: Paths = (), *, force: bool = False) -> Path:
    """Give a profile of your own another id, in its file and as the file's name.

    Its hash changes with its id: outputs that used it state the former one. Also for a file that is called other than
    the id in it.

    Raises `FormatError`: It comes with the package or another, can't be read, or there is a profile of the new id.
    """
    path = own_path(str(name), as_paths(library))
    renamed = described(profiles.read_profile(path), name=new)
    output = path.with_name(f"{renamed.name}.json")
    same = output.exists() and output.samefile(path)
    if output.exists() and not force and not same and output.read_bytes() != profiles.profile_bytes(renamed):
        raise FormatError("there is a profile of this id; --force replaces it", path=output)
    edit_in_place(path)
    profiles.write_profile(renamed, output)
    if not same:  # killed before, there are both, which the next run does not mind
        path.unlink()
    return output


@dataclass(frozen=True, slots=True)
class ProfileUse:
    """An output with offsets of a profile."""

    output: Path
    entities: tuple[str, ...]  # that it drives
    sha256: str  # of the profile as it was then
    is_current: bool | None  # it is the same now; None: there is no profile of this id any more


@dataclass(frozen=True, eq=False, repr=False)
class ProfileUses(Result):
    """Which outputs used a profile."""

    name: str
    uses: tuple[ProfileUse, ...]

    def headline(self) -> str:
        """One line."""
        former = sum(use.is_current is False for use in self.uses)
        older = f", {former} of them another profile of that id than there is now" if former else ""
        return f"{len(self.uses)} outputs used {self.name}{older}"

    def __str__(self) -> str:
        notes = {True: "", False: " (as it was then)", None: " (no longer in the library)"}
        lines = [f"{use.output}: {', '.join(use.entities)}{notes[use.is_current]}" for use in self.uses]
        return "\n".join([*lines, self.headline()])

    def to_frame(self) -> pd.DataFrame:
        """One row per output."""
        return pd.DataFrame(self.to_dict()["outputs"], columns=["output", "entities", "sha256", "is_current"])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""
        outputs = [{**asdict(use), "output": str(use.output), "entities": list(use.entities)} for use in self.uses]
        return {"id": self.name, "outputs": outputs}


@declare_options
def find_uses(name: str, outputs: Paths, library: Paths = ()) -> ProfileUses:
    """Look a profile up in the manifests of batches.

    Raises `FormatError`: A folder without a manifest.

    Parameters
    ----------
    name : str
        Its id; it need not be in the library any more.
    outputs : path or paths
        Folders that batches wrote, or their manifests.
    """
    from xosc_lateral.workflows.batch.manifest import MANIFEST, read_manifest

    now: str | None
    try:
        now = profile_hash(profiles.read_profile(name, as_paths(library)))
    except DriverProfileError:
        now = None
    except (XoscLateralError, OSError):
        now = ""  # it can't be read: it is none of those that outputs state
    uses = list[ProfileUse]()
    for path in as_paths(outputs):
        manifest = path / MANIFEST if path.is_dir() else path
        if not manifest.is_file():
            raise FormatError("no such file: a batch writes it", path=manifest)
        for row in read_manifest(manifest):
            entities = tuple(entity for entity, profile in row.profiles.items() if profile == name)
            if entities:
                sha256 = row.profile_sha256.get(name, "")
                is_current = None if now is None else sha256 == now
                uses.append(ProfileUse(manifest.parent / row.output, entities, sha256, is_current))
    return ProfileUses(name, tuple(uses))
