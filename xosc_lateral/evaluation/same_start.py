"""A fair comparison: real windows of other drivers that begin where the real ones begin.

A sampled window that starts where its real one starts knows something that a random real window does not: comparing
both with the real windows would let every model with a good start look better than real driving. So such windows stand
beside real windows of *other* drivers whose start is the same, and windows that know no start beside any windows of
other drivers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.errors import NotEnoughDataError
from xosc_lateral.evaluation.differences import differences
from xosc_lateral.evaluation.measures import Features

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

NEAREST = 20
"""A stand-in is drawn among so many windows of other drivers whose starts are nearest."""

FLOOR_DRAWS = 4
"""Sets of stand-ins with the same start that are averaged over."""


def windows_with_the_same_start(
    starts: FloatArray,
    drivers: NDArray[np.generic],
    donor_starts: FloatArray,
    donor_drivers: NDArray[np.generic],
    rng: np.random.Generator,
    *,
    count: int = 1,
    nearest: int = NEAREST,
) -> IntArray:
    """For each window `count` others by other drivers that start at nearly the same offset.

    Raises `NotEnoughDataError` when other drivers have fewer than `count` windows.

    Parameters
    ----------
    starts : array, shape (n,)
        First offset of each real window. [m]
    drivers : array, shape (n,)
        Whose it is: a driver's own windows are never taken.
    donor_starts, donor_drivers : array, shape (k,)
        Of the windows to choose from. [m]
    count : int
        Different windows for each, at most `nearest`.
    nearest : int
        Pool to draw from.

    Returns
    -------
    array of int, shape (n, count)
        Rows of the donors. The donor should then be shifted by the few millimetres that its start differs, or not.
    """
    chosen = np.empty((len(starts), count), dtype=np.int64)
    for row, (start, driver) in enumerate(zip(starts.tolist(), drivers.tolist(), strict=True)):
        others = np.flatnonzero(donor_drivers != driver)
        if len(others) < count:
            raise NotEnoughDataError(f"{len(others)} windows of other drivers than {driver}; {count} are needed")
        gaps = np.abs(donor_starts[others] - start)
        pool = others[np.argpartition(gaps, min(nearest, len(others)) - 1)[:nearest]]
        chosen[row] = rng.permutation(pool)[:count]
    return chosen


def real_against_real(
    real: Features, donors: Features, rows: IntArray, donor_rows: IntArray, stand_ins: IntArray | None
) -> dict[str, float]:
    """`differences` of real windows of other drivers.

    Parameters
    ----------
    real, donors : Features
    rows, donor_rows : array of int, shape (n,) and (k,)
        Windows that count.
    stand_ins : array of int, shape (n, draws), optional
        Rows of the donors with the same starts, averaged over the draws; without, all of `donor_rows` at once.
    """
    if stand_ins is None:
        return differences(real, donors, rows, donor_rows)
    draws = [differences(real, donors, rows, stand_ins[:, draw]) for draw in range(stand_ins.shape[1])]
    return {name: float(np.mean([draw[name] for draw in draws])) for name in draws[0]}
