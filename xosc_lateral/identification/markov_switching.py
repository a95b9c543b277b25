"""On/off regimes as a two-state hidden Markov model of the innovations' size.

References
----------
.. [1] J. D. Hamilton, "A new approach to the economic analysis of nonstationary time series and the business cycle",
       Econometrica 57, 1989.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.jit import njit

FloatArray = NDArray[np.float64]


@njit
def forward_backward(squares, valid, quiet, loud, go, leave):  # type: ignore[no-untyped-def]
    """Probability of the loud state per row, expected numbers of switches on and off, log-likelihood."""
    n = len(squares)
    forward, emit = np.empty((n, 2)), np.ones((n, 2))
    likelihood = 0.0
    a0, a1 = leave / (go + leave), go / (go + leave)
    for t in range(n):
        if valid[t]:
            emit[t, 0] = np.exp(-0.5 * squares[t] / quiet**2) / quiet + 1e-300
            emit[t, 1] = np.exp(-0.5 * squares[t] / loud**2) / loud + 1e-300
        p0 = (a0 * (1.0 - go) + a1 * leave) * emit[t, 0]
        p1 = (a0 * go + a1 * (1.0 - leave)) * emit[t, 1]
        total = p0 + p1
        likelihood += np.log(total)
        a0, a1 = p0 / total, p1 / total
        forward[t, 0], forward[t, 1] = a0, a1
    on = np.empty(n)
    on[n - 1] = forward[n - 1, 1]
    b0, b1, went, left = 1.0, 1.0, 0.0, 0.0
    for t in range(n - 2, -1, -1):
        e0, e1 = emit[t + 1, 0] * b0, emit[t + 1, 1] * b1
        j00, j01 = forward[t, 0] * (1.0 - go) * e0, forward[t, 0] * go * e1
        j10, j11 = forward[t, 1] * leave * e0, forward[t, 1] * (1.0 - leave) * e1
        total = j00 + j01 + j10 + j11
        went += j01 / total
        left += j10 / total
        on[t] = (j10 + j11) / total
        b0, b1 = (1.0 - go) * e0 + go * e1, leave * e0 + (1.0 - leave) * e1
        norm = b0 + b1
        b0, b1 = b0 / norm, b1 / norm
    return on, went, left, likelihood


ITERATIONS = 60
"""Of expectation maximisation; converges well before."""

STARTS = ((1.6, 15.0), (2.2, 40.0))
"""Factor between the regimes and mean length [s] that the fit starts from; the likelier end is kept."""


@dataclass(frozen=True, eq=False, slots=True)
class RegimeFit:
    """Two regimes of a movement.

    Parameters
    ----------
    factor : float
        Spread in the loud regime over the quiet one. [-]
    on_s, off_s : float
        Mean length of either. [s]
    on : array, shape (n,)
        Probability that the loud regime is on, given the whole drive.
    quiet : float
        Standard deviation of the innovations in the quiet regime. [-]
    log_likelihood : float
    """

    factor: float
    on_s: float
    off_s: float
    on: FloatArray
    quiet: float
    log_likelihood: float


def fit_regimes(rows: FloatArray, valid: NDArray[np.bool_]) -> RegimeFit:
    """Fit to white rows [-], shape (n,), by expectation maximisation; cut-out seconds say nothing about the regime."""
    fits = []
    for factor, length in STARTS:
        quiet = float(np.sqrt(np.mean(rows[valid] ** 2) / (0.7 + 0.3 * factor**2)))
        fits.append(_fit(rows, valid, quiet, quiet * factor, 1.0 / (2.0 * length), 1.0 / length))
    best = max(fits, key=lambda fit: fit[-1])
    quiet, loud, go, leave, on, likelihood = best
    return RegimeFit(loud / quiet, 1.0 / leave, 1.0 / go, on, quiet, likelihood)


def _fit(
    rows: FloatArray, valid: NDArray[np.bool_], quiet: float, loud: float, go: float, leave: float
) -> tuple[float, float, float, float, FloatArray, float]:
    squares = rows**2
    for _ in range(ITERATIONS):
        on, went, left, likelihood = forward_backward(squares, valid, quiet, loud, go, leave)  # type: ignore[no-untyped-call]  # compiled: numba has no types
        weight_on, weight_off = on[valid], 1.0 - on[valid]
        loud = float(np.sqrt((weight_on @ squares[valid]) / max(weight_on.sum(), 1e-9)))
        quiet = float(np.sqrt((weight_off @ squares[valid]) / max(weight_off.sum(), 1e-9)))
        go = float(np.clip(went / max(float((1.0 - on).sum()), 1e-9), 1e-4, 0.5))
        leave = float(np.clip(left / max(float(on.sum()), 1e-9), 1e-4, 0.5))
        if quiet > loud:
            quiet, loud, go, leave = loud, quiet, leave, go
        quiet = max(quiet, 1e-3)
    return quiet, loud, go, leave, on, likelihood
