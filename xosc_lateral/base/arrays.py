"""Arrays: their types, rows of long ones in blocks, how fast what they hold changes; kernels; statistics."""

from __future__ import annotations

import copyreg
from collections.abc import Callable, Iterable, Iterator, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Int32Array = NDArray[np.int32]
IndexArray = NDArray[np.intp]
BoolArray = NDArray[np.bool_]


def frozen(values: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    """A mapping that nobody changes."""
    return MappingProxyType(values)


# Frozen mappings are values, too: they can be copied and pickled, which Python leaves out.
copyreg.pickle(MappingProxyType, lambda held: (frozen, (dict(held),)))

# ---- rows of long runs, worked on in blocks: the scratch of one pass stays small however long a run is ----
BLOCK = 65_536
"""Rows that are worked on at a time where all of a long run would take much memory: half a megabyte each. [-]"""


def columns(n: int, parts: Iterable[Sequence[NDArray[Any]]]) -> list[NDArray[Any]]:
    """Columns of shape (n,) each, n at least 1; read-only, and no longer than one value, where all values are the same.

    `parts`: blocks of their rows in order, the same columns each time, shape (rows of the block,) each.
    """
    made: list[NDArray[Any]] = []
    begin = 0
    for part in parts:
        end = begin + len(part[0])
        made = made or [
            values if end == n and not _is_all(values, values[:1]) else values[:1].copy() for values in part
        ]
        for k, values in enumerate(part if end - begin < n else ()):
            if len(made[k]) == 1 and not _is_all(values, made[k]):
                column = np.empty(n, values.dtype)
                column[:begin] = made[k]
                made[k] = column
            if len(made[k]) == n:
                made[k][begin:end] = values
        begin = end
    return [values if len(values) == n else np.broadcast_to(values, n) for values in made]


def _is_all(values: NDArray[Any], first: NDArray[Any]) -> bool:
    """Whether all values are the first one to the bit: a negative zero is another."""
    bits = f"u{values.dtype.itemsize}"
    return bool((np.ascontiguousarray(values).view(bits) == first.view(bits)).all())


def blocks(n: int, begin: int = 0) -> Iterator[slice]:
    """Rows from `begin` to n, at most `BLOCK` at a time."""
    for first in range(begin, n, BLOCK):
        yield slice(first, min(first + BLOCK, n))


def rows_where(n: int, holds: Callable[[slice], BoolArray], begin: int = 0) -> IndexArray:
    """Rows from `begin` to n where something holds, which is asked block by block."""
    parts = [np.flatnonzero(holds(rows)) + rows.start for rows in blocks(n, begin)]
    return np.concatenate(parts) if parts else np.empty(0, dtype=np.intp)


def true_slices(mask: BoolArray) -> list[slice]:
    """The longest slices in which a mask, shape (n,), is True throughout, in order."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return [slice(first, stop) for first, stop in edges.reshape(-1, 2).tolist()]


def slices_where(n: int, holds: Callable[[slice], BoolArray], begin: int = 0) -> list[slice]:
    """The longest slices of rows from `begin` to n where something holds, which is asked block by block."""
    stretches: list[slice] = []
    for rows in blocks(n, begin):
        for part in true_slices(holds(rows)):
            first, stop = rows.start + part.start, rows.start + part.stop
            if stretches and stretches[-1].stop == first:
                first = stretches.pop().start
            stretches.append(slice(first, stop))
    return stretches


# ---- how fast something changes: the one answer to how fast anything moves sideways ----
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
    return MAD_TO_SD * float(np.median(third)) / np.sqrt(20.0) if len(third) else 0.0


# ---- numbers of the normal distribution, and numbers with as many digits as mean something ----
NORMAL_95 = 1.96
"""Standard errors to either side that a 95 % interval has. [-]"""

NORMAL_90 = 1.645
"""Standard deviations to either side of the mean that hold 90 %: from the 5 % to the 95 % quantile. [-]"""

MAD_TO_SD = 1.4826
"""Standard deviation over median absolute deviation: one over the 75 % quantile. [-]"""


def significant(value: float, digits: int) -> float:
    """The nearest number with so many significant digits: a file is short, and the same on any machine.

    What another processor gives differs in the last digits, since its linear algebra adds up in another order. Where
    many digits fewer are kept, hardly ever does a number lie so near the border of two that it is rounded to the other.
    """
    return float(f"{value:.{digits}g}")


def all_significant(values: Iterable[float], digits: int) -> tuple[float, ...]:
    """Of each. In the unit of the values."""
    return tuple(significant(value, digits) for value in values)


# ---- series through symmetric kernels, continued beyond their ends ----
def filtered(values: FloatArray, kernel: FloatArray) -> FloatArray:
    """A series through a symmetric kernel, continued beyond its ends as by `mirrored`. Shape and unit of the values."""
    return np.convolve(mirrored(values, len(kernel) // 2), kernel, mode="valid")


def mirrored(values: FloatArray, rows: int) -> FloatArray:
    """A series continued by so many rows at both ends, shape (n + 2 * rows,), for a symmetric kernel. [any unit]

    Beyond each end it goes on as its mirror image through the end's point, as far as there is one, and stays there: a
    filter without delay leaves the ends, and straight lines, where they are.
    """
    near = min(rows, len(values) - 1)
    before, after = 2 * values[0] - values[near:0:-1], 2 * values[-1] - values[-2 : -near - 2 : -1]
    extended = np.concatenate([before, values, after])
    return np.pad(extended, rows - near, mode="edge") if near < rows else extended


def smoothed(values: FloatArray, width: float) -> FloatArray:
    """Gaussian smoothing, continued point-symmetrically past both ends, which stay where they are."""
    half = min(int(np.ceil(4.0 * width)), len(values) - 1)
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / width) ** 2)
    return filtered(values, kernel / kernel.sum())
