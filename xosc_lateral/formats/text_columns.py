"""Text in tables: numbers with decimal commas, dates and clock times, and words that stand for categories."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]

_COMMA_NUMBER = r"\s*[+-]?(?:\d{1,3}(?:\.\d{3})+|\d*)(?:,\d+)?(?:[eE][+-]?\d+)?\s*"
_CLOCK = r"\s*\d{1,2}:\d{2}(?::\d{2}(?:[.,]\d+)?)?\s*"
_DAY = 86_400.0


def plain_cells(column: pd.Series) -> pd.Series:
    """The column with lists, records and bytes, which Parquet has, as text: then a cell can be compared and named."""
    if column.dtype != object:
        return column
    strange = column.map(lambda cell: isinstance(cell, list | dict | tuple | bytes | np.ndarray))
    return column.mask(strange, column[strange].map(str)) if strange.any() else column


def comma_numbers(column: pd.Series) -> pd.Series | None:
    """Numbers such as ``3,75`` or ``1.234,5``; None if a value is no such number or none has a comma."""
    import pandas as pd

    known = column.dropna().astype(str)
    if known.empty or not known.str.contains(",", regex=False).any() or not known.str.fullmatch(_COMMA_NUMBER).all():
        return None
    plain = known.str.replace(".", "", regex=False).str.replace(",", ".", regex=False)
    return pd.to_numeric(plain, errors="coerce").reindex(column.index)


def seconds_of_text(column: pd.Series) -> FloatArray | None:
    """Dates with times (ISO 8601, ``21.11.2026 14:03:05,12``, ``11/21/2026 2:03 PM``) or clock times, as seconds.

    Counted from the earliest, or from midnight for clock times, which may run past it; NaN where there is none.
    None if a value is neither.
    """
    import pandas as pd

    known = column.dropna().astype(str).str.strip()
    if known.empty:
        return None
    seconds = _clock_seconds(known) if known.str.fullmatch(_CLOCK).all() else _since_the_earliest(known)
    if seconds is None:
        return None
    found = pd.Series(seconds, index=known.index).reindex(column.index)
    return np.array(found, dtype=np.float64)


def _since_the_earliest(known: pd.Series) -> FloatArray | None:
    """Seconds of dates with times; None where one is none."""
    stamps = _stamps(known.str.replace(r"(?<=\d),(?=\d)", ".", regex=True))
    if stamps is None:
        return None
    return np.asarray((stamps - stamps.min()).dt.total_seconds().to_numpy())


def _clock_seconds(clock: pd.Series) -> FloatArray:
    parts = clock.str.replace(",", ".", regex=False).str.split(":", expand=True).astype(float).fillna(0.0).to_numpy()
    seconds = parts @ np.array([3600.0, 60.0, 1.0])[: parts.shape[1]]
    past_midnight = np.cumsum(np.diff(seconds, prepend=seconds[0]) < -0.5 * _DAY)
    return np.asarray(seconds + _DAY * past_midnight)


def _stamps(text: pd.Series) -> pd.Series | None:
    """Times in UTC. Days come first where dots part them; slashes are read the American way where that can be."""
    import pandas as pd

    dotted = bool(text.str.match(r"\d{1,2}\.\d{1,2}\.\d{4}").all())
    for form, day_first in (("ISO8601", False), ("mixed", dotted), ("mixed", not dotted)):
        try:
            return pd.to_datetime(text, format=form, dayfirst=day_first, utc=True)
        except ValueError:
            continue
    return None


def indicators(name: str, column: pd.Series, drives: pd.Series | None, most: int) -> dict[str, FloatArray]:
    """A text column as one column ``name=value`` of 0 and 1 per value.

    Empty if it has more than `most` values, or changes in no drive: then it is a label, not a context.
    """
    codes, values = column.factorize()
    if not 2 <= len(values) <= most or not _changes(codes, drives):
        return {}
    return {f"{name}={value}": (codes == k).astype(np.float64) for k, value in enumerate(values)}


def _changes(codes: NDArray[np.intp], drives: pd.Series | None) -> bool:
    import pandas as pd

    if drives is None:
        return True
    by_drive = pd.Series(codes).groupby(drives.to_numpy())
    return bool((by_drive.max() > by_drive.min()).any())
