"""From rows at irregular times to an even grid, without aliasing.

Resampling in two steps. Rows are interpolated linearly to 40 Hz, which evens out irregular stamps; a zero-phase
low-pass (Kaiser window, pass to 1.5 Hz, stop from 2.5 Hz = half the final rate, 50 dB) then keeps what lies above
half the final rate from folding back. Past its two ends a run is continued point-symmetrically, so that a slope is
kept. Context is averaged over +-0.2 s with positive weights instead: a leader that appears must not ring.

References
----------
.. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE ISCAS 1974.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.arrays import FloatArray
from xosc_lateral.drives.filters import kaiser_design, low_pass, mirrored

STEP = 0.2
"""Step of the model. [s]"""

OVERSAMPLING = 8
"""Points of the even grid per final step: 40 Hz. [-]"""

PASS_STEP = 0.18
"""Rows at least this far apart (in the median) are taken as 5 Hz already and only interpolated. [s]"""

ATTENUATION = 50.0
"""Of what would fold back: a movement of 1 m leaves 3 mm. [dB]"""

CUTOFF, TRANSITION = 0.8, 0.4
"""Middle and width of the low-pass's transition, as shares of half the final rate: from 1.5 Hz to 2.5 Hz. [-]"""


def resample(time: FloatArray, values: FloatArray, grid: FloatArray, *, oversampling: int = OVERSAMPLING) -> FloatArray:
    """Bring a measured series to an even grid without aliasing.

    Parameters
    ----------
    time, values : array, shape (n,)
        Increasing times [s] and finite values.
    grid : array, shape (m,)
        Even times. [s]
    oversampling : int
        Points of the inner grid per step of `grid`.

    Returns
    -------
    array, shape (m,)
        Just interpolated when the rows are as sparse as the grid already.
    """
    if len(grid) < 2 or np.median(np.diff(time)) >= PASS_STEP / STEP * (grid[1] - grid[0]):
        return np.interp(grid, time, values)
    kernel = _low_pass(oversampling)
    half = len(kernel) // 2
    fine = np.interp(_fine_grid(grid, oversampling), time, values)
    return _decimate(mirrored(fine, half), kernel, oversampling, len(grid))


def average(time: FloatArray, values: FloatArray, grid: FloatArray, *, oversampling: int = OVERSAMPLING) -> FloatArray:
    """Average a context column, shape (n,), over one step to each side (Hann weights).

    NaN ("there is none") or infinite ("nobody within reach") where the nearest row is, and in no average. `time` and
    `grid` in [s]; shape of `grid`, (m,), in the column's unit.
    """
    missing = ~np.isfinite(values)
    if missing.all():
        return nearest(time, values, grid)
    if len(grid) < 2 or np.median(np.diff(time)) >= PASS_STEP / STEP * (grid[1] - grid[0]):
        result = np.interp(grid, time[~missing], values[~missing])
    else:
        result = _hann_average(time, values, missing, grid, oversampling)
    closest = nearest(time, values, grid)
    return np.where(np.isfinite(closest), result, closest)


def _hann_average(
    time: FloatArray, values: FloatArray, missing: NDArray[np.bool_], grid: FloatArray, oversampling: int
) -> FloatArray:
    """Over one step to each side, shape of `grid`, of what is there; 0 where nothing is."""
    kernel = np.hanning(2 * oversampling + 1)
    fine_grid = _fine_grid(grid, oversampling)
    weight = (nearest(time, missing.astype(np.float64), fine_grid) == 0).astype(np.float64)
    fine = np.interp(fine_grid, time[~missing], values[~missing]) * weight
    sums = _decimate(np.pad(fine, len(kernel) // 2), kernel, oversampling, len(grid))
    weights = _decimate(np.pad(weight, len(kernel) // 2), kernel, oversampling, len(grid))
    result = sums / np.where(weights > 0, weights, 1.0)
    return np.asarray(result)


def nearest(time: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    """Value [unit of the column] of the row nearest in time [s], shape of `grid`."""
    return values[nearest_rows(time, grid)]


def nearest_rows(time: FloatArray, grid: FloatArray) -> NDArray[np.intp]:
    """The row nearest in time, shape of `grid`; both [s]."""
    right = np.clip(np.searchsorted(time, grid), 1, len(time) - 1) if len(time) > 1 else np.zeros(len(grid), dtype=int)
    left = np.maximum(right - 1, 0)
    return np.where(grid - time[left] <= time[right] - grid, left, right)


def column_on_grid(time: FloatArray, values: FloatArray, grid: FloatArray, *, held: bool) -> FloatArray:
    """A context column, shape (n,), at `grid` [s], shape (m,), in its unit: averaged, or `held` to what is there."""
    return (nearest if held else average)(time, values, grid)


def in_digits(values: FloatArray) -> FloatArray:
    """Twelve digits of the largest: averages of equal numbers are equal, whatever their errors."""
    largest = float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
    return np.round(values, 12 - int(np.ceil(np.log10(largest)))) if largest > 0.0 else values


def _fine_grid(grid: FloatArray, oversampling: int) -> FloatArray:
    return np.linspace(grid[0], grid[-1], (len(grid) - 1) * oversampling + 1)


def _decimate(extended: FloatArray, kernel: FloatArray, every: int, n: int) -> FloatArray:
    windows = np.lib.stride_tricks.sliding_window_view(extended, len(kernel))[::every]
    return np.asarray(windows[:n] @ kernel)


def _low_pass(oversampling: int) -> FloatArray:
    """Kernel on the inner grid, gain 1."""
    half, beta = kaiser_design(ATTENUATION, TRANSITION / oversampling)
    return low_pass(half, CUTOFF / oversampling, beta)
