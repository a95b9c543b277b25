"""How fast something changes: a difference over a window, the one answer to how fast anything moves sideways."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray


def rate(
    values: FloatArray, clock: FloatArray | float, window: float = 0.0, *, past: bool = False,
    whose: IntArray | None = None,
) -> FloatArray:  # fmt: skip
    """Change a second over a window about each row, or of `past` ones; one-sided at the ends; shape (..., n).

    `clock`: times of the rows, shape (n,), or the step between them. [s] `window`: at least a row to each side that it
    reaches to. [s] `whose`: rows of equal numbers are one track's, in order, shape (n,).
    """
    rows = np.arange(values.shape[-1])
    first, last = np.zeros_like(rows), np.full_like(rows, len(rows) - 1)
    if whose is not None:
        first, last = np.searchsorted(whose, whose, side="left"), np.searchsorted(whose, whose, side="right") - 1
    if isinstance(clock, np.ndarray):
        passed = np.diff(clock)
        usual = passed if whose is None else passed[np.diff(whose) == 0]
        step = float(np.median(usual)) if len(usual) else 1.0
    else:
        step = clock
    reach = max(1, round((1.0 if past else 0.5) * window / step))
    low, high = np.maximum(rows - reach, first), rows if past else np.minimum(rows + reach, last)
    span = clock[high] - clock[low] if isinstance(clock, np.ndarray) else (high - low) * step
    return np.asarray((values[..., high] - values[..., low]) / np.where(high > low, span, step))
