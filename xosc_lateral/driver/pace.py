"""Coarse movement at a varying pace: a series known at even steps of its own time, read off at uneven ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


class Paced:
    """Reads a source of successive values at ``tau``, where ``tau`` grows by the rate in each step.

    Between the source's values it runs along Catmull-Rom cubics: through the values, with a continuous slope. At rate 1
    from the start on it hands the source's values through, bit by bit.

    Parameters
    ----------
    source : callable
        ``source(n)`` gives the next n values.
    """

    def __init__(self, source: Callable[[int], FloatArray]) -> None:
        self._source = source
        self._tau = 0.0
        self._held = np.empty(0)
        self._first = 0  # index in the source of the first value held

    def take(self, n: int, rate: FloatArray | None) -> FloatArray:
        """Next n values, shape (n,); `rate` of shape (n,), > 0."""
        if rate is None and self._tau == 0.0:
            return self._source(n)
        steps = np.ones(n) if rate is None else np.asarray(rate, dtype=np.float64)
        if steps.shape != (n,) or not (np.isfinite(steps).all() and (steps > 0).all()):
            raise ValueError(f"rate: expected {n} finite values > 0")
        # Added up one by one from where the last call ended, so that pieces give the same sums as the whole.
        taus = np.cumsum(np.concatenate([[self._tau], steps]))
        self._tau = float(taus[-1])
        return self._read(taus[:-1])

    def _read(self, taus: FloatArray) -> FloatArray:
        if not len(taus):
            return np.empty(0)
        knots = np.floor(taus).astype(np.int64)
        fraction = taus - knots
        missing = int(knots[-1]) + 3 - (self._first + len(self._held))
        if missing > 0:
            self._held = np.concatenate([self._held, self._source(missing)])
        at = knots - self._first
        values = self._held
        before, here, there, behind = values[np.maximum(at - 1, 0)], values[at], values[at + 1], values[at + 2]
        bend = 2 * before - 5 * here + 4 * there - behind
        twist = 3 * (here - there) + behind - before
        result = here + 0.5 * fraction * (there - before + fraction * (bend + fraction * twist))
        done = max(0, int(knots[-1]) - 2 - self._first)
        self._held, self._first = values[done:], self._first + done
        return np.asarray(result)
