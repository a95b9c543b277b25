"""What columns can explain of the mean by any course over time: of what is left after the search, and at all.

The check regresses what the refined profile leaves of the drives, white, on every column's distributed lag [1]_ in
turn; it asks for the mean alone, not for the spread. The share of the explainable sets what the effects predict of
blocks that nothing was chosen or fitted on against a free linear response: every column's course at once, each column's
weights shrunk by the variance under which they are likeliest [3]_. It names nothing.

References
----------
.. [1] A. Gasparrini, B. Armstrong, M. G. Kenward, "Distributed lag non-linear models", Statistics in Medicine 29, 2010.
.. [2] H. White, "A heteroskedasticity-consistent covariance matrix estimator", Econometrica 48, 1980.
.. [3] D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4, 1992: groups' variances by evidence.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IndexArray, IntArray
from xosc_lateral.base.numbers import NORMAL_95
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
from xosc_lateral.extras.loop.timeline import Coarse

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
    after = positions_in_run(valid[::-1])[::-1]
    return np.asarray((before >= DELAYS[-1]) & (after >= -DELAYS[0]))


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


ROUNDS = 30  # Of variances and weights by turns.
VARIANCE_LIMITS = (1e-6, 1e3)  # Within which a column's variance is kept, for whitened rows of variance 1. [-]


@dataclass(frozen=True, slots=True)
class Explained:
    """Gains of the mean in log score over the base, per held-out block. [nat]"""

    after: float  # Of the effects that each fold found.
    free: float  # Of the free linear response.
    free_error: float  # Standard error of it.
    share: float  # The one over the other. [-]
    error: float  # Standard error of the share. [-]

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the share. [-]"""
        return self.share - NORMAL_95 * self.error, self.share + NORMAL_95 * self.error

    @property
    def is_known(self) -> bool:
        """Whether there is anything to explain: the free response surely gains."""
        return self.free > NORMAL_95 * self.free_error


def explained_share(
    starts: Sequence[Fitted], finals: Sequence[Fitted], quantities: Quantities, coarse: Coarse, blocks: IntArray
) -> Explained | None:
    """What each fold's effects and free response predict of rows not fitted on; None: nothing is held out."""
    # all columns' plain shapes at all delays, such that smooth weights are white
    root = np.linalg.cholesky(SMOOTH_COVARIANCE)
    plain = [
        tents(values.astype(np.float64), quantities.drive) @ root
        for candidate, values in zip(quantities.candidates, quantities.values, strict=True)
        if candidate.family is Family.PLAIN
    ]
    if len(finals) < 2 or not plain:
        return None
    courses, gains = np.concatenate(plain, axis=1), np.zeros((2, len(blocks)))
    for fold, (start, final) in enumerate(zip(starts, finals, strict=True)):
        held = (blocks % len(finals) == fold) & coarse.valid
        there = Whitener(final.whitener.process, held, final.whitener.drive, final.whitener.scale)
        free = courses @ _free_weights(courses, start, final.whitener)
        left = (final.coarse.offset - path for path in (_path(start), _path(final), _path(start) + free))
        # levels are the held rows' own
        before, *better = (np.square(there.rows(np.where(held, values, 0.0))) * held for values in left)
        gains += 0.5 * (before - np.asarray(better)) / max(float(before[held].mean()) if held.any() else 1.0, 1e-300)
    numbers = np.unique(blocks[coarse.valid])
    by_effects, by_columns = (np.bincount(blocks, rows)[numbers] for rows in gains)
    number, total = len(numbers), float(by_columns.sum())
    share = float(by_effects.sum()) / total if total else 0.0
    scatter = float(np.sqrt(number / max(number - 1, 1) * np.sum(np.square(by_effects - share * by_columns))))
    error = float(np.std(by_columns, ddof=1) / np.sqrt(number)) if number > 1 else np.inf
    share_error = scatter / max(abs(total), 1e-300)
    return Explained(float(by_effects.mean()), float(by_columns.mean()), error, share, share_error)


def _path(fitted: Fitted) -> FloatArray:
    """Mean by the terms that say where a car is on rows that they were not fitted on, shape (n,). [m]"""
    paths = [fitted.path(term) for term in fitted.terms if term.seen_held_out]
    return np.asarray(np.sum([np.zeros(len(fitted.coarse)), *paths], axis=0))


def _free_weights(courses: FloatArray, start: Fitted, whitener: Whitener) -> FloatArray:
    """Weights of the free response, shape (columns * delays,), from the rows that a fold is fitted on. [m]"""
    valid = whitener.valid
    known = orthonormal(whitener.rows(start.columns)[valid])
    rows = beside(known, whitener.rows(start.coarse.offset - start.columns @ start.sizes)[valid])
    noise = max(float(np.sqrt(np.mean(rows**2))), 1e-300)
    design = beside(known, whitener.rows(courses)[valid])
    gram, products = design.T @ design, design.T @ (rows / noise)
    size = len(DELAYS)
    variance = np.full(len(products) // size, 1.0 / max(float(np.trace(gram)), 1e-300))
    scale = 1.0 / max(float(np.trace(gram)) / len(products), 1e-300)
    weights = np.zeros(len(products))
    for _ in range(ROUNDS):
        inverse = np.linalg.inv(gram + np.diag(np.repeat(1.0 / variance, size)))
        weights = inverse @ products
        left = np.diag(inverse).reshape(-1, size).sum(axis=1)
        known_part = size - left / variance  # of its weights, how many the rows know
        variance = np.square(weights).reshape(-1, size).sum(axis=1) / np.maximum(known_part, 1e-9)
        variance = np.clip(variance, scale * VARIANCE_LIMITS[0], scale * VARIANCE_LIMITS[1])
    return np.asarray(weights * noise)
