"""Columns of numbers for a page: rounded, stored as differences, a fraction of the size of decimal text.

A packed column is ``{"r": resolution, "b": first, "w": 2 or 4, "d": base64}``: `d` holds the differences between
successive values in units of the resolution, as little-endian integers of `w` bytes. ``static/page.js`` unpacks it.
"""

from __future__ import annotations

import base64
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

MILLIMETRE = CENTIMETRE_PER_SECOND = 1e-3
"""Resolution of positions [m]; of speeds a hundred times finer than anybody reads them. [m/s]"""

MILLIRADIAN_TENTH = 1e-4
"""Resolution of headings: 0.5 mm at the end of a car of 5 m. [rad]"""


def pack(values: ArrayLike, resolution: float) -> dict[str, Any]:
    """Pack one column.

    Parameters
    ----------
    values : array, shape (n,)
        Finite.
    resolution : float
        Values come back as whole multiples of it. [unit of the values]
    """
    whole = np.rint(np.asarray(values, dtype=np.float64) / resolution).astype(np.int64)
    if not len(whole):
        return {"r": resolution, "b": 0, "w": 2, "d": ""}
    steps = np.diff(whole)
    is_small = not len(steps) or np.abs(steps).max() <= np.iinfo(np.int16).max
    data = steps.astype("<i2" if is_small else "<i4").tobytes()
    return {
        "r": resolution,
        "b": int(whole[0]),
        "w": 2 if is_small else 4,
        "d": base64.b64encode(data).decode("ascii"),
    }


def unpack(column: dict[str, Any]) -> NDArray[np.float64]:
    """The values of a packed column, shape (n,): what the page's script does."""
    steps = np.frombuffer(base64.b64decode(column["d"]), dtype=f"<i{column['w']}").astype(np.int64)
    return np.asarray(np.concatenate(([0], np.cumsum(steps))) + column["b"]) * float(column["r"])
