"""How much of what the columns can explain the effects do explain, on blocks that nothing was chosen or fitted on.

The measure is a free linear response: every column's course over time at once, with a weight for each delay, each
column's shrunk by the variance under which its weights are likeliest [1]_. It names nothing, and a loop that found
all that is linear would predict as well.

References
----------
.. [1] D. J. C. MacKay, "Bayesian interpolation", Neural Computation 4, 1992: groups' variances by evidence.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.numbers import NORMAL_95
from xosc_lateral.drivers.loop.autocorrelation import Whitener
from xosc_lateral.drivers.loop.candidates import Family
from xosc_lateral.drivers.loop.dictionary import Quantities, beside, orthonormal
from xosc_lateral.drivers.loop.model import Fitted, latent_path
from xosc_lateral.drivers.loop.omnibus import DELAYS, smooth_covariance, tents
from xosc_lateral.drivers.loop.timeline import Coarse

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
    """What each fold's effects, and its free response, predict of rows that it was not fitted on; None if nothing can
    be held out."""
    courses = _courses(quantities)
    if len(finals) < 2 or not courses.shape[1]:
        return None
    gains = np.zeros((2, len(blocks)))
    for fold, (start, final) in enumerate(zip(starts, finals, strict=True)):
        held = (blocks % len(finals) == fold) & coarse.valid
        whitener = final.whitener
        free = courses @ _free_weights(courses, start, whitener)
        paths = (_path(start), _path(final), _path(start) + free)
        before, *better = (_squares(whitener, final.coarse.offset - path, held) for path in paths)
        gains += 0.5 * (before - np.asarray(better)) / max(float(before[held].mean()) if held.any() else 1.0, 1e-300)
    numbers = np.unique(blocks[coarse.valid])
    by_effects, by_columns = (np.bincount(blocks, rows)[numbers] for rows in gains)
    number, total = len(numbers), float(by_columns.sum())
    share = float(by_effects.sum()) / total if total else 0.0
    scatter = float(np.sqrt(number / max(number - 1, 1) * np.sum(np.square(by_effects - share * by_columns))))
    error = float(np.std(by_columns, ddof=1) / np.sqrt(number)) if number > 1 else np.inf
    return Explained(
        float(by_effects.mean()), float(by_columns.mean()), error, share, scatter / max(abs(total), 1e-300)
    )


def _path(fitted: Fitted) -> FloatArray:
    """Mean by the terms that say where a car is on rows that they were not fitted on, shape (n,). [m]"""
    paths = [latent_path(term, fitted) for term in fitted.terms if term.seen_held_out]
    return np.asarray(np.sum([np.zeros(len(fitted.coarse)), *paths], axis=0))


def _courses(quantities: Quantities) -> FloatArray:
    """All columns' plain shapes at all delays, shape (n, columns * delays), such that smooth weights are white."""
    root = np.linalg.cholesky(smooth_covariance(len(DELAYS)))
    plain = [
        values.astype(np.float64)
        for candidate, values in zip(quantities.candidates, quantities.values, strict=True)
        if candidate.family is Family.PLAIN
    ]
    own = [tents(values, DELAYS, quantities.drive) @ root for values in plain]
    return np.concatenate([np.zeros((len(quantities.drive), 0)), *own], axis=1)


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


def _squares(whitener: Whitener, values: FloatArray, held: BoolArray) -> FloatArray:
    """Whitened squares where held, shape (n,), else 0; levels are the held rows' own. [-]"""
    there = Whitener(whitener.process, held, whitener.drive, whitener.scale)
    return np.where(held, np.square(there.rows(np.where(held, values, 0.0))), 0.0)
