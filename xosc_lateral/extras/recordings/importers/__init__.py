"""Other people's recordings into the standard drive table: one reader per format.

An importer turns a path into a table with a column `state` (`cuts.KEPT_ROWS`, or why a row is cut), and a record where
it came from, what was cut out and how sure the lane centres are. `importer` takes the cut rows out, and sees to it that
a damaged source ends in one line. `ImportedDrives.write` puts both into one file.
"""

from __future__ import annotations

import hashlib
import inspect
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias, cast

import numpy as np

from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.limits import TIME, Range, context_range
from xosc_lateral.base.note import Note, notes
from xosc_lateral.base.plugins import plugins
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.drives.cleaning import LANE_WIDTHS, MAX_OUTSIDE
from xosc_lateral.drivers.model.plausibility import implausible_rows
from xosc_lateral.extras.recordings.cuts import KEPT_ROWS
from xosc_lateral.files.drives import file_label, file_labels
from xosc_lateral.files.mapping import as_mapping
from xosc_lateral.files.output_tables import harmless_frame
from xosc_lateral.files.source import parsed_hash
from xosc_lateral.files.tables import foreign_errors
from xosc_lateral.workflows.opened import opened, opened_as_one
from xosc_lateral.workflows.options import declare_options, flag
from xosc_lateral.workflows.result import Paths, Result

Importer: TypeAlias = "Callable[..., ImportedDrives | pd.DataFrame]"
"""A source's path, and options by name, into a drive table, or into an `ImportedDrives` with a record of its own."""

IMPORTERS = {
    "dlr-ht": ".dlr_ht:import_dlr_ht",
    "dlr-ut": ".dlr_ut:import_dlr_ut",
    "levelx": ".levelx:import_levelx",
    "openacc": ".openacc:import_openacc",
    "mf4": ".mf4:import_mf4",
    "tracks": ".tracks:import_tracks",
    "table": ".foreign_table:import_table",
    "osi": ".osi:import_osi",
    "fcd": ".fcd:import_fcd",
    "commonroad": ".commonroad:import_commonroad",
}
"""Format -> module here and function that read it, loaded when they are wanted."""

GROUP = "xosc_lateral.importers"  # entry points of further readers


def find_importer(name: str) -> Importer:
    """The reader of a format. Raises `FormatError` if there is none."""
    if name in IMPORTERS:
        module, _, function = IMPORTERS[name].partition(":")
        return cast("Importer", getattr(import_module(module, __name__), function))
    offered: dict[str, Any] = plugins(GROUP)
    if name not in offered:
        raise FormatError(f"no importer {name!r}; there are {', '.join([*IMPORTERS, *offered])}")
    return cast("Importer", offered[name])


def import_drives(
    format: str,  # noqa: A002 (the command line's word)
    source: Paths,
    **options: Any,
) -> ImportedDrives:
    """Read another format.

    Parameters
    ----------
    format : str
        "dlr-ht", "dlr-ut" (DLR Highway, Urban Traffic), "levelx" (highD, exiD), "mf4" (ASAM MDF; extra `mdf`),
        "tracks" (x, y on an OpenDRIVE road), "fcd" (SUMO), "commonroad" (extra `commonroad`),
        "osi" (ASAM OSI traces; extra `osi`), or a plug-in's.
    source : path or paths
        File or folder; "mf4" and some plug-ins take several files.
    options
        Of the format; the command line's ``import FORMAT --help`` lists them.

    Raises
    ------
    FormatError
        An unknown format, or a source that can't be read.
    """
    former = [options.pop(word) for word in ("mapping", "channels") if format in IMPORTERS and word in options]
    if former:  # words of before, of one meaning today
        every = [*map(as_mapping, (*former, options.get("columns")))]
        columns = {name: one for known in every for name, one in known.columns.items()}
        options["columns"] = replace(every[0], columns=columns)
    sources = (opened_as_one(source, options.get("columns")),) if format == "tracks" else tuple(opened(source, "table"))
    if not sources:
        raise ValueError("no source to import")
    if options.get("road") is not None:
        options["road"] = opened_as_one(options["road"], name="road")
    read = find_importer(format)
    made = read(sources[0] if len(sources) == 1 else sources, **_known_options(read, format, options))
    return as_imported(made, format, sources, options)


NUMBERS = {"float": float, "int": int, float: float, int: int}
"""Annotation of an option -> what makes a number of a text."""


def _known_options(read: Callable[..., object], format: str, options: Mapping[str, Any]) -> dict[str, Any]:  # noqa: A002
    """Options that a reader has; texts of the command line become numbers where it says so. Raises `FormatError`."""
    _, *known = inspect.signature(read).parameters.values()
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in known):
        return dict(options)
    kinds, known_values = {parameter.name: parameter.annotation for parameter in known}, {}
    kinds |= {"keep_cut": bool} if "keep_cut" in getattr(read, "__options__", {}) else {}
    for name, value in options.items():
        if name not in kinds:
            raise FormatError(f"importer {format!r} has no setting {name!r}; there are {', '.join(kinds) or 'none'}")
        try:
            known_values[name] = NUMBERS.get(kinds[name], str)(value) if isinstance(value, str) else value
        except ValueError as error:
            raise FormatError(f"importer {format!r}: {name} {value!r} is not a number") from error
    return known_values


@dataclass(frozen=True, kw_only=True)
class ImportRecord:
    """Where a table came from and what was done to it. Lengths in m, times in s."""

    format: str
    source: str
    sha256: str
    version: str = "unknown"
    licence: str
    settings: Mapping[str, object]
    rows: Mapping[str, int]
    vehicles: int
    hours: float
    lanes: Sequence[Mapping[str, object]] = ()
    notes: Sequence[str] = ()
    package_version: str = field(default=__version__)


@dataclass(frozen=True, eq=False, repr=False)
class ImportedDrives(Result):
    """A drive table and where it came from."""

    table: pd.DataFrame
    provenance: ImportRecord
    sources: tuple[Path, ...] = ()

    @property
    def messages(self) -> tuple[Note, ...]:
        """What its record says besides numbers."""
        return notes(self.provenance.notes)

    def headline(self) -> str:
        """One line."""
        known = self.provenance
        return f"{known.source}: {known.vehicles} vehicles, {known.hours:g} h"

    def __str__(self) -> str:
        record = self.provenance
        rows = ", ".join(f"{count} {state}" for state, count in record.rows.items())
        head = f"{record.source}: {record.vehicles} vehicles, {record.hours:g} h kept (rows: {rows})"
        lanes = ["  " + ", ".join(f"{name} {value}" for name, value in lane.items()) for lane in record.lanes]
        return "\n".join([head, *lanes, *self.message_lines(), f"licence: {record.licence}"])

    def to_frame(self) -> pd.DataFrame:
        """The drive table: what `fit` and the other calls take."""
        return self.table

    def to_dict(self) -> dict[str, Any]:
        """Plain values, as ``--json`` prints them: the provenance."""
        return asdict(self.provenance) | {"messages": self.message_records()}

    def csv(self) -> str:
        """The table as text, every digit of it."""
        return str(harmless_frame(self.table).to_csv(index=False, lineterminator="\n"))

    @property
    def files(self) -> tuple[Path, ...]:
        """That were read."""
        return tuple(source for source in self.sources if source.is_file())

    @property
    def usual_table(self) -> str:
        """Called after the first source."""
        return f"{file_label(self.sources[0])}.parquet"

    def _provenance(self) -> dict[str, Any]:
        return asdict(self.provenance)


# ---- what importers make ---------------------------------------------------------------------------------------------
def imported(table: pd.DataFrame, *, sources: Sequence[Path], step: float, **about: Any) -> ImportedDrives:
    """A table with a column `state` and rows `step` seconds apart, and its record; `about`: what can't be counted.

    `dropped` in it: rows of the source that are not in the table, by reason.
    """
    states, kept = table["state"].value_counts(), (table["state"] == KEPT_ROWS).to_numpy()
    drive, names = table["drive"].factorize()
    ends = np.flatnonzero(np.diff(drive)) + 1
    parts = zip(np.split(table["time"].to_numpy(), ends), np.split(kept, ends), strict=True)
    seconds = sum(rows.sum() * (np.median(np.diff(time)) if len(time) > 1 else step) for time, rows in parts)
    counts = Counter({str(state): int(count) for state, count in states.items()}) + Counter(about.pop("dropped", {}))
    record = ImportRecord(
        source=", ".join(source.name for source in sources),
        sha256=hash_files(sources),
        rows=dict(sorted(counts.items())),
        vehicles=len(names),
        hours=round(float(seconds) / 3600.0, 3),
        **about,
    )
    return ImportedDrives(table, record)


def paths_of(sources: Path | Sequence[Path]) -> list[Path]:
    """One or several."""
    return [sources] if isinstance(sources, Path) else list(sources)


def import_each(files: Sequence[Path], read: Callable[[Path, str], ImportedDrives]) -> ImportedDrives:
    """One table and one record of one or several files, each read by its path and label."""
    parts = [read(file, label) for file, label in zip(files, file_labels(files), strict=True)]
    record = parts[0].provenance
    if len(parts) > 1:
        rows = Counter[str]()
        for part in parts:
            rows.update(part.provenance.rows)
        record = replace(
            record,
            source=", ".join(file.name for file in files),
            sha256=hash_files(files),
            rows=dict(rows),
            vehicles=sum(part.provenance.vehicles for part in parts),
            hours=round(sum(part.provenance.hours for part in parts), 3),
            notes=tuple(note for part in parts for note in part.provenance.notes),
        )
    return ImportedDrives(pd.concat([part.table for part in parts], ignore_index=True), record)


KEEP_CUT = flag("--keep-cut", kind=bool | None,
    help="Keep rows that would be cut; the column `state` gives the reason.")  # fmt: skip


def importer(read: Callable[..., ImportedDrives]) -> Callable[..., ImportedDrives]:
    """Options that annotations declare; without the rows that are cut, unless they are kept (`keep_cut`).

    A source, however damaged, ends in one line that names it, never in a table of nonsense.
    """

    @wraps(declare_options(read))
    def within(source: Path | Sequence[Path], *args: Any, keep_cut: bool = False, **settings: Any) -> ImportedDrives:
        path = paths_of(source)[0]
        with foreign_errors(path, "can't be imported"), np.errstate(all="ignore"):
            try:
                made = read(source, *args, **settings)
            except NotEnoughDataError as error:  # said by arithmetic that knows no files
                if path.name in str(error):
                    raise
                raise NotEnoughDataError(f"{path}: {error}") from error
            table, record = made.table, made.provenance
            kept, read_rows = table if keep_cut else _kept_rows(table), len(table)
            if kept.empty:
                first = path / record.source.split(", ")[0] if path.is_dir() else path
                raise NotEnoughDataError(f"{first}: nothing is left of {read_rows} rows ({dict(record.rows)})")
            _refuse_nonsense(kept, path)
        return ImportedDrives(kept, record)

    within.__options__["keep_cut"] = KEEP_CUT  # type: ignore[attr-defined]
    return within


def _kept_rows(table: pd.DataFrame) -> pd.DataFrame:
    """Rows that are not cut, column by column: each goes as soon as it was taken from."""
    kept = (table.pop("state") == KEPT_ROWS).to_numpy()
    return pd.DataFrame({name: table.pop(name).array[kept] for name in list(table.columns)}, copy=False)


def _refuse_nonsense(table: pd.DataFrame, path: Path) -> None:
    """Single glitches of a context column become missing values; more than that is no such column."""
    kept = (table["state"] == KEPT_ROWS).to_numpy() if "state" in table else np.ones(len(table), dtype=np.bool_)
    if not kept.any():
        return
    for name in (name for name in table.columns if table[name].dtype.kind in "fiu"):
        values = table[name].to_numpy(dtype=np.float64)
        believed = {"time": Range(-TIME.value, TIME.value, TIME.reason), **_POSITIONS}.get(name, context_range(name))
        wrong = kept & implausible_rows(name, values, believed)
        if name in _POSITIONS or name == "time":
            wrong |= kept & np.isnan(values)
        if wrong.sum() > (0.0 if name == "time" else MAX_OUTSIDE) * kept.sum():
            value, share = values[int(np.argmax(wrong))], 100 * wrong.sum() / kept.sum()
            what = f"{value:.6g} is not within [{believed.low:g}, {believed.high:g}] ({believed.reason})"
            raise FormatError(f"{what}, {share:.0f} % of the rows", path=path, element=f"column {name!r}")
        if wrong.any():
            table[name] = np.where(wrong, np.nan, values)
    if "lane_width" in table:
        median = float(np.nanmedian(table["lane_width"].to_numpy(dtype=np.float64)[kept]))
        if not LANE_WIDTHS[0] <= median <= LANE_WIDTHS[1]:
            what = f"lanes are {median:.4g} m wide (median), expected {LANE_WIDTHS[0]:g} to {LANE_WIDTHS[1]:g} m"
            raise FormatError(what, path=path, element="column 'lane_width'")


_WITHIN_A_LANE = Range(-2 * LANE_WIDTHS[1], 2 * LANE_WIDTHS[1], "two lanes; further away it is another lane's offset")
_POSITIONS = dict.fromkeys(("offset", "lane_width", "distance_left", "distance_right"), _WITHIN_A_LANE)


def as_imported(
    made: ImportedDrives | pd.DataFrame, name: str, sources: tuple[Path, ...], options: Mapping[str, object]
) -> ImportedDrives:
    """What an importer gave, with what was read: all of it, or a drive table alone, which gets its record here."""
    if isinstance(made, ImportedDrives):
        return replace(made, sources=sources)
    table = made if "drive" in made.columns else made.assign(drive=file_label(sources[0]))
    recorded = imported(
        table.assign(state=KEPT_ROWS),
        format=name,
        sources=[source for source in sources if source.is_file()],
        licence=str(options.get("licence", "your own recording")),
        settings={name: str(value) if isinstance(value, Path) else value for name, value in options.items()},
        step=float(table.groupby("drive", sort=False)["time"].diff().median()),
    )
    return replace(recorded, table=table, sources=sources)


def hash_files(paths: Sequence[Path]) -> str:
    """SHA-256 of one file's bytes; of several, that of their hashes one after the other."""
    if len(paths) == 1:
        return parsed_hash(paths[0])
    return hashlib.sha256("".join(map(parsed_hash, paths)).encode()).hexdigest()
