"""Drive tables: CSV, CSV.gz or Parquet with one row per measured moment, read into `Drive`s."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.series import MIN_RUN, Drive
from xosc_lateral.errors import FormatError, NotEnoughDataError
from xosc_lateral.formats.units import factor
from xosc_lateral.segment import CONTEXT_UNITS

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]

TABLE_SUFFIXES = (".csv", ".csv.gz", ".parquet")

MAX_STEP = 0.25
"""Median step of a table that can give 5 Hz. [s]"""

LANE_WIDTHS = (2.0, 6.0)
"""What a lane's median width is believed to be. [m]"""

MAX_MEDIAN_SPEED = 60.0
"""A drive faster than this in the median has its speed in km/h. [m/s]"""

MAX_OUTSIDE = 0.01
"""Share of rows farther than one lane width from the lane centre that is still taken for glitches. [-]"""

CONTRADICTION = 0.05
"""Two rows of one time further apart than this contradict each other [m] ..."""

MAX_CONTRADICTIONS = 0.01
"""... and more than this share of them means several drives in one. [-]"""

MAX_LEVELS = 12
"""A column of whole numbers with at most so many values holds levels, not a quantity."""

_OWN = frozenset({"time", "drive", "offset", "lane_width", "distance_left", "distance_right"})


@dataclass(frozen=True, slots=True)
class ColumnSource:
    """Where a column comes from in a foreign table: its header, and the factor to the standard unit."""

    column: str
    factor: float = 1.0


def parse_map(words: Iterable[str]) -> dict[str, ColumnSource]:
    """Read ``NAME=COLUMN`` or ``NAME=COLUMN:UNIT`` (``speed=v_kmh:km/h``, ``offset=lat:-cm``).

    Raises
    ------
    FormatError
        When a word has no ``=`` or its unit does not fit the column.
    """
    mapping: dict[str, ColumnSource] = {}
    for word in words:
        name, equals, rest = word.partition("=")
        column, colon, unit = rest.rpartition(":")
        if not equals or not name or not rest:
            raise FormatError(f"--map {word!r}: expected NAME=COLUMN or NAME=COLUMN:UNIT")
        if not colon:
            mapping[name] = ColumnSource(rest)
            continue
        try:
            mapping[name] = ColumnSource(column, factor(name, unit))
        except ValueError as error:
            raise FormatError(f"--map {word!r}: {error}") from error
    return mapping


def read_drives(
    paths: str | Path | Sequence[str | Path], mapping: Mapping[str, ColumnSource] | None = None
) -> list[Drive]:
    """Read the drives of one or several tables.

    Parameters
    ----------
    paths : path or sequence of paths
        Tables; the suffix tells the format.
    mapping : mapping of str to ColumnSource, optional
        Standard name -> foreign column; see `parse_map`.

    Returns
    -------
    list of Drive
        In the order of the files and of first appearance; a drive without a name is called after its file. Rows are
        sorted by time, repeated times dropped, rows with a missing value left out (a gap).

    Raises
    ------
    FormatError
        When a file can't be read, a column is missing, or its values can't be in the unit meant.
    NotEnoughDataError
        When a file holds no drive of 10 s.
    """
    files = [Path(path) for path in ([paths] if isinstance(paths, str | Path) else paths)]
    if twice := {str(path) for path in files if files.count(path) > 1}:
        raise FormatError("the table is named twice", path=min(twice))
    drives = [drive for path in files for drive in _drives_of(path, mapping or {})]
    names = [drive.name for drive in drives]
    if len(set(names)) == len(names):
        return drives
    return [_told_apart(drive, names) for drive in drives]


def read_table(path: Path) -> pd.DataFrame:
    """Read a CSV, CSV.gz or Parquet file as it is.

    Raises
    ------
    FormatError
        When it isn't one.
    """
    import pandas as pd

    name = path.name.lower()
    if not name.endswith(TABLE_SUFFIXES):
        raise FormatError(f"not a drive table: expected a name ending in {', '.join(TABLE_SUFFIXES)}", path=path)
    path.stat()  # a missing file is the system's error, in its words
    try:
        if name.endswith(".parquet"):
            return pd.read_parquet(path)
        return pd.read_csv(path, sep=_separator(path), encoding="utf-8-sig", low_memory=False)
    except OSError as error:
        if error.filename is not None or error.errno is not None:
            raise
        raise FormatError(f"can't be read as a table: {error}", path=path) from error
    except (ValueError, pd.errors.ParserError, EOFError, UnicodeDecodeError) as error:
        raise FormatError(f"can't be read as a table: {error}", path=path) from error


def _separator(path: Path) -> str:
    """Comma, semicolon or tab: the commonest in the header."""
    import gzip

    with path.open("rb") as raw:
        packed = raw.read(2) == b"\x1f\x8b"
    with gzip.open(path, "rb") if packed else path.open("rb") as file:
        header = file.readline(1_000_000).decode("utf-8", errors="replace")
    return max(",;\t", key=header.count)


def _drives_of(path: Path, mapping: Mapping[str, ColumnSource]) -> list[Drive]:
    table = _translated(read_table(path), mapping, path)
    if not len(table):
        raise NotEnoughDataError(f"{path}: the table has no rows; {MIN_RUN:g} s of driving are needed")
    columns = _numeric_columns(table, path)
    levels = frozenset(name for name, values in columns.items() if _may_hold_levels(name) and _holds_levels(values))
    _require_columns(columns, path)
    if "drive" in table.columns:
        names, first_rows = _drive_names(table, path)
    else:
        names, first_rows = [path.name.split(".")[0]], [np.arange(len(table))]
    drives = [
        _drive(name, {key: values[rows] for key, values in columns.items()}, levels, path)
        for name, rows in zip(names, first_rows, strict=True)
    ]
    found = [drive for drive in drives if drive is not None]
    if not found:
        raise NotEnoughDataError(
            f"{path}: no drive holds two rows with time, offset and lane width; {MIN_RUN:g} s are needed"
        )
    return found


def _translated(table: pd.DataFrame, mapping: Mapping[str, ColumnSource], path: Path) -> pd.DataFrame:
    import pandas as pd

    table = table.rename(columns=lambda name: str(name).strip())
    if not table.columns.is_unique:
        twice = sorted(set(table.columns[table.columns.duplicated()]))
        raise FormatError(f"column {twice[0]!r} appears twice", path=path, line=1)
    taken = {source.column for source in mapping.values()}
    for name, source in mapping.items():
        if source.column not in table.columns:
            raise FormatError(
                f"no column {source.column!r} for {name}; there are {_listed(table.columns)}", path=path, line=1
            )
    kept = {name: table[name] for name in table.columns if name not in taken and name not in mapping}
    for name, source in mapping.items():
        column = table[source.column]
        kept[name] = column if name == "drive" or source.factor == 1.0 else _scaled(column, source.factor, path, name)
    return pd.DataFrame(kept)


def _scaled(column: pd.Series, by: float, path: Path, name: str) -> pd.Series:
    import pandas as pd

    return pd.Series(_as_numbers(column, path, name) * by, index=column.index)


def _numeric_columns(table: pd.DataFrame, path: Path) -> dict[str, FloatArray]:
    """Columns that hold numbers, as float64; infinite values count as missing."""
    from pandas.api import types

    columns = {}
    for name in table.columns:
        if name == "drive":
            continue
        if name in _OWN or name == "speed" or types.is_numeric_dtype(table[name]) or types.is_bool_dtype(table[name]):
            values = _as_numbers(table[name], path, name)
            values[~np.isfinite(values)] = np.nan
            if name in _OWN or not np.isnan(values).all():
                columns[name] = values
    return columns


def _as_numbers(column: pd.Series, path: Path, name: str) -> FloatArray:
    import pandas as pd
    from pandas.api import types

    if types.is_datetime64_any_dtype(column):
        return np.array((column - column.min()).dt.total_seconds(), dtype=np.float64)
    numbers = pd.to_numeric(column, errors="coerce")
    strange = numbers.isna() & column.notna()
    if strange.any():
        row = int(np.flatnonzero(strange)[0])
        raise FormatError(f"{column.iloc[row]!r} is no number", path=path, line=row + 2, element=f"column {name!r}")
    return np.array(numbers.to_numpy(dtype=np.float64, na_value=np.nan))


def _may_hold_levels(name: str) -> bool:
    """Counts, indices and flags do; a speed that happens to be constant doesn't."""
    return name not in _OWN and CONTEXT_UNITS.get(name, "-") == "-"


def _holds_levels(values: FloatArray) -> bool:
    known = values[~np.isnan(values)]
    return bool(np.all(known == np.round(known)) and len(np.unique(known)) <= MAX_LEVELS)


def _require_columns(columns: Mapping[str, FloatArray], path: Path) -> None:
    if "time" not in columns:
        raise FormatError(
            f"no column 'time'; there are {_listed(columns)} (translate with --map time=COLUMN)", path=path, line=1
        )
    if {"offset", "lane_width"} <= columns.keys() or {"distance_left", "distance_right"} <= columns.keys():
        return
    raise FormatError(
        "needs distance_left and distance_right, or offset and lane_width; "
        f"there are {_listed(columns)} (translate with --map NAME=COLUMN)",
        path=path,
        line=1,
    )


def _drive_names(table: pd.DataFrame, path: Path) -> tuple[list[str], list[NDArray[np.intp]]]:
    codes, names = table["drive"].factorize()
    if (codes < 0).any():
        raise FormatError("no value", path=path, line=int(np.argmax(codes < 0)) + 2, element="column 'drive'")
    order = np.argsort(codes, kind="stable")
    bounds = np.searchsorted(codes[order], np.arange(1, len(names)))
    return [str(name) for name in names], list(np.split(order, bounds))


def _drive(name: str, columns: dict[str, FloatArray], levels: frozenset[str], path: Path) -> Drive | None:
    columns = _in_order(columns, name, path)
    offset, lane_width = _position(columns)
    _check_units(name, columns, offset, lane_width, path)
    narrow = (lane_width < LANE_WIDTHS[0] / 2) | (lane_width > 2 * LANE_WIDTHS[1])
    good = np.isfinite(offset) & np.isfinite(lane_width) & ~narrow
    good[good] = np.abs(offset[good]) <= lane_width[good]
    speed = columns.get("speed")
    if speed is not None and np.isfinite(speed).any():
        good &= np.isfinite(speed)
    if good.sum() < 2:
        return None
    context = {key: values[good] for key, values in columns.items() if key not in _OWN}
    context = {key: values for key, values in context.items() if not np.isnan(values).all()}
    context["lane_width"] = lane_width[good]
    held = frozenset(levels & context.keys())
    return Drive(name, columns["time"][good], offset[good], lane_width[good], context, held, str(path))


def _in_order(columns: dict[str, FloatArray], name: str, path: Path) -> dict[str, FloatArray]:
    """Rows sorted by time, the first of each time kept."""
    known = np.flatnonzero(np.isfinite(columns["time"]))
    order = known[np.argsort(columns["time"][known], kind="stable")]
    columns = {key: values[order] for key, values in columns.items()}
    time = columns["time"]
    if len(time) < 2:
        return columns
    repeated = np.concatenate([[False], np.diff(time) <= 0])
    _check_repeats(columns, repeated, name, path)
    columns = {key: values[~repeated] for key, values in columns.items()}
    steps = np.diff(columns["time"])
    if len(steps) and np.median(steps) > MAX_STEP:
        raise FormatError(
            f"drive {name}: rows are {np.median(steps):.4g} s apart (median), at most {MAX_STEP} s can give 5 Hz; "
            "if the clock is in milliseconds: --map time=COLUMN:ms",
            path=path,
            element="column 'time'",
        )
    return columns


def _check_repeats(columns: Mapping[str, FloatArray], repeated: NDArray[np.bool_], name: str, path: Path) -> None:
    offset, _ = _position(columns)
    later = np.flatnonzero(repeated)
    apart = np.abs(offset[later] - offset[later - 1]) > CONTRADICTION
    if apart.sum() > max(5, MAX_CONTRADICTIONS * len(repeated)):
        raise FormatError(
            f"drive {name}: {int(apart.sum())} of {len(repeated)} rows repeat a time with another offset; if the table "
            "holds several drives it needs a column 'drive'",
            path=path,
            element="column 'time'",
        )


def _position(columns: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Offset, positive to the left (far from the right marking), and lane width. [m]"""
    if {"offset", "lane_width"} <= columns.keys():
        return columns["offset"], columns["lane_width"]
    left, right = columns["distance_left"], columns["distance_right"]
    return (right - left) / 2, right + left


def _check_units(
    name: str, columns: Mapping[str, FloatArray], offset: FloatArray, width: FloatArray, path: Path
) -> None:
    known = np.isfinite(offset) & np.isfinite(width)
    if not known.any():
        return
    median_width = float(np.median(width[known]))
    if not LANE_WIDTHS[0] <= median_width <= LANE_WIDTHS[1]:
        raise FormatError(
            f"drive {name}: the lane is {median_width:.4g} m wide (median), expected {LANE_WIDTHS[0]:g} to "
            f"{LANE_WIDTHS[1]:g} m; name the unit with --map, as in lane_width=COLUMN:cm",
            path=path,
        )
    outside = np.abs(offset[known]) > np.maximum(width[known], LANE_WIDTHS[0])
    if outside.mean() > MAX_OUTSIDE:
        worst = float(np.max(np.abs(offset[known])))
        raise FormatError(
            f"drive {name}: offsets of up to {worst:.4g} m in a lane of {median_width:.3g} m, "
            f"{100 * outside.mean():.0f} % of the rows beyond a whole lane width; name the unit with --map, "
            "as in offset=COLUMN:cm",
            path=path,
        )
    speed = columns.get("speed")
    if speed is not None and np.isfinite(speed).any() and float(np.nanmedian(speed)) > MAX_MEDIAN_SPEED:
        raise FormatError(
            f"drive {name}: speed is {float(np.nanmedian(speed)):.4g} m/s (median), more than {MAX_MEDIAN_SPEED:g}; "
            "if it is in km/h: --map speed=COLUMN:km/h",
            path=path,
            element="column 'speed'",
        )


def _told_apart(drive: Drive, names: Sequence[str]) -> Drive:
    from dataclasses import replace

    if names.count(drive.name) == 1:
        return drive
    return replace(drive, name=f"{drive.source}:{drive.name}")


def _listed(columns: Iterable[object]) -> str:
    names = [str(name) for name in columns]
    return ", ".join(names[:20]) + (f" and {len(names) - 20} more" if len(names) > 20 else "")
