"""How unsure a size is because shape, lag and time constant of the response were estimated with it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from msgspec import structs

from xosc_lateral.arrays import FloatArray
from xosc_lateral.driver.effects import ColumnEffect, Linear, Piecewise, Product, Proximity, Saturating, Threshold
from xosc_lateral.identification.candidates import shapes_of
from xosc_lateral.identification.columns import Column, read_column
from xosc_lateral.identification.dictionary import beside
from xosc_lateral.identification.model import Fitted
from xosc_lateral.identification.refinement import (
    FINE_RESPONSES,
    LAG_STEPS,
    lags_about,
    means_by_second,
    other_centres,
    other_scales,
    running_sums,
)
from xosc_lateral.identification.timeline import Coarse


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


NEAR_S = 2.0  # Lags that differ from the estimate by up to this are compared. [s]
# Scales that are compared, as shares of the estimate, 7 % apart: between two that refinement tries, 40 % apart, the
# change from the usual to the near end differs by a third.
NEAR_SCALES = tuple(np.geomspace(0.5, 2.0, 21).tolist())
# 95 % quantile of chi-square with one degree of freedom: the interval gives up half as much log-likelihood. [-]
CHI_SQUARE = 3.84


def widening(fitted: Fitted, effect: ColumnEffect, part: slice) -> float:
    """Factor on the standard errors of an effect on the mean, at least 1.

    How far the profile-likelihood interval [1]_ of the change over the driving range reaches from the estimate with
    lag and time constant free, or the shape of its column, or the distances over which its product fades, over how far
    it reaches with all of them known. The likelihood is that of independent rows, scaled to the variance that stretches
    of a minute show [2]_.

    `effect`: with coefficients; `part`: its columns of the mean.

    References
    ----------
    .. [1] D. Venzon, S. Moolgavkar, "A method for computing profile-likelihood-based confidence intervals", Applied
       Statistics 37, 1988.
    .. [2] R. E. Chandler, S. Bate, "Inference for clustered data using the independence loglikelihood", Biometrika 94,
       2007.
    """
    low, high = driving_range(fitted.coarse, effect)
    contrast = high - low
    white = fitted.whitener.rows
    others, _ = np.linalg.qr(white(np.delete(fitted.columns, np.r_[part], axis=1)))
    left = beside(others, white(fitted.coarse.offset))
    own = beside(others, white(fitted.columns[:, part]))
    estimated = _profile(own, left, contrast)
    found = [estimated]
    for response in _timed(fitted, effect):
        rows = beside(others, white(response.reshape(len(response), -1)))
        width = len(contrast)
        found += [_profile(rows[:, at : at + width], left, contrast) for at in range(0, rows.shape[1], width)]
    for shape in _shapes(fitted.coarse, effect):
        low, high = driving_range(fitted.coarse, shape)
        rows = beside(others, white(fitted.coarse.response(shape)))
        alike = np.sign(float(np.sum(own * rows)))  # nearness falls where distance rises
        found.append(_profile(rows, left, alike * (high - low)))
    gain, size, variance = np.asarray(found).T
    noise = float(left @ left - gain.max()) / max(1, int(fitted.coarse.valid.sum()))
    clustered = float(contrast @ fitted.covariance[part, part] @ contrast)
    room = CHI_SQUARE * clustered / max(noise * estimated[2], 1e-300) - (gain.max() - gain) / noise
    inside = room > 0.0
    half = np.sqrt(noise * variance[inside] * room[inside])
    reach = float(np.max(np.abs(size[inside] - estimated[1]) + half))
    return float(max(1.0, reach / max(np.sqrt(CHI_SQUARE * clustered), 1e-300)))


def _shapes(coarse: Coarse, effect: ColumnEffect) -> list[ColumnEffect]:
    """Other shapes of the only column, or scales and centres of a product, with one coefficient and the same timing."""
    timing = {"lag_s": effect.lag_s, "response_s": effect.response_s}
    if isinstance(effect, Product):
        others = (*other_scales(effect, NEAR_SCALES), *other_centres(effect, coarse))
        return [structs.replace(other, response_range=()) for other in others]
    if len(effect.columns) > 1 or len(effect.coefficients) > 1:
        return []
    (name,) = effect.columns
    seen = coarse.context[name][coarse.timeline.valid]
    column = read_column(name, seen, coarse.timeline.periods.get(name, 0.0))
    if not isinstance(column, Column):
        return []
    plain, bent, _ = shapes_of(column, seen, curves=False)
    near = [
        structs.replace(effect, scale=share * effect.scale) for share in NEAR_SCALES if isinstance(effect, Proximity)
    ]
    return [
        structs.replace(shape, response_range=(), **timing)
        for shape in (*plain, *bent, *near)
        if shape.seen({name: seen[:1]}).shape[1] == 1
    ]


def _timed(fitted: Fitted, effect: ColumnEffect) -> list[FloatArray]:
    """Responses at 1 Hz per time constant, shape (n, lags, k)."""
    coarse = fitted.coarse
    late = [round(float(lag) / coarse.timeline.step) for lag in lags_about(effect.lag_s, NEAR_S, LAG_STEPS[-1])]
    quantity = coarse.fine_response(structs.replace(effect, lag_s=0.0, response_s=0.0, response_range=()))
    sums = (running_sums(coarse, quantity, response_s) for response_s in FINE_RESPONSES)
    return [np.stack([means_by_second(one, shift) for shift in late], axis=1) for one in sums]


def _profile(rows: FloatArray, left: FloatArray, contrast: FloatArray) -> tuple[float, float, float]:
    """Squares explained, the contrast's size, and its variance for noise of variance 1."""
    inverse = np.linalg.pinv(rows.T @ rows)
    products = rows.T @ left
    return (
        float(products @ inverse @ products),
        float(contrast @ inverse @ products),
        float(contrast @ inverse @ contrast),
    )
