"""Columns of tables from strangers: which rows count, what stands for no value, and cells as numbers or seconds."""

from __future__ import annotations

import operator
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.texts import composed

USUAL_MARKERS = (32767.0, 32768.0, 65535.0, 2147483647.0, 4294967295.0)
"""Greatest whole numbers of two and four bytes: besides 999, 9999, ... what loggers write where there is no value."""

NAMES_OF_DISTANCES = r"dist|abstand|gap|headway"
FULL_BYTES = tuple(2.0**bits - 1.0 for bits in (8, 10, 12, 16, 24, 32))
MOST_ROWS = 0.5  # a distance that is 0, all nines or full bytes in more of them is none that was measured [-]
LEAST_MARKERS = 3  # a usual marker that is there so often, and is far from all else, is taken for one [rows]
CONDITION = re.compile(r"\s*(.+?)\s*(==|!=|>=|<=|>|<)\s*(.+?)\s*")
COMPARED = {
    "==": operator.eq, "!=": operator.ne, ">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt,
}  # fmt: skip

_COMMA_NUMBER = r"\s*[+-]?(?:\d{1,3}(?:\.\d{3})+|\d*)(?:,\d+)?(?:[eE][+-]?\d+)?\s*"
DAY = 86_400.0  # [s]
FOLD_LENGTHS = (1.0, 3601.0)
"""Clocks that are put back at the end of summer time go back by an hour, less what was not recorded there. [s]"""


CLOCK_TIME = r"\s*\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?\s*"
WITH_ZONE = r".*:\d{2}(?:[.,]\d+)?\s*(?:Z|UTC|GMT|[+-]\d{2}(?::?\d{2})?)$"


def listed(columns: Iterable[object]) -> str:
    """The first twenty names, and how many more there are."""
    names = [str(name) for name in columns]
    return ", ".join(names[:20]) + (f" and {len(names) - 20} more" if len(names) > 20 else "")


# ---- how a text holds its table --------------------------------------------------------------------------------------
class Stated(NamedTuple):
    """What a mapping says of the layout; None: it is found out."""

    separator: str | None = None
    header: int | None = None  # line, counted from 1
    units: int | None = None  # line
    comment: str = "#"  # begins lines that are no data


PLAIN = Stated()


# ---- rows and values that count --------------------------------------------------------------------------------------
def as_word(cell: object) -> str:
    """A cell as a text that can be compared: whole numbers without a point, in lower case."""
    whole = isinstance(cell, float) and cell.is_integer()
    return str(composed(str(int(cell) if whole else cell))).strip().lower()  # type: ignore[call-overload]


def parse_condition(text: str, path: Path) -> tuple[str, str, float | str]:
    """Column, comparison and value of ``quality >= 2``. Raises `FormatError`."""
    match = CONDITION.fullmatch(text)
    if match is None:
        raise FormatError(f"{text!r}, expected a condition such as 'quality >= 2'", path=path, element="rows")
    try:
        return match[1], match[2], float(match[3])
    except ValueError:
        return match[1], match[2], match[3].strip("'\"")


def chosen_rows(
    table: pd.DataFrame, missing: Sequence[float | str] | None, conditions: Sequence[str], path: Path, clock: str
) -> pd.DataFrame:
    """The rows that fulfil all conditions, without what stands for no value; usual markers have to be named.

    `clock`: header of the times, which pass what may be a marker elsewhere.
    """
    marked = {
        name: _without_markers(table[name], _beyond(table[name], missing) if name == clock else missing, path)
        for name in table.columns
    }
    marked = {name: column for name, column in marked.items() if column is not None}
    table = table.assign(**marked) if marked else table
    for condition in conditions:
        name, sign, value = parse_condition(condition, path)
        if name not in table.columns:
            raise FormatError(f"no column {name!r} for rows = {condition!r}", path=path, line=1)
        cells, is_text = table[name], isinstance(value, str)
        left = cells.map(as_word) if is_text else pd.to_numeric(cells, errors="coerce")
        fulfilled = COMPARED[sign](left, str(value).lower() if is_text else value)
        if not fulfilled.any() and len(table):
            raise FormatError(f"no row has {condition}", path=path, element="rows of the mapping")
        table = table[fulfilled]
    return table


def _beyond(column: pd.Series, missing: Sequence[float | str] | None) -> Sequence[float | str] | None:
    """Markers that are not amid a column's other values."""
    if missing is None or not pd.api.types.is_numeric_dtype(column):
        return missing
    rest = column[~column.isin(missing)]
    low, high = rest.min(), rest.max()
    return [value for value in missing if isinstance(value, str) or not low <= value <= high]


def _without_markers(column: pd.Series, missing: Sequence[float | str] | None, path: Path) -> pd.Series | None:
    """The column without what stands for no value; None: as it is."""
    is_number = pd.api.types.is_numeric_dtype(column)
    if missing is None:
        if is_number:
            refuse_marker(column.to_numpy(dtype=np.float64, na_value=np.nan), str(column.name), path)
        return None
    numbers = [value for value in missing if not isinstance(value, str)]
    marked = column.isin(numbers)
    if not is_number:
        words = column.astype(str).str.strip()
        marked |= pd.to_numeric(words.str.replace(",", "."), errors="coerce").isin(numbers)
        marked |= words.isin([value for value in missing if isinstance(value, str)])
    return column.mask(marked) if marked.any() else None


def refuse_marker(values: FloatArray, name: str, path: Path) -> None:
    """Refuse a column of numbers with a usual marker for missing values that nobody has named."""
    if (marker := usual_marker(values, name)) is not None:
        what = f"{marker[0]:g} in {marker[1]}: if it stands for no value, the mapping needs missing = [{marker[0]:g}]"
        raise FormatError(f"{what}, else missing = []", path=path, element=f"column {name!r}")


def usual_marker(values: FloatArray, name: str) -> tuple[float, str] | None:
    """A number of a column that is likely to stand for no value, and in how many rows it is."""
    known, count = np.unique(values[np.isfinite(values)], return_counts=True)
    if len(known) > LEAST_MARKERS and re.search(NAMES_OF_DISTANCES, name, re.IGNORECASE):
        usual = int(count.argmax())
        value = float(known[usual])
        is_full = value == 0.0 or (value.is_integer() and set(str(int(value))) == {"9"}) or value in FULL_BYTES
        if is_full and usual in (0, len(known) - 1) and count[usual] > MOST_ROWS * count.sum():
            return value, f"{100 * count[usual] / count.sum():.0f} % of the rows"
    for k in (0, -1) if len(known) > 1 else ():
        size = abs(float(known[k]))
        nines = size >= 999.0 and size.is_integer() and set(str(int(size))) == {"9"}
        rest = np.abs(np.delete(known, k)).max()
        if (nines or size in USUAL_MARKERS) and count[k] >= LEAST_MARKERS and size > 2.0 * rest:
            return float(known[k]), f"{count[k]} rows"
    return None


# ---- cells as numbers ------------------------------------------------------------------------------------------------
def plain_cells(column: pd.Series) -> pd.Series:
    """The column with lists, records and bytes, which Parquet has, as text: then a cell can be compared and named."""
    if column.dtype != object:
        return column
    strange = column.map(lambda cell: isinstance(cell, list | dict | tuple | bytes | np.ndarray))
    return column.mask(strange, column[strange].map(str)) if strange.any() else column


def comma_numbers(column: pd.Series) -> pd.Series | None:
    """Numbers such as ``3,75`` or ``1.234,5``; None if a value is no such number or none has a comma."""
    known = column.dropna().astype(str)
    if known.empty or not known.str.contains(",", regex=False).any() or not known.str.fullmatch(_COMMA_NUMBER).all():
        return None
    plain = known.str.replace(".", "", regex=False).str.replace(",", ".", regex=False)
    return pd.to_numeric(plain, errors="coerce").reindex(column.index)


def numbers_of(column: pd.Series, path: Path, name: str) -> FloatArray:
    """Numbers, also with decimal commas, and of `time` seconds, shape (n,); NaN where a cell is empty."""
    is_text = not pd.api.types.is_numeric_dtype(column)
    if is_text and name == "time" and (seconds := seconds_of_stamps(column, path)) is not None:
        return seconds
    if pd.api.types.is_datetime64_any_dtype(column):
        return np.array((column - column.min()).dt.total_seconds(), dtype=np.float64)
    numbers = pd.to_numeric(column, errors="coerce")
    if is_text and numbers.isna().any():
        commas = comma_numbers(column)
        numbers = numbers if commas is None else commas
    strange = numbers.isna() & column.notna()
    if strange.any():
        row = int(np.flatnonzero(strange)[0])
        what = "is neither a number nor a time" if name == "time" else "is not a number"
        raise FormatError(f"{column.iloc[row]!r} {what}", path=path, line=row + 2, element=f"column {name!r}")
    return np.array(numbers.to_numpy(dtype=np.float64, na_value=np.nan))


def indicators(name: str, column: pd.Series, drives: pd.Series | None, most: int) -> dict[str, FloatArray]:
    """A text column as ``name=value`` of 0 and 1 per value; nothing of more than `most` values, or fixed in drives."""
    codes, values = column.factorize()
    if not 2 <= len(values) <= most:
        return {}
    if drives is not None:
        by_drive = pd.Series(codes).groupby(drives.to_numpy())
        if not (by_drive.max() > by_drive.min()).any():
            return {}
    return {f"{name}={value}": (codes == k).astype(np.float64) for k, value in enumerate(values)}


# ---- times -----------------------------------------------------------------------------------------------------------
FRAMES = ("frame", "frame_id", "frame_num", "frame_number", "timestep", "time_step")
"""Headers of counts, whose rate is not in them."""


def no_time(headers: Iterable[object], otherwise: str) -> str:
    """How a table without a column of times is translated."""
    counts = (str(header) for header in headers if re.sub(r"\W+", "_", str(header)).lower() in FRAMES)
    count = next(counts, None)
    return otherwise if count is None else f"--map time={count}:1/25 s, where its rate is 25/s"


EPOCHS_BEGIN = 6.3e8  # 1990 [s since 1970]
EPOCHS = {1.0: 1.0, 1e3: 1e-3, 1e6: 1e-6, 1e9: 1e-9}
"""Units in a second -> unit of clocks that count since 1970: recordings are from after 1990 and before 2100. [s]"""


def epoch_factor(time: FloatArray) -> float:
    """Factor to seconds of numbers that count since 1970, by their size; 1 where they don't. [s]"""
    known = time[np.isfinite(time)]
    middle = float(np.median(known)) if len(known) else 0.0
    return next((unit for count, unit in EPOCHS.items() if EPOCHS_BEGIN * count < middle < 4.1e9 * count), 1.0)


def seconds_of_stamps(
    column: pd.Series, path: Path = Path("table"), zone: str = "", drives: pd.Series | None = None
) -> FloatArray | None:
    """Dates with times (ISO 8601, ``21.11.2026 14:03:05,12``, ``11/21/2026 2:03 PM``) or clock times, as seconds.

    Counted from the earliest, or from midnight for clock times, which may run past it; NaN where there is none, None if
    a value is neither. `zone`: of local dates. Local time that goes back, as at the end of summer time, needs one.
    """
    is_date = pd.api.types.is_datetime64_any_dtype(column)
    known = column.dropna() if is_date else column.dropna().astype(str).str.strip()
    if known.empty:
        return None
    whose = np.zeros(len(known), dtype=int) if drives is None else pd.factorize(drives.loc[known.index])[0]
    if not is_date and known.str.fullmatch(CLOCK_TIME).all():
        clock = known.str.replace(",", ".", regex=False).str.split(":", expand=True)
        parts = clock.astype(float).fillna(0.0).to_numpy()
        seconds = parts @ np.array([3600.0, 60.0, 1.0])[: parts.shape[1]]
        for drive in np.unique(whose):
            rows = whose == drive
            seconds[rows] += DAY * np.cumsum(np.diff(seconds[rows], prepend=seconds[rows][0]) < -0.5 * DAY)
        advice = "clock times have no zone: give dates or seconds"
    else:
        stamps, is_local = _stamps(known, is_date)
        if stamps is None:
            return None
        advice = 'name the zone in the mapping: time_zone = "Europe/Berlin"' if is_local and not zone else ""
        if is_local and zone:
            stamps = _in_zone(stamps, whose, zone, path)
        seconds = (stamps - stamps.min()).dt.total_seconds().to_numpy()
    for back in _rows_back(seconds, whose) if advice else ():
        before = float(seconds[np.flatnonzero(whose[:back] == whose[back])[-1]])
        if FOLD_LENGTHS[0] <= before - float(seconds[back]) <= FOLD_LENGTHS[1]:
            what = f"{known.iloc[back]} after {known.iloc[back - 1]}: local time, put back at the end of summer time"
            line = int(known.index[back]) + 2
            raise FormatError(f"{what}? {advice}", path=path, line=line, element="column 'time'")
    return np.array(pd.Series(seconds, index=known.index).reindex(column.index), dtype=np.float64)


def _stamps(known: pd.Series, is_date: bool) -> tuple[pd.Series | None, bool]:
    """Times, those without a zone as if it were UTC, and whether there are such. Days come first where dots part them;
    slashes are read the American way where that can be."""
    if is_date:
        is_local = known.dt.tz is None
        return (known.dt.tz_localize("UTC") if is_local else known.dt.tz_convert("UTC")), is_local
    text = known.str.replace(r"(?<=\d),(?=\d)", ".", regex=True)
    is_local = not text.str.fullmatch(WITH_ZONE).all()
    dotted = bool(text.str.match(r"\d{1,2}\.\d{1,2}\.\d{4}").all())
    for form, day_first in (("ISO8601", False), ("mixed", dotted), ("mixed", not dotted)):
        try:
            return pd.to_datetime(text, format=form, dayfirst=day_first, utc=True), is_local
        except ValueError:
            continue
    return None, is_local


def _rows_back(seconds: FloatArray, whose: NDArray[np.intp]) -> list[int]:
    """Where the clock of a drive goes back, if once only: a table in no order goes back again and again."""
    drives = (np.flatnonzero(whose == drive) for drive in np.unique(whose))
    back = (rows[1:][np.diff(seconds[rows]) < 0.0] for rows in drives)
    return [int(rows[0]) for rows in back if len(rows) == 1]


def _in_zone(stamps: pd.Series, whose: NDArray[np.intp], zone: str, path: Path) -> pd.Series:
    """Local stamps as times: an hour that comes twice is that of summer time, till the drive's clock goes back."""
    seconds = (stamps - stamps.min()).dt.total_seconds().to_numpy()
    summer = np.ones(len(stamps), dtype=bool)
    for back in _rows_back(seconds, whose):
        summer[back:][whose[back:] == whose[back]] = False
    try:
        naive = stamps.dt.tz_localize(None)
        local: pd.Series = naive.dt.tz_localize(ZoneInfo(zone), ambiguous=summer, nonexistent="raise")
    except Exception as error:  # zoneinfo's and pandas' own have no common base
        raise FormatError(f"time_zone {zone!r}: {' '.join(str(error).split())}", path=path) from error
    return local
