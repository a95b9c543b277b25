"""How fast something changes: a difference over a window, the one answer to how fast anything moves sideways."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.rows import blocks


def rate(
    values: FloatArray, clock: FloatArray | float, window: float = 0.0, *, past: bool = False,
    whose: IntArray | None = None,
) -> FloatArray:  # fmt: skip
    """Change a second over a window about each row, or of `past` ones; one-sided at the ends; shape (..., n).

    `clock`: times of the rows, shape (n,), or the step between them. [s] `window`: at least a row to each side that it
    reaches to. [s] `whose`: rows of equal numbers are one track's, in order, shape (n,).
    """
    if isinstance(clock, np.ndarray):
        passed = np.diff(clock)
        usual = passed if whose is None else passed[whose[1:] == whose[:-1]]
        step = float(np.median(usual)) if len(usual) else 1.0
    else:
        step = clock
    reach = max(1, round((1.0 if past else 0.5) * window / step))
    rates = np.empty(values.shape)  # by blocks: a row's numbers take ten times what its rate does
    for part in blocks(values.shape[-1]):
        rows = np.arange(part.start, part.stop)
        first, last = np.zeros_like(rows), np.full_like(rows, values.shape[-1] - 1)
        if whose is not None:
            first = np.searchsorted(whose, whose[part], side="left")
            last = np.searchsorted(whose, whose[part], side="right") - 1
        low, high = np.maximum(rows - reach, first), rows if past else np.minimum(rows + reach, last)
        span = clock[high] - clock[low] if isinstance(clock, np.ndarray) else (high - low) * step
        rates[..., part] = (values[..., high] - values[..., low]) / np.where(high > low, span, step)
    return rates


def fitted_rate(values: FloatArray, time: FloatArray, window: float) -> FloatArray:
    """The slope of the line through the rows within half a window [s] of each, by least squares, shape (n,): of white
    noise with standard deviation s, rows a step apart, s * sqrt(12 * step / window**3) is left."""
    if len(time) < 2:
        return np.zeros(len(time))
    half = 0.5 * window + 1e-6
    first = np.minimum(np.searchsorted(time, time - half), np.maximum(np.arange(len(time)) - 1, 0))
    last = np.maximum(np.searchsorted(time, time + half), np.minimum(np.arange(len(time)) + 2, len(time)))
    t, v = time - time.mean(), values - values.mean()

    def total(terms: FloatArray) -> FloatArray:
        sums = np.r_[0.0, np.cumsum(terms)]
        return np.asarray(sums[last] - sums[first])

    count = (last - first).astype(np.float64)
    spread = count * total(t * t) - total(t) ** 2
    return np.asarray((count * total(t * v) - total(t) * total(v)) / spread)


def white_noise(values: FloatArray, lag: int = 1) -> float:
    """Standard deviation of the error that differs from row to row, in the values' unit: a median of third differences
    of every `lag`-th row, which what moves smoothly has none of; of errors that last longer it sees a part."""
    third = np.abs(values[3 * lag :] - values[: -3 * lag] - 3.0 * (values[2 * lag : -lag] - values[lag : -2 * lag]))
    third = third[np.isfinite(third)]
    return 1.4826 * float(np.median(third)) / np.sqrt(20.0) if len(third) else 0.0
