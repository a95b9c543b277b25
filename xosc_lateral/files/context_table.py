"""Context over time from a table, for what a scenario does not state (`convert --context`)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.base.limits import TIME
from xosc_lateral.drivers.model.plausibility import first_implausible, implausible
from xosc_lateral.files.tables import plain_cells, read_table


class ContextTable(dict[str, tuple[FloatArray, FloatArray]]):
    """Context over time: name -> (time, values), shape (n,) each."""

    sha256: str = ""  # of the file's bytes


def read_context(path: Path) -> ContextTable:
    """Read a table with a `time` column [s from scenario start] and any context columns, all of them numbers.

    Raises `FormatError`: No `time` column, time that does not increase, a value that is infinite, no number or none
    that a road has (`limits`), or no context column.

    NaN values are left out row by row: between what is stated, values are interpolated.
    """
    table, sha256 = read_table(path)
    time = _time_of(table, path)
    context = ContextTable()
    context.sha256 = sha256
    for name in map(str, table.columns.drop("time")):
        values = _values_of(table[name], name, time, path)
        known = np.isfinite(values)
        if known.any():
            context[name] = (time[known], values[known])
    if not context:
        raise FormatError("no column with values besides 'time'", path=path)
    return context


def _time_of(table: pd.DataFrame, path: Path) -> FloatArray:
    """Its times, shape (n,). [s]"""
    if "time" not in table:
        raise FormatError("no column 'time'", path=path)
    if table["time"].dtype.kind not in "fiu":
        raise FormatError("times have to be numbers", path=path, element="column 'time'")
    time = table["time"].to_numpy(dtype=np.float64)
    if len(time) and np.abs(time[[0, -1]]).max() > TIME.value:
        raise FormatError(TIME.refusal(float(np.abs(time[[0, -1]]).max())), path=path, element="column 'time'")
    if len(time) == 0 or not np.isfinite(time).all() or (np.diff(time) <= 0).any():
        raise FormatError("times have to increase from row to row", path=path, element="column 'time'")
    return time


def _values_of(column: pd.Series, name: str, time: FloatArray, path: Path) -> FloatArray:
    """A column's numbers, shape (n,) [own unit]; NaN: not stated."""
    if column.dtype.kind not in "fiub":
        column = plain_cells(column)
        is_number = pd.to_numeric(column.astype("string"), errors="coerce").notna() | column.isna()
        row = int(np.argmin(is_number))
        cell = f"{str(column.iloc[row])!r} at {time[row]:g} s"
        what = f"{cell} is not a number; leave the column out if it is no context"
        raise FormatError(what, path=path, element=f"column {name!r}")
    values = column.to_numpy(dtype=np.float64)
    if (endless := np.flatnonzero(np.isinf(values))).size:
        what = f"{values[endless[0]]} at {time[endless[0]]:g} s is not finite"
        raise FormatError(what, path=path, element=f"column {name!r}")
    if (found := first_implausible(name, values)) is not None:
        what = f"{implausible(name, float(values[found]))} at {time[found]:g} s"
        raise FormatError(what, path=path, element=f"column {name!r}")
    return values
