"""What columns can explain of the mean that is left after the search, by any course over time.

The check regresses what the refined profile leaves of the drives, white, on every column's distributed lag [1]_ in
turn; it asks for the mean alone, not for the spread.

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
from xosc_lateral.drivers.model.seeds import generator
from xosc_lateral.extras.loop.autocorrelation import Whitener, positions_in_run
from xosc_lateral.extras.loop.candidates import Family
from xosc_lateral.extras.loop.dictionary import (
    CROSS_BASIS,
    MIN_SUPPORT_S,
    Quantities,
    beside,
    of_unit_variance,
    orthonormal,
)
from xosc_lateral.extras.loop.model import Fitted
from xosc_lateral.extras.loop.significance import NULL_DRAWS, LoopSeed, as_one_degree, draw_null, upper_tail

# Delays between which a course over time is linear: from what a driver sees ahead to where a bend has long ended. [s]
DELAYS = (-5.0, -3.0, -1.0, 1.0, 3.0, 6.0, 9.0, 12.0, 15.0)
SECONDS = tuple(range(int(DELAYS[0]), int(DELAYS[-1]) + 1))  # From the first delay to the last. [s]
_TENTS = np.stack([np.interp(SECONDS, DELAYS, unit) for unit in np.eye(len(DELAYS))])
# Weights of these in kernels of gain 1 that rise to each delay from the one before and fall to the next.
KERNELS = _TENTS / _TENTS.sum(axis=1, keepdims=True)
_CURVATURE = np.diff(np.eye(len(DELAYS) + 2), 2, axis=0)[:, 1:-1]
# Of weights whose second differences are independent, and which end at zero on either side.
SMOOTH_COVARIANCE = np.asarray(np.linalg.inv(_CURVATURE.T @ _CURVATURE), dtype=np.float64)
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


def tents(values: FloatArray, drive: IndexArray) -> FloatArray:
    """Values by the second, shape (n,), through the kernels, outermost rows held; shape (n, delays)."""
    first, last = np.searchsorted(drive, drive, side="left"), np.searchsorted(drive, drive, side="right") - 1
    rows = np.arange(len(values))
    shifted = np.stack([values[np.clip(rows - late, first, last)] for late in SECONDS], axis=1)
    return np.asarray(shifted @ KERNELS.T)


def amid_runs(valid: BoolArray) -> BoolArray:
    """Rows whose delays stay within their run, shape (n,): where a run ends in a lane change is no response."""
    before = positions_in_run(valid)
    return np.asarray((before >= DELAYS[-1]) & (positions_in_run(valid[::-1])[::-1] >= -DELAYS[0]))


def courses(
    quantities: Quantities, whitener: Whitener, amid: BoolArray, only: tuple[str, ...] = ()
) -> dict[tuple[str, ...], FloatArray]:
    """What plain shapes of every column, or of one, can do over time: white, orthonormal, shape (rows amid, rank)."""
    responses: dict[tuple[str, ...], list[FloatArray]] = {}
    compact, valid = whitener.compact, whitener.valid
    for candidate, values in zip(quantities.candidates, quantities.values, strict=True):
        if candidate.family is Family.PLAIN and (not only or candidate.columns == only):
            moved = tents(values.astype(np.float64), quantities.drive)[valid]
            rows, power = compact.rows(moved)[amid[valid]], float(np.square(moved).sum())
            if float(np.square(rows).sum()) > 1e-9 * power:  # it varies within drives
                responses.setdefault(candidate.columns, []).append(rows)
    return {columns: orthonormal(np.concatenate(rows, axis=1), CROSS_BASIS) for columns, rows in responses.items()}


def check_remainder(
    fitted: Fitted,
    quantities: Quantities,
    seed: np.random.SeedSequence,
    taken: Collection[tuple[str, ...]] = (),
    *,
    only: tuple[str, ...] = (),
) -> Omnibus:
    """Whether any column not `taken`, or `only` one, predicts what a fit leaves better than by chance."""
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
    weighed = basis * of_unit_variance(left)[:, None]
    return min(float(scores @ scores), float(scores @ np.linalg.pinv(weighed.T @ weighed) @ scores))
