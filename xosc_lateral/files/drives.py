"""Drive tables: CSV, CSV.gz or Parquet with one row per measured moment, read into `Drive`s."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.segment import CONTEXT_UNITS
from xosc_lateral.drivers.drives import evidence
from xosc_lateral.drivers.drives.cleaning import (
    DRIVE_COLUMNS,
    LANE_WIDTHS,
    MAX_MEDIAN_SPEED,
    MAX_OUTSIDE,
    RESOLUTION,
    RUN,
    VALID_BELOW,
    clean_drive,
    position,
)
from xosc_lateral.drivers.drives.drive import MIN_RUN, Drive
from xosc_lateral.drivers.drives.identity import clock_runs
from xosc_lateral.drivers.model.plausibility import drives_nobody, implausible, implausible_rows
from xosc_lateral.files.columns import (
    as_word,
    chosen_rows,
    comma_numbers,
    epoch_factor,
    indicators,
    listed,
    no_time,
    numbers_of,
    plain_cells,
    seconds_of_stamps,
)
from xosc_lateral.files.mapping import ColumnSource, MappingLike, TableMapping, as_mapping, standard_sources
from xosc_lateral.files.remote import inputs_of
from xosc_lateral.files.tables import frame_of, read_table

LABELS = ("drive", "driver", "recording")  # columns that say which drive a row is of, and whose
STANDARD = {
    **{name: (name,) for name in (*sorted(DRIVE_COLUMNS - {RUN, VALID_BELOW, RESOLUTION}), *CONTEXT_UNITS)},
    "recording": ("recording", "recording_id", "case_id", "scenario_id"),
    "drive": ("drive", "drive_id", "trip", "trip_id", "session", "session_id", "ride", "ride_id", "vin", "vehicle_id"),
}
"""Name -> headers, in any spelling and with units."""

WHEEL_WIDTH = 2.5
"""Lanes of roads driven at 40 km/h and more are wider but for the left one at roadworks; from the wheels of a car
(1.5 to 1.6 m apart) one of 3.0 to 3.75 m has 1.4 to 2.25 m. [m]"""

MAX_LEVELS = 12  # a column of whole numbers with at most so many values holds levels, not a quantity


def read_drives(
    paths: str | Path | Sequence[str | Path | Drive], mapping: MappingLike | None = None,
    lost: Counter[str] | None = None,
) -> list[Drive]:  # fmt: skip
    """Read the drives of one or several tables, in the order of the files and of first appearance.

    `mapping`: what columns are called, and how tables are written, see `files.mapping`. A drive without a name is
    called after its file. Rows are sorted by time, repeated times dropped, rows with a missing value left out (a gap);
    `lost` counts those in no drive, by reason.
    """
    known = as_mapping(mapping)
    every = [paths] if isinstance(paths, str | Path) else paths
    files = [path for source in every for path in ([source] if isinstance(source, Drive) else inputs_of([source]))]
    named = [path for path in files if not isinstance(path, Drive)]
    if twice := {str(path) for path in named if named.count(path) > 1}:
        raise FormatError("the table is named twice", path=min(twice))
    read = list[Drive]()
    for source in files:
        read += (
            [source] if isinstance(source, Drive) else drives_of_table(read_table(source, known), known, source, lost)
        )
    return with_distinct_names(read)


def with_distinct_names(drives: Sequence[Drive]) -> list[Drive]:
    """Drives of several tables; those of one name are called by their table as well, of one table's by number."""
    names = Counter(drive.name for drive in drives)
    tables = [*dict.fromkeys(Path(drive.source) for drive in drives)]
    home = dict(zip(tables, file_labels(tables), strict=True))
    apart = [one.name if names[one.name] == 1 else f"{home[Path(one.source)]}:{one.name}" for one in drives]
    seen, again = Counter[str](), Counter(apart)
    for k, name in enumerate(apart):
        seen[name] += 1
        apart[k] = name if again[name] == 1 else f"{name} #{seen[name]}"
    return [
        drive if name == drive.name else replace(drive, name=name) for drive, name in zip(drives, apart, strict=True)
    ]


def drives_of_table(
    table: pd.DataFrame, mapping: MappingLike, path: Path | str = "DataFrame", lost: Counter[str] | None = None,
    *, is_translated: bool = False,
) -> list[Drive]:  # fmt: skip
    """Drives of a table that is in memory; `path` is what messages call it. Else see `read_drives`."""
    known, lost = as_mapping(mapping), Counter[str]() if lost is None else lost
    try:
        if not is_translated:
            read, table = len(table), translated(frame_of(table), known, Path(path))
            lost["not chosen"] += read - len(table)
        return _drives_of(table, known, Path(path), lost)
    except FormatError as error:
        message = f"{error.element or ''} {error.what}"
        if ("column" not in message and "--map" not in message) or not Path(path).suffix:
            raise
        what = f"{error.what}; all columns: xosc-lateral check {Path(path).name} --report PAGE.html"
        raise FormatError(what, path=error.path, line=error.line, element=error.element) from error


def _drives_of(table: pd.DataFrame, mapping: TableMapping, path: Path, lost: Counter[str]) -> list[Drive]:
    if not len(table):
        raise NotEnoughDataError(f"{path}: the table has no rows; {MIN_RUN:g} s of driving are needed")
    columns: dict[str, FloatArray] = {}
    for name in table.columns:
        columns |= {} if name in LABELS else _numeric_columns(name, table, path)
    if "time" not in columns:
        advice = no_time(table.columns, "--map time=COLUMN")
        what = f"no column 'time'; there are {listed(columns)} (translate with {advice})"
        raise FormatError(what, path=path, line=1)
    if not ({"offset", "lane_width"} <= columns.keys() or {"distance_left", "distance_right"} <= columns.keys()):
        needed = "needs distance_left and distance_right, or lane_width and one of these or offset"
        what = f"{needed}; there are {listed(columns)} (translate with --map NAME=COLUMN)"
        what += "; x and y are in lanes with a road: fit --road, import tracks" if {"x", "y"} <= columns.keys() else ""
        raise FormatError(what, path=path, line=1)
    levels = frozenset(name for name, values in columns.items() if _holds_levels(name, values))
    every = list(rows_of_drives(table, path))
    named = {name for name, source in mapping.columns.items() if source.unit}
    require_evidence(columns, every, path, named | ({"missing"} if mapping.missing is not None else set()))
    drives = []
    for name, rows in every:
        drive = clean_drive(name, {key: values[rows] for key, values in columns.items()}, levels, path, lost)
        drivers = list(table["driver"].iloc[rows].dropna().unique()) if "driver" in table.columns else []
        if len(drivers) > 1:
            what = f"drive {name}: {drivers[0]} and {drivers[1]}; a drive has one driver"
            raise FormatError(what, path=path, element="column 'driver'")
        if drive is not None:
            drives.append(replace(drive, driver=str(drivers[0]) if len(drivers) else ""))
    if not drives:
        what = f"no drive has two rows with time, offset and lane width; {MIN_RUN:g} s are needed"
        raise NotEnoughDataError(f"{path}: {what}")
    return drives


def require_evidence(
    columns: Mapping[str, FloatArray], drives: Sequence[tuple[str, NDArray[np.intp]]], path: Path,
    named: Collection[str],
) -> None:  # fmt: skip
    """Refuse drives whose rows contradict their clock, each other, or the unit and side of their offset.

    `named`: columns whose unit a mapping states, and "missing", if it states what stands for no value.
    """
    offset, width = position(columns)
    wander, jumps = [np.zeros(0)], [np.zeros((4, 0))]
    for name, rows in drives:
        mine = rows[np.isfinite(columns["time"][rows])]
        mine = mine[np.argsort(columns["time"][mine], kind="stable")]
        time = columns["time"][mine]
        if len(mine) < 2:
            continue
        if wrong := evidence.of_clock(time, is_named="time" in named):
            raise FormatError(f"drive {name}: {wrong}", path=path, element="column 'time'")
        wander.append(evidence.wander(time, offset[mine]))
        if (np.diff(time) > 0.0).all() and (count := evidence.in_turns(offset[mine])) > 1:
            what = f"rows of {count} vehicles or drives in turns; which is whose, drive=COLUMN says"
            raise FormatError(f"drive {name}: {what}", path=path, element="column 'offset'")
        lane = columns["lane_index"][mine] if "lane_index" in columns else None
        if "missing" not in named and (wrong := evidence.of_marker(offset[mine])):
            raise FormatError(f"drive {name}: {wrong}", path=path, element="column 'offset'")
        jumps.append(evidence.jumps_of(time, offset[mine], width[mine], lane))
    speed, most = columns.get("speed", np.zeros(0)), MAX_MEDIAN_SPEED * (2.0 if "speed" in named else 1.0)
    median = float(np.nanmedian(speed)) if np.isfinite(speed).any() else 0.0
    if median < 0.0:
        what = f"is {median:.4g} m/s (median): it counts backwards, speed=COLUMN:-m/s turns the sign"
        raise FormatError(what, path=path, element="column 'speed'")
    if median > most:
        what = f"is {median:.4g} m/s (median), more than {most:g}; if it is in km/h: --map speed=COLUMN:km/h"
        what += (
            ", in mph: speed=COLUMN:mph" if "speed" in named else ", in mph: speed=COLUMN:mph, else speed=COLUMN:m/s"
        )
        raise FormatError(what, path=path, element="column 'speed'")
    known = np.isfinite(offset + width)
    if known.any():
        farthest, median = float(np.quantile(np.abs(offset[known]), 0.999)), float(np.median(width[known]))
        wrong = evidence.of_lane_changes(np.concatenate(jumps, axis=1), farthest)
        wrong = wrong or (None if "offset" in named else evidence.of_places(offset, width))
        if wrong:
            raise FormatError(wrong, path=path, element="column 'offset'")
        in_metres = farthest <= median and LANE_WIDTHS[0] <= median <= LANE_WIDTHS[1]  # else that is said
        if wrong := evidence.of_wander(np.concatenate(wander)) if in_metres and "time" not in named else None:
            raise FormatError(wrong, path=path, element="column 'time'")


def translated(table: pd.DataFrame, mapping: TableMapping, path: Path) -> pd.DataFrame:
    """The table under standard names and in standard units; what is not mapped stays as it is."""
    table = table.rename(columns=lambda name: str(name).strip())
    if not table.columns.is_unique:
        twice = sorted(set(table.columns[table.columns.duplicated()]))
        raise FormatError(f"column {twice[0]!r} appears twice", path=path, line=1)
    for name, source in mapping.columns.items():
        if source.column not in table.columns:
            what = f"no column {source.column!r} for {name}; there are {listed(table.columns)}"
            raise FormatError(what, path=path, line=1)
        if source.column in STANDARD and name not in STANDARD:
            what = f"{name}={source.column}: the standard name comes first, {source.column}={name}"
            raise FormatError(what, path=path, element="--map")
    table = chosen_rows(
        table, mapping.missing, mapping.rows, path, mapping.columns.get("time", ColumnSource("time")).column
    )
    taken = {source.column for source in mapping.columns.values()} | mapping.columns.keys()
    free = [name for name in table.columns if name not in taken]
    usual = standard_sources(free, {name: usual for name, usual in STANDARD.items() if name not in taken}, path)
    named = {source.column: (name, source) for name, source in usual.items() if name not in free}
    sources = dict(named.get(name, (name, ColumnSource(name))) for name in free) | dict(mapping.columns)
    kept = {}
    for name, source in sources.items():
        column = mapping.numbers(name, plain_cells(table[source.column]), path)
        if name not in LABELS and not pd.api.types.is_numeric_dtype(column):
            column = column if (commas := comma_numbers(column)) is None else commas
        if name not in LABELS and source.factor != 1.0:
            column = pd.Series(numbers_of(column, path, name) * source.factor, index=column.index)
        kept[name] = column
    if "time" in kept and not pd.api.types.is_numeric_dtype(kept["time"]):
        seconds = seconds_of_stamps(kept["time"], path, mapping.time_zone, kept.get("drive"))
        kept["time"] = kept["time"] if seconds is None else pd.Series(seconds, index=table.index)
    if "time" in kept and pd.api.types.is_numeric_dtype(kept["time"]) and "time" not in mapping.columns:
        since_1970 = epoch_factor(kept["time"].to_numpy(dtype=np.float64, na_value=np.nan))
        kept["time"] = kept["time"] if since_1970 == 1.0 else kept["time"] * since_1970
    recorded = {name: value for name, value in mapping.recorded.items() if name not in kept}
    return from_middle(pd.DataFrame(kept, copy=False).assign(**recorded), mapping, path)


def from_middle(table: pd.DataFrame, mapping: TableMapping, path: Path) -> pd.DataFrame:
    """Distances to the markings; those of wheels (`wheel_track`) as offset and width: narrow lanes ask for it."""
    sides = [name for name in ("distance_left", "distance_right") if name in table.columns]
    if len(sides) == 1 and "lane_width" in table.columns and "offset" not in table.columns:
        distance, width = (numbers_of(table[name], path, name) for name in (*sides, "lane_width"))
        aside = 0.5 * (width - (mapping.wheel_track or 0.0)) - distance
        return table.drop(columns=sides).assign(offset=aside if sides[0] == "distance_left" else -aside)
    if len(sides) < 2:
        return table
    left, right = (numbers_of(table[name], path, name) for name in ("distance_left", "distance_right"))
    for name, values in (("distance_left", left), ("distance_right", right)):
        if np.isfinite(values).any() and float(np.nanmedian(values)) < 0.0:
            what = "distances are mostly negative: both count outwards from the vehicle"
            raise FormatError(f"{what}; turn the sign, {name}=COLUMN:-m", path=path, element=f"column {name!r}")
    if mapping.wheel_track is None:
        known = (left + right)[np.isfinite(left + right)]
        median = float(np.median(known)) if len(known) else 0.0
        if 0.5 * LANE_WIDTHS[0] <= median < WHEEL_WIDTH:
            what = f"lanes of {median:.2f} m (median): distances may be from the wheels or sides, not from the middle"
            advice = "the mapping says how far apart these are, wheel_track = 1.6, or 0"
            raise FormatError(f"{what}; {advice}", path=path, element="columns 'distance_left', 'distance_right'")
        return table
    width = left + right + mapping.wheel_track
    return table.drop(columns=["distance_left", "distance_right"]).assign(offset=0.5 * (right - left), lane_width=width)


def _numeric_columns(name: str, table: pd.DataFrame, path: Path) -> dict[str, FloatArray]:
    """A column as float64, or as one column per category; nothing where it holds labels.

    Infinite values are missing, but where nobody is within reach; so are glitches of a context column, unless it is
    full.
    """
    column = table[name]
    is_needed = name in (*DRIVE_COLUMNS, "speed")
    if not is_needed and not pd.api.types.is_numeric_dtype(column):
        if column.isna().all():
            return {name: np.full(len(table), np.nan)}
        return indicators(name, column, table.get("drive"), MAX_LEVELS)
    is_plain = column.dtype == np.float64
    values = np.asarray(column, dtype=np.float64) if is_plain else numbers_of(column, path, name)
    if (endless := np.isinf(values)).any():
        values = np.where(endless & ~drives_nobody(name, values), np.nan, values)
    wrong = np.zeros(0, dtype=np.bool_) if name in DRIVE_COLUMNS else implausible_rows(name, values)
    # a wrong unit of speed is said per drive, with what to do
    if wrong.any() and not (name == "speed" and np.nanmedian(values) > MAX_MEDIAN_SPEED):
        if wrong.mean() > MAX_OUTSIDE:
            row = int(np.argmax(wrong))
            what = f"{implausible(name, float(values[row]))}, and {100 * wrong.mean():.0f} % of the rows are not"
            raise FormatError(f"{what}; name the unit with --map", path=path, line=row + 2, element=f"column {name!r}")
        values = np.where(wrong, np.nan, values)
    return {name: values}


def _holds_levels(name: str, values: FloatArray) -> bool:
    """Counts, indices and flags do; a speed that happens to be constant doesn't."""
    if name in DRIVE_COLUMNS or CONTEXT_UNITS.get(name, "-") != "-":
        return False
    known = values[~np.isnan(values)]
    return bool(np.all(known == np.round(known)) and len(np.unique(known)) <= MAX_LEVELS)


def rows_of_drives(table: pd.DataFrame, path: Path, label: str | None = None) -> Iterator[tuple[str, NDArray[np.intp]]]:
    """Name and rows of each drive in file order: a recording's drive, or what of it a clock counts that begins again.

    `label`: the file's, by which drives without a name are called.
    """
    labels = [name for name in ("recording", "drive") if name in table.columns]
    codes, names = np.zeros(len(table), dtype=np.int64), [label or file_label(path)]
    for name in labels:
        if (missing := table[name].isna()).any():
            raise FormatError("no value", path=path, line=int(np.argmax(missing)) + 2, element=f"column {name!r}")
    if labels:
        codes, names = _named(table[labels[-1]], str)
        if len(labels) > 1 and table["recording"].nunique() > 1:
            of, recordings = _named(table["recording"], as_word)
            codes, pairs = pd.factorize(of * len(names) + codes)
            names = [f"{recordings[one // len(names)]}:{names[one % len(names)]}" for one in pairs.tolist()]
    time = table["time"] if "time" in table else pd.Series(np.zeros(len(table)))
    runs = clock_runs(np.asarray(time) if time.dtype == np.float64 else numbers_of(time, path, "time"), codes)
    runs = runs if runs.any() else runs[:0]
    order = np.argsort(codes, kind="stable")
    bounds = np.searchsorted(codes[order], np.arange(1, len(names)))
    order = order.astype(np.min_scalar_type(-len(order) - 1))
    del codes, time  # of long tables, what is kept here counts
    for name, mine in zip(names, np.split(order, bounds), strict=True):
        for number, run in enumerate(np.unique(runs[mine]).tolist() if len(runs) else [0]):
            yield (name if number == 0 else f"{name}#{number + 1}"), mine[runs[mine] == run] if len(runs) else mine


def _named(column: pd.Series, word: Callable[[object], str]) -> tuple[NDArray[np.intp], list[str]]:
    """Which name each row has, and the names, in the order in which they come."""
    codes, every = column.factorize()
    again, names = pd.factorize(np.array([word(one) for one in every], dtype=object))
    return again[codes], list(names)


# ---- what drives are called: a drive is its file, and its own label where the file gives one -------------------------
FORMAT_ENDINGS = (
    ".csv.gz",
    ".csv.zst",
    ".feather",
    ".arrow",
    ".csv",
    ".parquet",
    ".mf4",
    ".mdf",
    ".dat",
    ".mcap",
    ".osi",
    ".xml",
)
"""Ends of file names that say how a file is written; whatever else has a dot belongs to the name (``2026.11.21``)."""


def file_label(path: Path) -> str:
    """A file's name without the ending that gives its format."""
    ending = next((end for end in FORMAT_ENDINGS if path.name.lower().endswith(end)), "")
    return path.name[: len(path.name) - len(ending)] or path.name


def file_labels(paths: Sequence[Path]) -> list[str]:
    """Different labels for several files: with folders where names are equal, whole where these are."""
    if twice := [path for path in paths if paths.count(path) > 1]:
        raise FormatError("the file is named twice", path=twice[0])
    short = [file_label(path) for path in paths]
    longer = [str(path.parent / label) for path, label in zip(paths, short, strict=True)]
    return [
        label if short.count(label) == 1 else long if longer.count(long) == 1 else str(path)
        for path, label, long in zip(paths, short, longer, strict=True)
    ]


def labels_apart(paths: Sequence[Path], labels: Sequence[Iterable[str]]) -> list[dict[str, str]]:
    """For every file, its drives' own labels and what they are called beside the others': with the file where two
    files have the same."""
    every = [label for own in labels for label in set(own)]
    return [
        {label: label if every.count(label) == 1 else f"{name}:{label}" for label in own}
        for name, own in zip(file_labels(paths), labels, strict=True)
    ]
