"""Which of two hidden states a movement was in, row by row, given all of it: the forward-backward algorithm [1]_.

References
----------
.. [1] L. R. Rabiner, "A tutorial on hidden Markov models and selected applications in speech recognition", Proc. IEEE
       77, 1989, pp. 257-286: scaled, section V-A.
"""

from __future__ import annotations

import numpy as np

from xosc_lateral.jit import njit


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
