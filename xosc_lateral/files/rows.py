"""Which rows of a foreign table count, and what stands for no value in it."""

from __future__ import annotations

import operator
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.texts import composed

USUAL_MARKERS = (32767.0, 32768.0, 65535.0, 2147483647.0, 4294967295.0)
"""Greatest whole numbers of two and four bytes: besides 999, 9999, ... what loggers write where there is no value."""

LEAST_MARKERS = 3  # a usual marker that is there so often, and is far from all else, is taken for one [rows]

CONDITION = re.compile(r"\s*(.+?)\s*(==|!=|>=|<=|>|<)\s*(.+?)\s*")

COMPARED = {
    "==": operator.eq, "!=": operator.ne, ">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt,
}  # fmt: skip


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


def chosen_rows(table: pd.DataFrame, conditions: Sequence[str], path: Path) -> pd.DataFrame:
    """The rows that fulfil all conditions. Raises `FormatError`: no such column; no row is left."""
    for condition in conditions:
        name, sign, value = parse_condition(condition, path)
        if name not in table.columns:
            raise FormatError(f"no column {name!r} for rows = {condition!r}", path=path, line=1)
        cells = table[name]
        is_text = isinstance(value, str)
        left = cells.map(as_word) if is_text else pd.to_numeric(cells, errors="coerce")
        fulfilled = COMPARED[sign](left, str(value).lower() if is_text else value)
        if not fulfilled.any() and len(table):
            raise FormatError(f"no row has {condition}", path=path, element="rows of the mapping")
        table = table[fulfilled]
    return table


def without_markers(table: pd.DataFrame, missing: Sequence[float | str] | None, path: Path) -> pd.DataFrame:
    """The table without what stands for no value.

    Raises `FormatError`: nothing is said about that, and a column has one of the usual markers.
    """
    numbers = [value for value in missing or () if not isinstance(value, str)]
    texts = [value for value in missing or () if isinstance(value, str)]
    changed = {}
    for name in table.columns:
        column = table[name]
        is_number = pd.api.types.is_numeric_dtype(column)
        if missing is None:
            if is_number:
                refuse_marker(column.to_numpy(dtype=np.float64, na_value=np.nan), str(name), path)
            continue
        found = column.isin(numbers)
        if not is_number:
            words = column.astype(str).str.strip()
            found |= pd.to_numeric(words.str.replace(",", "."), errors="coerce").isin(numbers) | words.isin(texts)
        if found.any():
            changed[name] = column.mask(found)
    return table.assign(**changed) if changed else table


def refuse_marker(values: FloatArray, name: str, path: Path) -> None:
    """Refuse a column of numbers with a usual marker for missing values that nobody has named."""
    known, count = np.unique(values[np.isfinite(values)], return_counts=True)
    for k in (0, -1) if len(known) > 1 else ():
        size = abs(float(known[k]))
        nines = size >= 999.0 and size.is_integer() and set(str(int(size))) == {"9"}
        rest = np.abs(np.delete(known, k)).max()
        if (nines or size in USUAL_MARKERS) and count[k] >= LEAST_MARKERS and size > 2.0 * rest:
            what = f"{known[k]:g} in {count[k]} rows: if it stands for no value, the mapping needs"
            raise FormatError(
                f"{what} missing = [{known[k]:g}], else missing = []", path=path, element=f"column {name!r}"
            )
