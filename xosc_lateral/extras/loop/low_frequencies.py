"""Tests at low frequencies of what changes over a whole drive: a smooth or a step of the mean, a smooth of the spread.

Cosine coefficients of white rows are independent and of one variance. Those of the slowest periods are compared with
the next quicker ones, which know how much people wander and how long loud stretches last [1]_.

References
----------
.. [1] E. Lazarus, D. Lewis, J. Stock, M. Watson, "HAR inference: recommendations for practice", J. Business & Economic
   Statistics 36, 2018: a long-run variance from cosines; U. K. Müller, M. W. Watson, "Testing models of low-frequency
   variability", Econometrica 76, 2008.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.model.effects.hidden import half_cosines
from xosc_lateral.extras.loop.autocorrelation import Whitener, fit_autoregression
from xosc_lateral.extras.loop.dictionary import beside, orthonormal
from xosc_lateral.extras.loop.model import MAXIMUM_ORDER, ORDER, Fitted
from xosc_lateral.extras.loop.significance import MINIMUM_P, upper_tail
from xosc_lateral.extras.loop.timeline import MIN_DRIFT_S, Coarse

# Half cosines tried for the mean. The fit has the most of them, penalised: a test wants few, a curve its shape.
ORDERS = (1, 2, 4, 8)
SPREAD_ORDERS = (1, 2, 4)  # Half cosines tried for the spread: its square scatters more than an offset does.
EDGE_S, STEP_GRID_S = 60, 15  # Least time on either side of a step, and between the moments that are tried. [s]
# Half cosines whose period is down to this say how much the slower ones are by chance; four times as long as what a
# regime lasts, so that regimes count as chance. [s]
SHORTEST_S = 240.0
# The same for the mean: people wander within a minute or two, which whitening knows, but not all of it. Of 210 drives
# on which nothing acts 4, 1 and 0 have p below 0.0024 with 120, 150 and 165 s, where 0.5 are expected. [s]
MEAN_SHORTEST_S = 165.0
# Half cosines of longer periods are hidden from the autoregression: eight times as long as it sees. [s]
UNSEEN_S = 750.0
STEP_DRAWS = 2000  # Draws of white rows that the best smooth or step is compared with.
LEAST_OTHERS = 8  # So many of them at least, also on a short drive.
SAME_S = 90  # Steps of two fits that are so close are the same one. [s]


def slow_rows(fitted: Fitted) -> tuple[FloatArray, Whitener]:
    """White rows, shape (n,), by an autoregression that has not seen what changes over the whole drive."""
    coarse = fitted.coarse
    left = np.where(coarse.valid, fitted.movement * fitted.scale, 0.0)
    # of a short drive all of them would take ordinary wander along, and the rest would look whiter than it is
    number = int(np.clip(2.0 * coarse.valid.sum() / coarse.drives / UNSEEN_S, 1, max(ORDERS)))
    slow = np.column_stack([np.ones(len(left)), half_cosines_of(coarse, number)]) * coarse.valid[:, None]
    movement = np.where(coarse.valid, beside(np.linalg.qr(slow)[0], left) / fitted.scale, 0.0)
    process = fit_autoregression(movement, coarse.valid, ORDER, longest=MAXIMUM_ORDER)
    whitener = Whitener(process, coarse.valid, coarse.drive, fitted.scale)
    return whitener.rows(left), whitener


def low_frequencies(
    values: FloatArray, coarse: Coarse, valid: BoolArray, shortest_s: float, least_s: float = MIN_DRIFT_S
) -> FloatArray:
    """Cosine transform of each drive of `least_s`, without its mean and what is quicker, shape (frequencies, k)."""
    from scipy.fft import dct

    coefficients = []
    for index in range(coarse.drives):
        series = values[valid & (coarse.drive == index)]
        if len(series) >= least_s:
            number = max(round(2.0 * len(series) / shortest_s), max(ORDERS) + LEAST_OTHERS)
            coefficients.append(dct(series, type=2, norm="ortho", axis=0)[1 : number + 1])
    return np.concatenate(coefficients) if coefficients else np.zeros((0, values.shape[1]))


def smooth_probabilities(rows: FloatArray, columns: FloatArray, orders: Sequence[int]) -> dict[int, float]:
    """p-value of the first so many columns by F tests at low frequencies alone, which tell what chance does [1]_."""
    p_values = {}
    for order in orders:
        basis = orthonormal(columns[:, :order])
        others = len(rows) - basis.shape[1]
        if basis.shape[1] and others > 0:
            explained = float(np.sum(np.square(basis.T @ rows)))
            ratio = explained / basis.shape[1] / (max(float(rows @ rows) - explained, 1e-300) / others)
            p_values[order] = max(float(fdtrc(basis.shape[1], others, ratio)), MINIMUM_P)
    return p_values


def step_moments(coarse: Coarse) -> NDArray[np.intp]:
    """Rows of the 1 Hz grid at which a single drive may step, shape (moments,); several drives have no common step."""
    count = np.cumsum(coarse.valid)
    inside = coarse.valid & (count >= EDGE_S) & (count <= count[-1] - EDGE_S)
    return np.flatnonzero(inside)[::STEP_GRID_S] if coarse.drives == 1 else np.zeros(0, dtype=np.intp)


def mean_probability(rows: FloatArray, waves: FloatArray, jumps: FloatArray, rng: np.random.Generator) -> float:
    """p-value of the best of all smooths and steps at low frequencies: the least p of F tests, against white rows."""
    bases = [orthonormal(waves[:, :order]) for order in ORDERS if order <= waves.shape[1]]
    unit = jumps / np.maximum(np.linalg.norm(jumps, axis=0), 1e-12)

    def surest(drawn: FloatArray) -> FloatArray:
        """Largest negative logarithm of a p-value, shape (draws,)."""
        total = np.square(drawn).sum(axis=1)
        tests = [(np.square(drawn @ basis).sum(axis=1), basis.shape[1]) for basis in bases if basis.shape[1]]
        tests += [(np.square(drawn @ unit).max(axis=1), 1)] if unit.shape[1] else []
        log_p_values = []
        for explained, degrees in tests:
            ratio = explained / degrees / ((total - explained) / (len(rows) - degrees))
            log_p_values.append(-np.log(np.maximum(fdtrc(degrees, len(rows) - degrees, ratio), MINIMUM_P)))
        return np.asarray(np.max(log_p_values, axis=0))

    # of the logarithm of a least p the tail is exponential, whatever the tests have in common
    return upper_tail(float(surest(rows[None])[0]), surest(rng.normal(size=(STEP_DRAWS, len(rows)))), least_excess=1.0)


def moment_of(rows: FloatArray, whitener: Whitener, at: int) -> int:
    """The second at which a step near `at` is likeliest: a jump leaves its mark in the movement of that very second."""
    near = np.arange(max(at - SAME_S, 1), min(at + SAME_S + 1, len(rows)))
    jumps = whitener.rows((np.arange(len(rows))[:, None] >= near).astype(np.float64))
    return int(near[np.argmax(np.square(jumps.T @ rows) / np.maximum(np.square(jumps).sum(axis=0), 1e-12))])


def clock_range(coarse: Coarse) -> tuple[float, float]:
    """First and last valid time of all drives, in their clocks. [s]"""
    seen = coarse.time[coarse.valid]
    return float(seen.min()), float(seen.max())


def half_cosines_of(coarse: Coarse, number: int) -> FloatArray:
    """Half cosines of the drives' clock, within -1..1, shape (n, number). [-]"""
    return half_cosines(coarse.time, *clock_range(coarse), number)


def penalised(sizes: FloatArray, covariance: FloatArray, prior: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Sizes, shape (k,), and covariance, given a prior covariance but for its scale, which is likeliest (REML)."""
    largest = float(np.max(np.square(sizes) / np.diag(prior), initial=1e-300))
    best, scaled_prior = -np.inf, np.zeros_like(prior)
    for scale in largest * np.geomspace(1e-6, 10.0, 60):
        total = covariance + scale * prior
        sign, volume = np.linalg.slogdet(total)
        likelihood = -0.5 * float(sizes @ np.linalg.solve(total, sizes)) - 0.5 * volume if sign > 0 else -np.inf
        if likelihood > best:
            best, scaled_prior = likelihood, scale * prior
    gain = np.linalg.solve(covariance + scaled_prior, scaled_prior).T
    return gain @ sizes, gain @ covariance
