"""Squares of what is new in each second: how large the movement is just now, tested and sized by regression.

References
----------
.. [1] A. C. Harvey, "Estimating regression models with multiplicative heteroscedasticity", Econometrica 44, 1976.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.loop.autocorrelation import Problem, Whitener, fit_autoregression, moving_sum
from xosc_lateral.drivers.loop.innovations import CLIP, own_levels
from xosc_lateral.drivers.loop.model import Fitted
from xosc_lateral.drivers.loop.timeline import COARSE, Coarse, coarse_all, coarse_mean

FINE_ORDER = 15  # Past samples (3 s) that the fine movement's autoregression sees.
# Past seconds of the squares that whitening sees: two time constants of the clusters of 6 s that are no regime. [s]
SQUARES_S = 12
SLOW_S = 8  # Whitened seconds that are averaged for the slower movement: below 1/16 Hz. [s]


@dataclass(frozen=True, eq=False, slots=True)
class Squares:
    """Mean squares per second, about 1, shape (n,), 0 where invalid; clipped where they are tested and sized."""

    values: FloatArray
    valid: BoolArray

    @property
    def standardised(self) -> FloatArray:
        """Clipped, mean 0 and variance 1 over the valid rows, 0 elsewhere."""
        if not self.valid.any():
            return np.zeros(len(self.values))
        clipped = np.minimum(self.values, CLIP)
        inside = clipped[self.valid]
        return np.where(self.valid, (clipped - inside.mean()) / max(float(inside.std()), 1e-12), 0.0)


def quick_squares(fitted: Fitted) -> Squares:
    """Squared innovations."""
    return Squares(np.square(fitted.innovations), fitted.coarse.valid)


def fine_squares(fitted: Fitted) -> Squares:
    """Squared innovations at 5 Hz, averaged to 1 Hz, responses taken out as far as the innovations show them."""
    coarse, timeline = fitted.coarse, fitted.coarse.timeline
    n = len(timeline)
    valid = timeline.valid & np.repeat(coarse.valid, COARSE)[:n] if len(coarse) * COARSE >= n else timeline.valid
    level = fitted.levels[timeline.drive]
    moved = np.where(valid, timeline.offset - level, 0.0)
    responses = np.where(valid, fitted.explained - level, 0.0)
    process = fit_autoregression(moved, valid, FINE_ORDER)
    rows, responses = moving_sum(process.polynomial, moved), moving_sum(process.polynomial, responses)
    settled = moving_sum(np.ones(process.order + 1), valid.astype(np.float64)) > process.order + 0.5
    power = float(responses[settled] @ responses[settled])
    seen = float(np.clip(responses[settled] @ rows[settled] / power, 0.0, 1.0)) if power > 0.0 else 0.0
    squares = coarse_mean(np.where(settled, np.square(rows - seen * responses), 0.0))
    whole = coarse_all(settled)
    return Squares(squares / own_levels(squares, whole, coarse.drive)[coarse.drive], whole)


def slow_squares(fitted: Fitted) -> Squares:
    """Squares of the whitened movement's running sums: more is let pass, but what is done is done as always."""
    valid = fitted.coarse.valid
    sums = moving_sum(np.ones(SLOW_S), fitted.innovations)
    whole = valid & (moving_sum(np.ones(SLOW_S), valid.astype(np.float64)) >= SLOW_S - 0.5)
    deviation = float(sums[whole].std()) if whole.any() else 1.0
    return Squares(np.where(whole, np.square(sums / max(deviation, 1e-12)), 0.0), whole)


def of_squares(coarse: Coarse, squares: Squares, columns: FloatArray) -> Problem:
    """Regression of squares on columns, shape (n, k), that may make them larger.

    Squares come in clusters of seconds, which whitening takes out. Loud and quiet minutes it leaves: they are what a
    slow column does (an autoregression that sees them takes half of the effect of rain for memory), and where no column
    does it, the null keeps them too.
    """
    valid, series = squares.valid, squares.standardised
    left = series
    if columns.shape[1]:
        design = columns - columns[valid].mean(axis=0)
        left = series - design @ np.linalg.lstsq(design[valid], series[valid], rcond=None)[0]
    process = fit_autoregression(np.where(valid, left, 0.0), valid, SQUARES_S, longest=SQUARES_S)
    return Problem(Whitener(process, valid, coarse.drive, np.ones(len(coarse))), series, columns)


def log_sizes(squares: Squares, columns: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Log-linear regression [1]_ of a standard deviation on columns, shape (n, k), and standard errors, shape (k,)
    each."""
    design = columns[squares.valid] - columns[squares.valid].mean(axis=0)
    inverse = np.linalg.pinv(2.0 * design.T @ design)
    sizes = np.zeros(columns.shape[1])
    relative = seen = squares.values[squares.valid]
    for _ in range(8):
        # clipped about what is expected there: a large effect must not clip itself
        relative = seen / np.exp(np.clip(2.0 * design @ sizes, -6.0, 6.0))
        relative = np.minimum(relative / max(float(relative.mean()), 1e-300), CLIP)
        relative = relative / max(float(relative.mean()), 1e-300)
        sizes = sizes + inverse @ (design.T @ (relative - 1.0))
    return sizes, np.sqrt(np.diag(inverse)) * float(np.std(relative)) / np.sqrt(2.0)
