"""Coarse movement at a varying rate of mean reversion: the same path, run through faster or slower.

A process that reverts to its mean twice as fast is the process itself in a time that runs twice as fast (a change of
time). A series known at even steps of its own time is therefore read off at uneven ones.

References
----------
.. [1] E. Catmull, R. Rom, "A class of local interpolating splines", Computer Aided Geometric Design, 1974.
"""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import numpy as np

from xosc_lateral.base.arrays import FloatArray


class ClockState(msgspec.Struct):
    """Where a changed time is."""

    time: float = 0.0
    """Own time of the next value, in steps. [-]"""
    held: FloatArray | None = None
    """Values of the source that are still needed, shape (k, drivers)."""
    first: int = 0
    """Index in the source of the first of them."""


def take_at_rate(state: ClockState, source: Callable[[int], FloatArray], n: int, rate: FloatArray | None) -> FloatArray:
    """Next n values of a source whose own time passes at a rate.

    Between the source's values they lie on Catmull-Rom cubics: through the values, with a continuous slope. At rate 1
    from the start on the source's values are handed through, bit by bit.

    Raises `ValueError` if a rate, steps of own time per step, shape (n,), is not above 0 or not finite. ``source(n)``
    gives the next n values, shape (n, drivers); `state` goes on.
    """
    if rate is None and state.time == 0.0:
        return source(n)
    steps = np.ones(n) if rate is None else np.asarray(rate, dtype=np.float64)
    if steps.shape != (n,) or not (np.isfinite(steps).all() and (steps > 0).all()):
        raise ValueError(f"rate: expected {n} finite values > 0")
    # Added up one by one from where the last call ended, so that pieces give the same sums as the whole.
    times = np.cumsum(np.concatenate([[state.time], steps]))
    state.time = float(times[-1])
    return _read(state, source, times[:-1])


def _read(state: ClockState, source: Callable[[int], FloatArray], times: FloatArray) -> FloatArray:
    """Values at times of the source, and a state that holds what later times need. Shape (n, drivers)."""
    held = source(0) if state.held is None else state.held
    if not len(times):
        return held[:0]
    knots = np.floor(times).astype(np.int64)
    fraction = (times - knots)[:, None]
    missing = int(knots[-1]) + 3 - (state.first + len(held))
    if missing > 0:
        held = np.concatenate([held, source(missing)])
    at = knots - state.first
    before, here, there, behind = held[np.maximum(at - 1, 0)], held[at], held[at + 1], held[at + 2]
    bend = 2 * before - 5 * here + 4 * there - behind
    twist = 3 * (here - there) + behind - before
    result = here + 0.5 * fraction * (there - before + fraction * (bend + fraction * twist))
    done = max(0, int(knots[-1]) - 2 - state.first)
    state.held, state.first = held[done:], state.first + done
    return np.asarray(result)
