"""What all results have in common, and what calls accept as their inputs."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import wraps
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.note import Note, Telling, rows_left_out, warnings
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.files.atomic import write_atomically
from xosc_lateral.files.output_paths import claim, output_file
from xosc_lateral.files.source import parsed_hash, parsed_hashes
from xosc_lateral.workflows.options import PathLike, Paths, ProfileLike
from xosc_lateral.workflows.options import paths as as_paths

if TYPE_CHECKING:
    import pandas as pd

    from xosc_lateral.drivers.drives.drive import Drive
    from xosc_lateral.drivers.model.profile import DriverProfile
    from xosc_lateral.files.mapping import MappingLike


class Result(Telling, ABC):
    """A result: a line as its `repr`, the command line's text as its `str`, a table, and JSON values.

    It is a value: it can be copied, and pickled into another process.
    """

    __slots__ = ()

    def __init_subclass__(cls, **settings: Any) -> None:
        """Whoever makes a table makes one whose columns have units."""
        super().__init_subclass__(**settings)
        if made := vars(cls).get("to_frame"):
            cls.to_frame = with_units(made)  # type: ignore[method-assign]

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

    @property
    def usual_table(self) -> str:
        """What its table is called in a folder."""
        return f"{type(self).__name__.lower()}.csv"

    def write(self, path: PathLike, *, force: bool = False) -> Path:
        """Write the table: ``.csv``, ``.csv.gz`` or ``.parquet``, with its provenance, whole or not at all."""
        from xosc_lateral.files.output_tables import output_suffixes, write_table

        output = output_file(path, self.usual_table, output_suffixes())
        claim([output], getattr(self, "files", ()), force=force)
        write_table(output, self._provenance(), frame=self.to_frame, text=self.csv)
        return output

    def csv(self) -> str:
        """The table as text."""
        from xosc_lateral.files.output_tables import csv_text

        return csv_text(self.to_frame())

    def _provenance(self) -> Mapping[str, Any]:
        """What it was made from."""
        return {"inputs": parsed_hashes(getattr(self, "files", ()))}


COLUMN_UNITS: Mapping[str, str] = {
    **CONTEXT_UNITS,
    **dict.fromkeys(("time", "start", "end"), "s"),
    **dict.fromkeys(("h", "heading"), "rad"),
    **dict.fromkeys(("offset", "offset_real", "offset_t", "deviation"), "m"),
    **dict.fromkeys(("s", "x", "y", "z", "x_nominal", "y_nominal"), "m"),
}
"""Column of a result -> its unit, where its name does not say it."""
UNIT_SUFFIXES = {"m": "m", "s": "s", "h": "h", "hz": "Hz"}


def with_units(to_frame: Callable[..., pd.DataFrame]) -> Callable[..., pd.DataFrame]:
    """The same table, its columns in words joined by underscores, their units in `attrs["units"]`."""

    @wraps(to_frame)
    def described(self: Any, *args: Any, **settings: Any) -> pd.DataFrame:
        frame = to_frame(self, *args, **settings)
        named = {name: re.fullmatch(r"(.+) \[(.+)\]", str(name)) for name in frame.columns}
        stated = {re.sub(r"\W+", "_", found[1]): found[2] for found in named.values() if found}
        frame = frame.rename(columns={name: re.sub(r"\W+", "_", found[1]) for name, found in named.items() if found})
        known = {
            name: COLUMN_UNITS.get(name) or UNIT_SUFFIXES.get(str(name).rpartition("_")[2]) for name in frame.columns
        }
        frame.attrs["units"] = {name: unit for name, unit in (known | stated).items() if unit and unit != "-"}
        return frame

    return described


PAGE_SUFFIXES, PROFILE_SUFFIXES = (".html", ".htm"), (".json",)


def write_page(
    path: PathLike, usual_name: str, html: Callable[[], str], *, inputs: Iterable[Path] = (), force: bool = False
) -> Path:
    """Write an HTML page, if need be into a folder; made only if it may be written there."""
    output = output_file(path, usual_name, PAGE_SUFFIXES)
    claim([output], inputs, force=force)
    return write_atomically(output, html())


__all__ = ["DrivesLike", "PathLike", "Paths", "ProfileLike", "as_paths", "given_drives", "given_profile"]

DrivesLike: TypeAlias = Any
"""A table's path, URL or pattern, its bytes, a frame, a result that has one, a `Drive`, or several of them."""


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

    @classmethod
    def of(cls, drives: list[Drive], paths: Sequence[Path], left_out: Mapping[str, int] | None = None) -> GivenDrives:
        """Of files that were read, on a disk or in memory."""
        from xosc_lateral.files.held import held_at

        files = tuple(path for path in paths if held_at(path) is None)
        inputs = parsed_hashes(files) | {path.stem: parsed_hash(path) for path in paths if path not in files}
        return cls(drives, inputs, files, {why: count for why, count in (left_out or {}).items() if count})

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


def given_drives(drives: DrivesLike, columns: MappingLike | None = None, road: PathLike | None = None) -> GivenDrives:
    """Read whatever stands for measured drives.

    Parameters
    ----------
    drives : whatever `opened` takes, Drive, or sequence of them
        Tables, and recordings that hold their lanes.
    columns : mapping of str to str, TableMapping, or path, optional
        Standard name -> foreign header, with a unit if need be: ``{"speed": "v_kmh:km/h"}``; or a saved mapping.
    road : path, bytes or the like, optional
        Road of recordings whose vehicles are at x and y.

    Raises
    ------
    FormatError, NotEnoughDataError
        See `files.drives.read_drives`.
    """
    from xosc_lateral.drivers.drives.drive import Drive
    from xosc_lateral.files.drives import read_drives
    from xosc_lateral.files.tables import tables_at
    from xosc_lateral.workflows.opened import opened, opened_as_one, several

    items, lost = several(drives), Counter[str]()
    label = "DataFrame" if len(items) == 1 else "DataFrame {}"
    parts: list[Path | Drive] = [
        one
        for number, item in enumerate(items, start=1)
        for one in ([item] if isinstance(item, Drive) else opened(item, label.format(number)))
    ]
    if road is None:
        parts = [each for one in parts for each in ([one] if isinstance(one, Drive) else tables_at(one))]
    paths = [one for one in parts if not isinstance(one, Drive)]
    tables, mapping = parts, columns
    if (on := None if road is None else opened_as_one(road, name="road")) is not None:
        tables = [one if isinstance(one, Drive) else _recorded(one, on, columns) for one in parts]
        mapping = None
    read = read_drives(tables, mapping, lost)
    return GivenDrives.of(read, paths if on is None else [*paths, on], lost)


def _recorded(recording: Path, road: Path, columns: MappingLike | None) -> Path:
    """The drive table of a recording."""
    from xosc_lateral.base.plugins import service
    from xosc_lateral.workflows.opened import opened

    return opened(service("drives_of")(recording, road, columns), recording.name.split(".")[0])[0]


def given_profile(profile: ProfileLike, library: Paths = ()) -> DriverProfile:
    """A profile as it is, or read by its path or name; see `read_profile`."""
    from xosc_lateral.files.profiles import read_profile

    return read_profile(profile, as_paths(library)) if isinstance(profile, str | Path) else profile
