"""What an import gives: a drive table and the record of where it came from, in one file."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.limits import TIME, Range, context_range
from xosc_lateral.base.version import __version__
from xosc_lateral.drivers.drives.cleaning import LANE_WIDTHS, MAX_OUTSIDE
from xosc_lateral.drivers.model.plausibility import implausible_rows
from xosc_lateral.files.drives import file_label
from xosc_lateral.files.output_tables import harmless_frame, write_table
from xosc_lateral.files.source import parsed_hash
from xosc_lateral.files.tables import foreign_errors
from xosc_lateral.workflows.options import flag
from xosc_lateral.workflows.recordings.cuts import KEPT_ROWS

KEEP_CUT = flag("--keep-cut", help="Keep rows that would be cut; the column `state` gives the reason.")


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


@dataclass(frozen=True, eq=False)
class Imported:
    """A drive table and its provenance."""

    table: pd.DataFrame
    provenance: ImportRecord


def record_of(table: pd.DataFrame, *, sources: Sequence[Path], step: float, **about: Any) -> ImportRecord:
    """Record of a table with its column `state` and rows `step` seconds apart; `about`: what can't be counted."""
    return ImportRecord(
        source=", ".join(source.name for source in sources),
        sha256=hash_files(sources),
        rows={str(state): int(count) for state, count in table["state"].value_counts().sort_index().items()},
        vehicles=int(table["drive"].nunique()),
        hours=round(float((table["state"] == KEPT_ROWS).sum()) * step / 3600.0, 3),
        **about,
    )


def finished(table: pd.DataFrame, *, keep_cut: bool, sources: Sequence[Path], **about: Any) -> Imported:
    """A table with its record, see `record_of`; without the rows that are cut, unless they are wanted."""
    return without_cut(table, record_of(table, sources=sources, **about), keep_cut, sources[0])


def without_cut(table: pd.DataFrame, record: ImportRecord, keep_cut: bool, source: Path) -> Imported:
    """The table without the rows that are cut and without `state`, unless wanted. Raises `NotEnoughDataError`."""
    kept = table if keep_cut else table[table["state"] == KEPT_ROWS].drop(columns="state")
    if kept.empty:
        raise NotEnoughDataError(f"{source}: nothing is left of {len(table)} rows ({dict(record.rows)})")
    return Imported(kept.reset_index(drop=True), record)


def paths_of(sources: Path | Sequence[Path]) -> list[Path]:
    """One or several."""
    return [sources] if isinstance(sources, Path) else list(sources)


def import_each(sources: Path | Sequence[Path], read: Callable[[Path], Imported], *, keep_cut: bool) -> Imported:
    """One table and one record of one or several files, each read with what would be cut."""
    files = paths_of(sources)
    parts = [read(file) for file in files]
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
    table = pd.concat([part.table for part in parts], ignore_index=True)
    return without_cut(table, record, keep_cut, files[0])


Importer = TypeVar("Importer", bound="Callable[..., Imported | pd.DataFrame]")


def guarded(read: Importer) -> Importer:
    """An importer whose source, however damaged, ends in one line that names it, never in a table of nonsense."""

    @wraps(read)
    def within(source: Path | Sequence[Path], *args: Any, **settings: Any) -> Imported | pd.DataFrame:
        path = paths_of(source)[0]
        with foreign_errors(path, "can't be imported"), np.errstate(all="ignore"):
            try:
                made = read(source, *args, **settings)
            except NotEnoughDataError as error:  # said by arithmetic that knows no files
                if path.name in str(error):
                    raise
                raise NotEnoughDataError(f"{path}: {error}") from error
            _refuse_nonsense(made.table if isinstance(made, Imported) else made, path)
        return made

    return cast(Importer, within)


def _refuse_nonsense(table: pd.DataFrame, path: Path) -> None:
    """Single glitches of a context column become missing values; more than that is no such column."""
    kept = (table["state"] == KEPT_ROWS).to_numpy() if "state" in table else np.ones(len(table), dtype=np.bool_)
    if not kept.any():
        return
    for name in table.columns:
        if table[name].dtype.kind not in "fiu":
            continue
        values = table[name].to_numpy(dtype=np.float64)
        believed = {"time": Range(-TIME.value, TIME.value, TIME.reason), **_POSITIONS}.get(name, context_range(name))
        wrong = kept & implausible_rows(name, values, believed)
        if name in _POSITIONS or name == "time":
            wrong |= kept & np.isnan(values)
        allowed = 0.0 if name == "time" else MAX_OUTSIDE
        if wrong.sum() > allowed * kept.sum():
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
    made: Imported | pd.DataFrame,
    format: str,  # noqa: A002 (the record's own word)
    sources: Sequence[Path],
    options: Mapping[str, object],
) -> Imported:
    """What an importer gave: all of it, or a drive table alone, which gets its record here."""
    if isinstance(made, Imported):
        return made
    table = made if "drive" in made.columns else made.assign(drive=file_label(sources[0]))
    record = record_of(
        table.assign(state=KEPT_ROWS),
        format=format,
        sources=[source for source in sources if source.is_file()],
        licence=str(options.get("licence", "your own recording")),
        settings={name: str(value) if isinstance(value, Path) else value for name, value in options.items()},
        step=float(table.groupby("drive", sort=False)["time"].diff().median()),
    )
    return Imported(table, record)


def write_imported(imported: Imported, path: Path) -> None:
    """Write Parquet (provenance in its metadata) or CSV (provenance in a file beside it), whole or not at all."""
    table = imported.table
    write_table(
        path,
        asdict(imported.provenance),
        frame=lambda: table,
        text=lambda: harmless_frame(table).to_csv(index=False, lineterminator="\n"),
    )


def hash_files(paths: Sequence[Path]) -> str:
    """SHA-256 of one file's bytes; of several, that of their hashes one after the other."""
    if len(paths) == 1:
        return parsed_hash(paths[0])
    return hashlib.sha256("".join(map(parsed_hash, paths)).encode()).hexdigest()
