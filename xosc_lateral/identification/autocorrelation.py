"""The autocorrelation of the movement that no effect explains: fitted, and what short runs do to the fit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.identification.movement_process import (
    MAX_REFLECTION,
    MovementProcess,
    positions_in_run,
    reflections,
    stepped_down,
)
from xosc_lateral.identification.whitening import Whitener

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.intp]

ENOUGH_ROWS = 0.5
"""The memory is the longest for which this share of the rows has so much past in its own run. [-]"""

ROWS_PER_COEFFICIENT = 20
"""Fewer rows than this per coefficient shorten the memory. [-]"""

START_ROWS = 10.0
"""First rows of runs have errors of their own as far as there are more of them than this."""

BIAS_DRAWS = 4
"""Simulated tables that tell the bias of short drives: their scatter adds an eighth to the fit's own variance."""

BIAS_SEED = 0
"""The same numbers each time: fits with and without a term differ by the term alone."""


def fit_autoregression(
    values: FloatArray, valid: BoolArray, order: int, *, longest: int | None = None, floor: float = 0.0
) -> MovementProcess:
    """Least squares over all rows that have the whole memory in their own run.

    Parameters
    ----------
    values : array, shape (n,)
        Mean about zero.
    valid : bool array, shape (n,)
    order : int
        Past values that have a coefficient each; lowered when the runs are too short for it.
    longest : int, optional
        Past values that are seen as means of stretches that double in length; `order` without.
    floor : float
        Standard deviation of white noise that the process has beside what `values` show. In regressions it is a ridge.
    """
    position = positions_in_run(valid)
    rows_in_all = max(1, int((position >= 0).sum()))
    order = max(1, order)
    while order > 1 and (position >= order).sum() < max(ROWS_PER_COEFFICIENT * order, 0.25 * rows_in_all):
        order -= 1
    edges = [order]
    while longest is not None and 2 * edges[-1] <= longest:
        if (position >= 2 * edges[-1]).sum() < ENOUGH_ROWS * rows_in_all:
            break
        edges.append(2 * edges[-1])
    rows = np.flatnonzero(position >= edges[-1])
    if len(rows) < 2 * order:
        return MovementProcess((np.zeros(0),), np.array([max(float(np.std(values[valid])), 1e-150)]))
    sums = np.concatenate([[0.0], np.cumsum(np.where(valid, values, 0.0))])
    past = [values[rows - lag] for lag in range(1, order + 1)]
    past += [(sums[rows - low] - sums[rows - high]) / (high - low) for low, high in pairwise(edges)]
    design, now = np.stack(past, axis=1), values[rows]
    # of what each past value or mean is made of, the floor's share
    noise = floor**2 / np.array([1.0] * order + [high - low for low, high in pairwise(edges)])
    gram = design.T @ design
    gram[np.diag_indices(len(gram))] *= 1.0 + 1e-9
    gram[np.diag_indices(len(gram))] += len(rows) * noise
    sizes = np.linalg.lstsq(gram, design.T @ now, rcond=None)[0]
    variance = float(np.mean((now - design @ sizes) ** 2)) * len(rows) / max(1, len(rows) - len(sizes))
    variance += floor**2 + float(noise @ sizes**2)
    lags = [sizes[:order]]
    lags += [
        np.full(high - low, size / (high - low))
        for size, (low, high) in zip(sizes[order:], pairwise(edges), strict=True)
    ]
    return stepped_down(np.concatenate(lags), max(variance, 1e-300))


def start_factors(rows: FloatArray, valid: BoolArray, order: int) -> FloatArray:
    """Factor on the errors of the first rows of runs, shape (order + 1,), beside those of rows with the whole memory.

    The process says how well a row is predicted from the few before it, if the run is a piece of a stationary movement.
    Runs begin where something ended, a lane change for one: their first rows may be off by more.

    Parameters
    ----------
    rows : array, shape (n,)
        Whitened.
    valid : bool array, shape (n,)
    """
    position = positions_in_run(valid)
    early, late = (position >= 0) & (position < order), position >= order
    usual = float(np.mean(rows[late] ** 2)) if late.any() else 1.0
    if usual <= 0.0:  # nothing moves
        return np.ones(order + 1)
    squares = np.bincount(position[early], rows[early] ** 2, minlength=order)
    count = np.bincount(position[early], minlength=order)
    factors = np.ones(order + 1)
    edges = [0, *(2**power for power in range(order.bit_length()) if 2**power < order), order]
    for low, high in pairwise(edges):
        mean = (squares[low:high].sum() + START_ROWS * usual) / (count[low:high].sum() + START_ROWS)
        factors[low:high] = np.sqrt(mean / usual)
    return factors


def unbiased(
    process: MovementProcess, valid: BoolArray, drive: IntArray, order: int, *, longest: int | None = None
) -> MovementProcess:
    """Take out what free levels of short drives do to a fitted autoregression.

    A level that is estimated takes part of the slow movement with it, so that the process looks less persistent than it
    is (Nickell's bias: the errors of effects in runs of a minute come out an eighth too small). The same is done to
    drives simulated from the fitted process, and the difference taken off: indirect inference for panels [1]_.

    Parameters
    ----------
    process : MovementProcess
        Fitted to `valid` rows less each drive's level.
    valid, drive, order, longest
        As it was fitted.

    References
    ----------
    .. [1] C. Gourieroux, P. Phillips, J. Yu, "Indirect inference for dynamic panel models", J. Econometrics 157, 2010.
    """
    if process.order == 0:
        return process
    rng = np.random.default_rng(BIAS_SEED)
    lags, log_variance = np.zeros(process.order), 0.0
    whitener = Whitener(process, valid, drive, np.ones(len(valid)))
    for simulated in process.simulate(len(valid), rng, runs=BIAS_DRAWS):
        left = np.where(valid, simulated - whitener.levels(simulated)[drive], 0.0)
        again = fit_autoregression(left, valid, order, longest=longest)
        if again.order != process.order:
            return process
        lags += again.lags[-1] / BIAS_DRAWS
        log_variance += 2.0 * float(np.log(again.deviations[-1])) / BIAS_DRAWS
    own = 2.0 * float(np.log(process.deviations[-1]))
    for share in (1.0, 0.5, 0.25):
        better = process.lags[-1] + share * (process.lags[-1] - lags)
        if np.abs(reflections(better)).max() < MAX_REFLECTION:
            return stepped_down(better, float(np.exp(own + share * (own - log_variance))))
    return process
