"""Profiles of a library that are removed or get another id, and which outputs of batches used them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from xosc_lateral.base.errors import DriverProfileError, FormatError, XoscLateralError
from xosc_lateral.base.lazy import pd
from xosc_lateral.workflows.options import declare_options
from xosc_lateral.workflows.result import PathLike, Paths, Result, as_paths


@declare_options
def remove_profiles(names: Sequence[PathLike], library: Paths = ()) -> tuple[Path, ...]:
    """Delete the files of profiles of your own, all or none; those that can't be read go by their id only.

    Raises `FormatError`: One comes with the package or another, or the file of a path is no profile.
    """
    from xosc_lateral.files import profiles
    from xosc_lateral.files.source import edit_in_place

    paths = [profiles.own_path(str(name), as_paths(library)) for name in names]
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
    from xosc_lateral.files import profiles
    from xosc_lateral.files.source import edit_in_place

    path = profiles.own_path(str(name), as_paths(library))
    renamed = profiles.described(profiles.read_profile(path), name=new)
    output = path.with_name(f"{renamed.name}.json")
    if output.exists() and not force and not output.samefile(path):
        raise FormatError("there is a profile of this id; --force replaces it", path=output)
    edit_in_place(path)
    profiles.write_profile(renamed, output)
    if not output.samefile(path):
        path.unlink()
    return output


@dataclass(frozen=True, slots=True)
class ProfileUse:
    """An output with offsets of a profile."""

    output: Path
    entities: tuple[str, ...]  # that it drives
    sha256: str  # of the profile as it was then
    is_current: bool | None  # it is the same now; None: there is no profile of this id any more


class ProfileUses(Result):
    """Which outputs used a profile."""

    __slots__ = ("name", "uses")

    def __init__(self, name: str, uses: Sequence[ProfileUse]) -> None:
        self.name, self.uses = name, tuple(uses)

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
    from xosc_lateral.files.profiles import profile_hash, read_profile
    from xosc_lateral.workflows.batch.manifest import MANIFEST, read_manifest

    now: str | None
    try:
        now = profile_hash(read_profile(name, as_paths(library)))
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
    return ProfileUses(name, uses)
