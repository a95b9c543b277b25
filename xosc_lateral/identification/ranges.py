"""The range of what drives an effect: between which values its size is told."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.effects import ColumnEffect, Linear, Piecewise, Saturating, Threshold
from xosc_lateral.identification.regression import Coarse

FloatArray = NDArray[np.float64]


def driving_range(coarse: Coarse, effect: ColumnEffect) -> tuple[FloatArray, FloatArray]:
    """Quantity [own unit] at the low and at the high end of what drives the effect, shape (k,) each.

    That is the 5 % and the 95 % quantile while road-following: of the column, where a single number drives it; of the
    product; of the strength, for angles and levels. The extremes where both quantiles are the same (a switch that is on
    for less than 5 % of the time).
    """
    inside = coarse.timeline.valid
    if isinstance(effect, Linear | Threshold | Saturating | Piecewise):
        seen = coarse.context[effect.column][inside]
        ends = _ends(seen[np.isfinite(seen)])
        low, high = effect.quantity({effect.column: ends})
        if np.any(low != high):
            return low, high
    quantity = effect.seen({column: coarse.context[column][inside] for column in effect.columns})
    quantity = quantity[np.isfinite(quantity).all(axis=1)]
    if quantity.shape[1] == 1:
        low, high = _ends(quantity[:, 0])
        return np.array([low]), np.array([high])
    return _by_strength(quantity, effect.coefficients)


def _by_strength(quantity: FloatArray, coefficients: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    """Rows of the weak and of the strong end, shape (k,) each. [own unit]"""
    order = np.argsort(quantity @ np.asarray(coefficients))
    return quantity[order[int(0.05 * len(order))]], quantity[order[min(len(order) - 1, int(0.95 * len(order)))]]


def span(coarse: Coarse, effect: ColumnEffect) -> float:
    """Change of strength between the two ends of the driving range; [m] or natural logarithm."""
    low, high = driving_range(coarse, effect)
    return float((high - low) @ np.asarray(effect.coefficients))


def _ends(values: FloatArray) -> FloatArray:
    low, high = np.quantile(values, [0.05, 0.95])
    return np.array([low, high] if high > low else [values.min(), values.max()])
