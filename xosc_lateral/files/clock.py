"""Time columns into seconds: dates with or without a zone, clock times, and steps that no recording has."""

from __future__ import annotations

from pathlib import Path
from zoneinfo import ZoneInfo

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd

DAY = 86_400.0

FOLD_LENGTHS = (1.0, 3601.0)
"""Clocks that are put back at the end of summer time go back by an hour, less what was not recorded there. [s]"""

ROW_STEPS = (5e-4, 2.0)
"""Median time between two rows of a recording: 2 kHz is more than any driving is logged at, and what comes every 2 s
shows no movement in a lane. [s]"""

CLOCK_TIME = r"\s*\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?\s*"
WITH_ZONE = r".*:\d{2}(?:[.,]\d+)?\s*(?:Z|UTC|GMT|[+-]\d{2}(?::?\d{2})?)$"


def require_row_step(step: float, path: Path) -> None:
    """Refuse a median step of rows that no recording has. [s]"""
    if not ROW_STEPS[0] <= step <= ROW_STEPS[1]:
        unit = "ms, us or ns (time=COLUMN:ms)" if step > 1.0 else "s already"
        what = f"rows are {step:.4g} s apart (median), {ROW_STEPS[0]:g} to {ROW_STEPS[1]:g} s are read"
        raise FormatError(f"{what}; the clock may be in {unit}", path=path, element="column 'time'")


def seconds_of_stamps(
    column: pd.Series, path: Path = Path("table"), zone: str = "", drives: pd.Series | None = None
) -> FloatArray | None:
    """Dates with times (ISO 8601, ``21.11.2026 14:03:05,12``, ``11/21/2026 2:03 PM``) or clock times, as seconds.

    Counted from the earliest, or from midnight for clock times, which may run past it; NaN where there is none.
    None if a value is neither. `zone`: of dates that name none, ``Europe/Berlin``. `drives`: whose rows they are.
    Raises `FormatError`: local time goes back, as at the end of summer time, and no zone says where; no such zone.
    """
    known = column.dropna() if _is_date(column) else column.dropna().astype(str).str.strip()
    if known.empty:
        return None
    whose = np.zeros(len(known), dtype=int) if drives is None else pd.factorize(drives.loc[known.index])[0]
    if not _is_date(known) and known.str.fullmatch(CLOCK_TIME).all():
        clock = known.str.replace(",", ".", regex=False).str.split(":", expand=True)
        parts = clock.astype(float).fillna(0.0).to_numpy()
        seconds = parts @ np.array([3600.0, 60.0, 1.0])[: parts.shape[1]]
        for own in np.unique(whose):
            mine = whose == own
            seconds[mine] += DAY * np.cumsum(np.diff(seconds[mine], prepend=seconds[mine][0]) < -0.5 * DAY)
        _refuse_fold(seconds, whose, known, path, "clock times have no zone: give dates or seconds")
    else:
        stamps, is_local = _stamps(known)
        if stamps is None:
            return None
        if is_local and zone:
            stamps = _in_zone(stamps, whose, zone, path)
        seconds = (stamps - stamps.min()).dt.total_seconds().to_numpy()
        if is_local and not zone:
            what = 'name the zone in the mapping: time_zone = "Europe/Berlin"'
            _refuse_fold(seconds, whose, known, path, what)
    return np.array(pd.Series(seconds, index=known.index).reindex(column.index), dtype=np.float64)


def _is_date(column: pd.Series) -> bool:
    return bool(pd.api.types.is_datetime64_any_dtype(column))


def _stamps(known: pd.Series) -> tuple[pd.Series | None, bool]:
    """Times, those without a zone as if it were UTC, and whether there are such. Days come first where dots part them;
    slashes are read the American way where that can be."""
    if _is_date(known):
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


def _back(seconds: FloatArray, whose: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """By drive, in the order of the file: the rows at which its clock goes back."""
    rows = [np.flatnonzero(whose == own) for own in np.unique(whose)]
    return [mine[1:][np.diff(seconds[mine]) < 0.0] for mine in rows]


def _refuse_fold(seconds: FloatArray, whose: NDArray[np.intp], known: pd.Series, path: Path, advice: str) -> None:
    for back in _back(seconds, whose):
        if len(back) != 1:  # a table in no order goes back again and again
            continue
        row = int(back[0])
        before = float(seconds[np.flatnonzero(whose[:row] == whose[row])[-1]])
        if FOLD_LENGTHS[0] <= before - float(seconds[row]) <= FOLD_LENGTHS[1]:
            what = f"{known.iloc[row]} after {known.iloc[row - 1]}: local time, put back at the end of summer time"
            line = int(known.index[row]) + 2
            raise FormatError(f"{what}? {advice}", path=path, line=line, element="column 'time'")


def _in_zone(stamps: pd.Series, whose: NDArray[np.intp], zone: str, path: Path) -> pd.Series:
    """Local stamps as times: an hour that comes twice is that of summer time, till the drive's clock goes back."""
    seconds = (stamps - stamps.min()).dt.total_seconds().to_numpy()
    summer = np.ones(len(stamps), dtype=bool)
    for back in _back(seconds, whose):
        if len(back) == 1:
            summer[back[0] :][whose[back[0] :] == whose[back[0]]] = False
    try:
        local: pd.Series = stamps.dt.tz_localize(None).dt.tz_localize(
            ZoneInfo(zone), ambiguous=summer, nonexistent="raise"
        )
    except Exception as error:  # zoneinfo's and pandas' own have no common base
        raise FormatError(f"time_zone {zone!r}: {' '.join(str(error).split())}", path=path) from error
    return local
