"""Context over time from a table, for what a scenario does not state (`convert --context`)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.errors import FormatError
from xosc_lateral.formats.drives import read_table

if TYPE_CHECKING:
    import pandas as pd

FloatArray = NDArray[np.float64]


def read_context(path: Path) -> Mapping[str, tuple[FloatArray, FloatArray]]:
    """Read a table with a `time` column [s from scenario start] and any context columns, all of them numbers.

    Returns
    -------
    mapping of str to (time, values), shape (n,) each
        NaN values are left out row by row: between what is stated, values are interpolated.

    Raises
    ------
    FormatError
        No `time` column, time that does not increase, a value that is infinite or no number, or no context column.
    """
    table = read_table(path)
    if "time" not in table:
        raise FormatError("no column 'time'", path=path)
    if table["time"].dtype.kind not in "fiu":
        raise FormatError("times have to be numbers", path=path, element="column 'time'")
    time = table["time"].to_numpy(dtype=np.float64)
    if len(time) == 0 or not np.isfinite(time).all() or (np.diff(time) <= 0).any():
        raise FormatError("times have to increase from row to row", path=path, element="column 'time'")
    context = {}
    for name in table.columns:
        if name == "time":
            continue
        if table[name].dtype.kind not in "fiub":
            raise FormatError(_no_number(table[name], time), path=path, element=f"column {str(name)!r}")
        values = table[name].to_numpy(dtype=np.float64)
        if (endless := np.flatnonzero(np.isinf(values))).size:
            what = f"{values[endless[0]]} at {time[endless[0]]:g} s is not finite"
            raise FormatError(what, path=path, element=f"column {str(name)!r}")
        known = np.isfinite(values)
        if known.any():
            context[str(name)] = (time[known], values[known])
    if not context:
        raise FormatError("no column with values besides 'time'", path=path)
    return context


def _no_number(column: pd.Series, time: FloatArray) -> str:
    import pandas as pd

    wrong = np.flatnonzero((pd.to_numeric(column.astype("string"), errors="coerce").isna() & column.notna()).to_numpy())
    row = int(wrong[0]) if len(wrong) else 0
    return f"{str(column.iloc[row])!r} at {time[row]:g} s is no number; leave the column out if it is no context"
