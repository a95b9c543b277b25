"""Whether anything is left for the columns to explain: one check over all of them, at all delays, after the search.

What the refined profile leaves of the drives, white, is regressed on every column's distributed lag [1]_ in turn. The
search asks for one delay and one time constant; this asks for any course over time.

References
----------
.. [1] A. Gasparrini, B. Armstrong, M. G. Kenward, "Distributed lag non-linear models", Statistics in Medicine 29, 2010.
.. [2] H. White, "A heteroskedasticity-consistent covariance matrix estimator", Econometrica 48, 1980.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray
from xosc_lateral.drivers.loop.autocorrelation import Whitener, positions_in_run
from xosc_lateral.drivers.loop.candidates import Family
from xosc_lateral.drivers.loop.dictionary import (
    CROSS_BASIS,
    MIN_SUPPORT_S,
    NULL_DRAWS,
    Quantities,
    beside,
    draw_null,
    orthonormal,
)
from xosc_lateral.drivers.loop.model import Fitted
from xosc_lateral.drivers.loop.significance import LoopSeed, as_one_degree, upper_tail
from xosc_lateral.drivers.model.seeds import generator

# Delays between which a course over time is linear: from what a driver sees ahead to where a bend has long ended. [s]
DELAYS = (-5.0, -3.0, -1.0, 1.0, 3.0, 6.0, 9.0, 12.0, 15.0)
LEVEL = 0.05  # p-value of the check up to which more is left than chance. [-]


@dataclass(frozen=True, slots=True)
class Omnibus:
    """The check's outcome."""

    p_value: float  # That chance explains as much of the innovations by whichever column; 1 without columns.
    columns: tuple[str, ...]  # The column that explains most beside chance.
    share: float  # Of the innovations' variance that its response explains, less what chance does. [-]

    @property
    def silent(self) -> bool:
        """Whether no column predicts what is left."""
        return self.p_value > LEVEL


def weights_of(delays: tuple[float, ...]) -> FloatArray:
    """Of whole seconds in kernels of gain 1 that rise to each delay from the one before and fall to the next, shape
    (delays, n)."""
    seconds = np.arange(delays[0], delays[-1] + 1.0)
    weights = np.stack([np.interp(seconds, delays, unit) for unit in np.eye(len(delays))])
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def tents(values: FloatArray, delays: tuple[float, ...], drive: IndexArray) -> FloatArray:
    """Values by the second, shape (n,), through the kernels of `weights_of`, outermost rows held; shape (n, delays)."""
    first, last = np.searchsorted(drive, drive, side="left"), np.searchsorted(drive, drive, side="right") - 1
    rows, reach = np.arange(len(values)), np.arange(int(delays[0]), int(delays[-1]) + 1)
    shifted = np.stack([values[np.clip(rows - late, first, last)] for late in reach], axis=1)
    return np.asarray(shifted @ weights_of(delays).T)


def smooth_covariance(number: int) -> FloatArray:
    """Of weights whose second differences are independent, and which end at zero on either side."""
    second = np.diff(np.eye(number + 2), 2, axis=0)[:, 1:-1]
    return np.asarray(np.linalg.inv(second.T @ second), dtype=np.float64)


def amid_runs(valid: BoolArray) -> BoolArray:
    """Rows whose delays stay within their run, shape (n,): what a car does where a run ends in a lane change is no
    response."""
    before = positions_in_run(valid)
    after = positions_in_run(valid[::-1])[::-1]
    return np.asarray((before >= DELAYS[-1]) & (after >= -DELAYS[0]))


def courses(
    quantities: Quantities, whitener: Whitener, amid: BoolArray, only: tuple[str, ...] = ()
) -> dict[tuple[str, ...], FloatArray]:
    """What plain shapes of every column, or of one, can do over time: white, orthonormal, shape (rows amid, rank)."""
    found: dict[tuple[str, ...], list[FloatArray]] = {}
    compact, valid = whitener.compact, whitener.valid
    for candidate, values in zip(quantities.candidates, quantities.values, strict=True):
        if candidate.family is Family.PLAIN and (not only or candidate.columns == only):
            moved = tents(values.astype(np.float64), DELAYS, quantities.drive)[valid]
            rows, power = compact.rows(moved)[amid[valid]], float(np.square(moved).sum())
            if float(np.square(rows).sum()) > 1e-9 * power:  # it varies within drives
                found.setdefault(candidate.columns, []).append(rows)
    return {columns: orthonormal(np.concatenate(rows, axis=1), CROSS_BASIS) for columns, rows in found.items()}


def check_remainder(
    fitted: Fitted,
    quantities: Quantities,
    seed: np.random.SeedSequence,
    taken: Collection[tuple[str, ...]] = (),
    *,
    only: tuple[str, ...] = (),
) -> Omnibus:
    """Whether any column not `taken`, or `only` one, predicts what a fit leaves better than the innovations in another
    order."""
    whitener, coarse = fitted.whitener, fitted.coarse
    amid = amid_runs(whitener.valid)
    if amid.sum() < MIN_SUPPORT_S:
        return Omnibus(1.0, (), 0.0)
    known = orthonormal(whitener.rows(fitted.columns)[amid])
    left = beside(known, whitener.rows(coarse.offset - fitted.columns @ fitted.sizes)[amid])
    null = draw_null(left, coarse.drive[amid], generator(seed, LoopSeed.OMNIBUS), NULL_DRAWS)
    rows = np.concatenate([left[:, None], beside(known, null)], axis=1)
    rows /= np.sqrt(np.mean(np.square(rows), axis=0))
    best, largest, chosen, share = -np.inf, np.full(NULL_DRAWS, -np.inf), tuple[str, ...](), 0.0
    for columns, course in courses(quantities, whitener, amid).items():
        basis = orthonormal(beside(known, course), CROSS_BASIS)
        if columns in taken or not basis.shape[1]:
            continue
        explained = np.square(basis.T @ rows).sum(axis=0)
        largest = np.maximum(largest, as_one_degree(explained[1:], basis.shape[1]))
        score = float(as_one_degree(_beside_loud_rows(basis, rows[:, 0]), basis.shape[1]))
        if score > best and (not only or columns == only):
            best, chosen = score, columns
            share = max(0.0, float(explained[0] - basis.shape[1]) / len(left))
    return Omnibus(upper_tail(best, largest), chosen, share) if chosen else Omnibus(1.0, (), 0.0)


def _beside_loud_rows(basis: FloatArray, rows: FloatArray) -> float:
    """Squares that an orthonormal basis explains, or less, beside the squares of the rows it rests on [2]_."""
    scores = basis.T @ rows
    left = rows - basis @ scores
    weighed = basis * (left / max(float(np.sqrt(np.mean(left**2))), 1e-300))[:, None]
    return min(float(scores @ scores), float(scores @ np.linalg.pinv(weighed.T @ weighed) @ scores))
