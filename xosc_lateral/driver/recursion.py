"""Linear recursions, step by step or side by side: the same sums in the same order."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.jit_kernel import JitKernel, worth_compiling

FloatArray = NDArray[np.float64]

WORTH_VECTORISING = 16
"""Recursions side by side from which on a step of all of them is one operation of numpy. [-]"""


def _recur_body(noise, coefficients, order, paths, series):  # type: ignore[no-untyped-def]
    # series: the last `order` values of each path first, then room for one value per noise; all flat, step by step
    if order == paths == 1:  # the same sum, three times as fast: the last value stays in a register
        value, keep = series[0], coefficients[0]
        for t in range(len(noise)):
            value = noise[t] + keep * value
            series[t + 1] = value
        return
    if paths == 1:  # plain indices, which the compiler vectorises
        for t in range(len(noise)):
            value = noise[t]
            for k in range(order):
                value += coefficients[k] * series[t + order - 1 - k]
            series[t + order] = value
        return
    for t in range(len(noise)):
        value = noise[t]
        for k in range(order):
            value += coefficients[k] * series[t + (order - 1 - k) * paths]
        series[t + order * paths] = value


_recur = JitKernel(_recur_body)


def recur(past: FloatArray, noise: FloatArray, coefficients: FloatArray) -> FloatArray:
    """Run linear recursions on: z[t] = noise[t] + sum over k of coefficients[k] z[t - 1 - k].

    (What `scipy.signal.lfilter` does too; importing that takes longer than a scenario.)

    Parameters
    ----------
    past : array, shape (order,) or (order, paths)
        Last values, oldest first.
    noise : array, shape (n,) or (n, paths)
    coefficients : array, shape (order,)

    Returns
    -------
    array, shape (order + n,) or (order + n, paths)
        The past and the new values.
    """
    order, paths = len(coefficients), noise.shape[1] if noise.ndim == 2 else 1
    if paths >= WORTH_VECTORISING and not worth_compiling(noise.size):
        return _recur_side_by_side(past, noise, coefficients)
    series = np.empty((order + len(noise)) * paths)
    series[: order * paths] = past.ravel()
    _recur(noise.size * max(1, order // 4), (noise.ravel(), coefficients, order, paths), (series,))
    return series.reshape(-1, *noise.shape[1:])


def _recur_side_by_side(past: FloatArray, noise: FloatArray, coefficients: FloatArray) -> FloatArray:
    """The same sums in the same order, one step of all paths after the other."""
    order = len(coefficients)
    series = np.concatenate([past, noise])
    for t in range(order, len(series)):
        for k in range(order):
            series[t] += coefficients[k] * series[t - 1 - k]
    return series
