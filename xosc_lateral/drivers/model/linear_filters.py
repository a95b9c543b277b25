"""Linear recursions and symmetric kernels: the same sums in the same order, however a series is cut."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.lazy import njit

WORTH_IMPORTING = 50_000
"""Loop steps from which on numba is imported for them: three hours of driving. Who samples that much does so often."""

WORTH_CALLING = 200
"""Loop steps from which on the compiled loop is used when numba is there already."""


def worth_compiling(steps: int) -> bool:
    """Whether a loop of so many steps is faster compiled, the import of numba counted in."""
    return steps >= WORTH_IMPORTING or (steps >= WORTH_CALLING and "numba" in sys.modules)


def prepare(steps: int) -> None:
    """Have numba loaded when so many steps are worth it: for work that is then done in blocks that are not."""
    if worth_compiling(steps):
        import numba  # noqa: F401


class JitKernel:
    """A function over arrays with a plain Python body; call it with the count of its steps first.

    Importing numba costs 0.4 s, more than a scenario of a minute needs; a sample of hours needs it. Both ways give the
    same numbers to the last bit (no fast-math, no fused multiply-add). The body indexes its arguments with whole
    numbers only. It gets lists in plain Python (three times as fast as arrays there) and arrays when compiled, and
    writes its results into its array arguments.
    """

    def __init__(self, body: Callable[..., Any]) -> None:
        self.body = body
        self._compiled: Callable[..., Any] | None = None

    def __call__(self, steps: int, inputs: Sequence[Any], outputs: Sequence[np.ndarray[Any, Any]]) -> Any:
        """Run ``body(*inputs, *outputs)``; its return value is handed through."""
        if worth_compiling(steps):
            return self.compiled()(*inputs, *outputs)
        lists = [output.tolist() for output in outputs]
        result = self.body(*(value.tolist() if isinstance(value, np.ndarray) else value for value in inputs), *lists)
        for output, values in zip(outputs, lists, strict=True):
            output[...] = values
        return result

    def compiled(self) -> Callable[..., Any]:
        """The compiled body; from the cache on disk where there is one."""
        if self._compiled is None:
            self._compiled = njit(self.body)
        return self._compiled


CACHED = 16_000
"""Numbers that stay in a processor's second cache while sums of them are added to. [-]"""

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
        series = np.concatenate([past, noise])  # the same sums in the same order, one step of all paths after the other
        for t in range(order, len(series)):
            for k in range(order):
                series[t] += coefficients[k] * series[t - 1 - k]
        return series
    series = np.empty((order + len(noise)) * paths)
    series[: order * paths] = past.ravel()
    _recur(noise.size * max(1, order // 4), (noise.ravel(), coefficients, order, paths), (series,))
    return series.reshape(-1, *noise.shape[1:])


def _convolve_body(values, kernel, paths, result):  # type: ignore[no-untyped-def]
    # values side by side in `paths`, all flat, step by step
    taps = len(kernel)
    half = taps // 2
    block = 512  # stays in the first-level cache through all taps
    for first in range(0, len(result), block):
        last = min(first + block, len(result))
        out = result[first:last]
        middle = values[first + half * paths : last + half * paths]
        for i in range(last - first):
            out[i] = kernel[half] * middle[i]
        k = 0
        while k + 4 <= half:  # four taps a pass spare three quarters of the stores
            w0, w1, w2, w3 = kernel[k], kernel[k + 1], kernel[k + 2], kernel[k + 3]
            early, late = first + k * paths, first + (taps - 1 - k) * paths
            a0, z0 = values[early : early + block], values[late : late + block]
            a1, z1 = values[early + paths : early + paths + block], values[late - paths : late - paths + block]
            a2, z2 = (
                values[early + 2 * paths : early + 2 * paths + block],
                values[late - 2 * paths : late - 2 * paths + block],
            )
            a3, z3 = (
                values[early + 3 * paths : early + 3 * paths + block],
                values[late - 3 * paths : late - 3 * paths + block],
            )
            for i in range(last - first):  # slices, so that the compiler sees plain indices and vectorises
                total = out[i] + w0 * (a0[i] + z0[i])
                total += w1 * (a1[i] + z1[i])
                total += w2 * (a2[i] + z2[i])
                out[i] = total + w3 * (a3[i] + z3[i])
            k += 4
        while k < half:
            weight = kernel[k]
            early, late = first + k * paths, first + (taps - 1 - k) * paths
            before, behind = values[early : early + block], values[late : late + block]
            for i in range(last - first):
                out[i] += weight * (before[i] + behind[i])
            k += 1


_convolve_compiled = JitKernel(_convolve_body).compiled


def convolve(values: FloatArray, kernel: FloatArray) -> FloatArray:
    """Values seen through a symmetric kernel of odd length.

    Every result is the same sum in the same order, however the values are cut into pieces. Of shape (n,) or (n, k),
    through `taps` of them they are of shape (n - taps + 1,) or (n - taps + 1, k). [any unit]
    """
    n, paths = len(values) - len(kernel) + 1, values.size // max(len(values), 1)
    if worth_compiling(n * paths):
        result = np.empty(n * paths)
        _convolve_compiled()(values.ravel(), kernel, paths, result)
        return result.reshape(n, *values.shape[1:])
    half, rows = len(kernel) // 2, max(1, CACHED * len(values) // max(values.size, 1))
    result = np.asarray(kernel[half] * values[half : half + n])
    for first in range(0, n, rows):
        part = result[first : first + rows]
        for k in range(half):
            part += kernel[k] * (values[first + k :][: len(part)] + values[first + len(kernel) - 1 - k :][: len(part)])
    return result


# ---- a curve through samples with continuous lateral speed and acceleration ----
# Each piece is the quintic that meets value, slope and second derivative at both of its samples, where slope and second
# derivative are the central differences there. It needs one sample before and one behind the piece, no more, so that a
# stream can follow it; a spline through all samples would need them all.
# Derived here: six conditions (value, slope and second derivative at u = 0 and 1) fix the six coefficients; solved by
# hand.

Number = TypeVar("Number", float, FloatArray)

SAMPLES_AHEAD = 2
"""Samples from the beginning of a piece on that have to be known. [-]"""


def piece(before: Number, here: Number, there: Number, behind: Number) -> tuple[Number, ...]:
    """Six coefficients in u, from 0 at `here` to 1 at `there`, lowest power first; of one piece or of many."""
    rise = there - here
    slope, next_slope = 0.5 * (there - before), 0.5 * (behind - here)
    bend, next_bend = there - 2.0 * here + before, behind - 2.0 * there + here
    return (
        here,
        slope,
        0.5 * bend,
        10.0 * rise - 6.0 * slope - 4.0 * next_slope - 1.5 * bend + 0.5 * next_bend,
        -15.0 * rise + 8.0 * slope + 7.0 * next_slope + 1.5 * bend - next_bend,
        6.0 * rise - 3.0 * slope - 3.0 * next_slope - 0.5 * bend + 0.5 * next_bend,
    )


def extrapolate(before: Number, last: Number) -> Number:
    """The sample that would follow on a straight line. [unit of the samples]"""
    return 2.0 * last - before
