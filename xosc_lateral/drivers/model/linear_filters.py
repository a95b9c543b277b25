"""Linear recursions and symmetric kernels: the same sums in the same order, however a series is cut."""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.model.jit_kernel import JitKernel, worth_compiling

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

    From the past, shape (order,) or (order, paths), oldest first, and noise, shape (n,) or (n, paths), come both the
    past and the new values, shape (order + n,) or (order + n, paths). [any unit]
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


def _convolve_body(values, kernel, result):  # type: ignore[no-untyped-def]
    taps = len(kernel)
    half = taps // 2
    block = 512  # stays in the first-level cache through all taps
    for first in range(0, len(result), block):
        last = min(first + block, len(result))
        out = result[first:last]
        middle = values[first + half : last + half]
        for i in range(last - first):
            out[i] = kernel[half] * middle[i]
        k = 0
        while k + 4 <= half:  # four taps a pass spare three quarters of the stores
            w0, w1, w2, w3 = kernel[k], kernel[k + 1], kernel[k + 2], kernel[k + 3]
            before = values[first + k : last + k + 3]
            behind = values[first + taps - 4 - k : last + taps - 1 - k]
            for i in range(last - first):  # slices, so that the compiler sees plain indices and vectorises
                total = out[i] + w0 * (before[i] + behind[i + 3])
                total += w1 * (before[i + 1] + behind[i + 2])
                total += w2 * (before[i + 2] + behind[i + 1])
                out[i] = total + w3 * (before[i + 3] + behind[i])
            k += 4
        while k < half:
            weight = kernel[k]
            before = values[first + k : last + k]
            behind = values[first + taps - 1 - k : last + taps - 1 - k]
            for i in range(last - first):
                out[i] += weight * (before[i] + behind[i])
            k += 1


_convolve_compiled = JitKernel(_convolve_body).compiled


def convolve(values: FloatArray, kernel: FloatArray) -> FloatArray:
    """Values seen through a symmetric kernel of odd length.

    Every result is the same sum in the same order, however the values are cut into pieces. Of shape (n,) or (n, k),
    through `taps` of them they are of shape (n - taps + 1,) or (n - taps + 1, k). [any unit]
    """
    n = len(values) - len(kernel) + 1
    if values.size == len(values) and worth_compiling(n):
        result = np.empty(n)
        _convolve_compiled()(values.ravel(), kernel, result)
        return result.reshape(n, *values.shape[1:])
    half = len(kernel) // 2
    result = kernel[half] * values[half : half + n]
    for k in range(half):
        result += kernel[k] * (values[k : k + n] + values[len(kernel) - 1 - k :][:n])
    return np.asarray(result)
