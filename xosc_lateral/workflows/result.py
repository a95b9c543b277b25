"""What all results have in common, and what calls accept as their inputs."""

from __future__ import annotations

import hashlib
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.note import Note, Telling, rows_left_out, warnings
from xosc_lateral.files.source import parsed_hashes
from xosc_lateral.workflows.options import PathLike, Paths, ProfileLike
from xosc_lateral.workflows.options import paths as as_paths

if TYPE_CHECKING:
    import pandas as pd

    from xosc_lateral.drivers.drives.drive import Drive
    from xosc_lateral.drivers.model.profile import DriverProfile
    from xosc_lateral.files.mapping import MappingLike


class Result(Telling, ABC):
    """A result: a line as its `repr`, the command line's text as its `str`, a table, and JSON values."""

    __slots__ = ()

    @abstractmethod
    def headline(self) -> str:
        """One line."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__} {self.headline()}>"

    @abstractmethod
    def __str__(self) -> str: ...

    def _repr_html_(self) -> str:
        """In a notebook: the text, and the figure of a result that has one."""
        plot = getattr(self, "plot", None)
        figure = None if plot is None else plot()
        return f"<pre>{escape(str(self))}</pre>{'' if figure is None else figure.svg()}"

    @abstractmethod
    def to_frame(self) -> pd.DataFrame:
        """As a table."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them."""


PAGE_SUFFIXES = (".html", ".htm")


def write_page(
    path: PathLike, usual_name: str, html: Callable[[], str], *, inputs: Iterable[Path] = (), force: bool = False
) -> Path:
    """Write an HTML page, if need be into a folder; made only if it may be written there."""
    from xosc_lateral.files.atomic import write_atomically
    from xosc_lateral.files.output_paths import claim, output_file

    output = output_file(path, usual_name, PAGE_SUFFIXES)
    claim([output], inputs, force=force)
    return write_atomically(output, html())


def write_table(
    path: PathLike,
    usual_name: str,
    frame: Callable[[], pd.DataFrame],
    provenance: Callable[[], Mapping[str, Any]],
    *,
    inputs: Iterable[Path] = (),
    force: bool = False,
) -> Path:
    """Write a table with its provenance beside it, if need be into a folder; made only if it may be written there."""
    from xosc_lateral.files.output_paths import claim, output_file
    from xosc_lateral.files.output_tables import output_suffixes, write_frame

    output = output_file(path, usual_name, output_suffixes())
    claim([output], inputs, force=force)
    write_frame(frame(), output, provenance())
    return output


__all__ = ["DrivesLike", "PathLike", "Paths", "ProfileLike", "as_paths", "given_drives", "given_profile"]

DrivesLike: TypeAlias = "PathLike | pd.DataFrame | Drive | Sequence[PathLike | pd.DataFrame | Drive]"
"""A table's path, a frame, a `Drive`, or several of them."""


@dataclass(frozen=True, eq=False, slots=True)
class GivenDrives:
    """Drives, and what they came from.

    Parameters
    ----------
    drives : list of Drive
    inputs : mapping of str to str
        Name of each table -> SHA-256 of its bytes (of a frame: of its columns' values).
    files : tuple of Path
        Those of them that are files.
    left_out : mapping of str to int
        Rows of the tables that are in no drive, by reason.
    """

    drives: list[Drive]
    inputs: Mapping[str, str]
    files: tuple[Path, ...]
    left_out: Mapping[str, int] = field(default_factory=dict)

    @property
    def messages(self) -> tuple[Note, ...]:
        """Rows that are left out, and what the drives say against themselves."""
        return (*rows_left_out(self.left_out), *warnings(self.evidence()))

    def evidence(self) -> list[str]:
        """What the drives say against themselves, in lines; see `drivers.drives.evidence`."""
        from xosc_lateral.drivers.drives.evidence import of_drives

        return of_drives([drive.offset for drive in self.drives], [drive.lane_width for drive in self.drives])

    def valid_below(self, frequency: float | None) -> GivenDrives:
        """The same, where drives that don't state their band show driving below a frequency [Hz]."""
        if frequency is None:
            return self
        drives = [drive if drive.valid_below else replace(drive, valid_below=frequency) for drive in self.drives]
        return replace(self, drives=drives)


@contextmanager
def naming(drives: GivenDrives) -> Iterator[None]:
    """What finds too little in the drives does not know their files: they are named here.

    Raises
    ------
    NotEnoughDataError
        With the files before it.
    """
    try:
        yield
    except NotEnoughDataError as error:
        names = [str(path) for path in drives.files] or list(drives.inputs)
        if not names or any(name in str(error) for name in names):
            raise
        more = f" and {len(names) - 3} more" if len(names) > 3 else ""
        raise NotEnoughDataError(f"{', '.join(names[:3])}{more}: {error}") from error


def given_drives(drives: DrivesLike, columns: MappingLike | None = None) -> GivenDrives:
    """Read whatever stands for measured drives.

    Parameters
    ----------
    drives : path, DataFrame, Drive, or sequence of them
    columns : mapping of str to str, TableMapping, or path, optional
        Standard name -> foreign header, with a unit if need be: ``{"speed": "v_kmh:km/h"}``; or a saved mapping.

    Raises
    ------
    FormatError, NotEnoughDataError
        See `files.drives.read_drives`.
    """
    from xosc_lateral.drivers.drives.drive import Drive
    from xosc_lateral.files.drives import drives_of_table, read_drives, with_distinct_names
    from xosc_lateral.files.mapping import as_mapping
    from xosc_lateral.files.remote import inputs_of
    from xosc_lateral.files.tables import frame_of

    several = isinstance(drives, Sequence) and not isinstance(drives, str | Path | Drive)
    items: list[Any] = list(drives) if several else [drives]  # type: ignore[arg-type]
    mapping = as_mapping(columns)
    files, lost = inputs_of(item for item in items if isinstance(item, str | Path)), Counter[str]()
    if all(isinstance(item, str | Path) for item in items):
        every = read_drives(files, mapping, lost)
        return GivenDrives(every, parsed_hashes(files), tuple(files), +lost)
    read: list[Drive] = []
    inputs: dict[str, str] = {}
    for number, item in enumerate(items, start=1):
        if isinstance(item, Drive):
            read.append(item)
        elif isinstance(item, str | Path):
            read += read_drives(item, mapping, lost)
        else:
            name = "DataFrame" if len(items) == 1 else f"DataFrame {number}"
            frame = frame_of(item)
            read += drives_of_table(frame, mapping, name, lost)
            inputs[name] = frame_hash(frame)
    return GivenDrives(with_distinct_names(read), parsed_hashes(files) | inputs, tuple(files), +lost)


def frame_hash(frame: pd.DataFrame) -> str:
    """SHA-256 over the names, kinds and values of a frame's columns, in hexadecimal."""
    import numpy as np

    digest = hashlib.sha256()
    for name in frame.columns:
        values = frame[name]
        digest.update(f"\0{name}\0{values.dtype}\0".encode())
        if isinstance(values.dtype, np.dtype) and values.dtype.kind in "biuf":
            digest.update(values.to_numpy().astype(values.dtype.newbyteorder("<")).tobytes())
        else:  # texts, times, categories
            digest.update(values.to_csv(index=False, header=False).encode())
    return digest.hexdigest()


def given_profile(profile: ProfileLike, library: Paths = ()) -> DriverProfile:
    """A profile as it is, or read by its path or name; see `read_profile`."""
    from xosc_lateral.files.profiles import read_profile

    return read_profile(profile, as_paths(library)) if isinstance(profile, str | Path) else profile
