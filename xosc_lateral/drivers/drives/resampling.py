"""From rows at irregular times to an even grid, without aliasing.

Resampling in two steps. Rows are interpolated linearly to 40 Hz, or to their own rate where that is higher (else what
is above 20 Hz would fold back here already), which evens out irregular stamps; a zero-phase
low-pass (Kaiser window, pass to 1.5 Hz, stop from 2.5 Hz = half the final rate, 50 dB) then keeps what lies above
half the final rate from folding back. Past its two ends a run is continued point-symmetrically, so that a slope is
kept. Context is averaged over +-0.2 s with positive weights instead: a leader that appears must not ring.

References
----------
.. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE ISCAS 1974.
"""

from __future__ import annotations

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.drivers.drives.filters import low_pass_between, mirrored

STEP = 0.2
"""Step of the model. [s]"""

OVERSAMPLING = 8
"""Points of the even grid per final step at least: 40 Hz. [-]"""

PASS_STEP = 0.18
"""Rows at least this far apart (in the median) are taken as 5 Hz already and only interpolated. [s]"""

STAMP_ERROR = 1e-3
"""Rounding of time stamps adds no point: rows at 40 Hz have 8 per step. [-]"""

ATTENUATION = 50.0
"""Of what would fold back: a movement of 1 m leaves 3 mm. [dB]"""

PASS_BAND_EDGES, STOP_BAND_EDGE = 1.5, 2.5
"""Of the low-pass, for rows at `STEP`. [Hz]"""


def resample(time: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    """Bring a measured series, finite, at increasing times [s] of shape (n,), to an even grid [s] without aliasing.

    Shape (m,) of the grid; just interpolated when the rows are as sparse as that already.
    """
    if _is_sparse(time, grid):
        return np.interp(grid, time, values)
    points = _points(time, grid)
    kernel = low_pass_between(PASS_BAND_EDGES, STOP_BAND_EDGE, STEP / points, ATTENUATION)
    fine = np.interp(_fine_grid(grid, points), time, values)
    return _decimate(mirrored(fine, len(kernel) // 2), kernel, len(grid), points)


def _is_sparse(time: FloatArray, grid: FloatArray) -> bool:
    return len(grid) < 2 or bool(np.median(np.diff(time)) >= PASS_STEP / STEP * (grid[1] - grid[0]))


def average(time: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    """Average a context column, shape (n,), over one step to each side (Hann weights).

    NaN ("there is none") or infinite ("nobody within reach") where the nearest row is, and in no average. `time` and
    `grid` in [s]; shape of `grid`, (m,), in the column's unit.
    """
    missing = ~np.isfinite(values)
    if missing.all():
        return nearest(time, values, grid)
    if _is_sparse(time, grid):
        result = np.interp(grid, time[~missing], values[~missing])
    else:
        points = _points(time, grid)
        kernel, fine_grid = np.hanning(2 * points + 1), _fine_grid(grid, points)
        weight = (nearest(time, missing.astype(np.float64), fine_grid) == 0).astype(np.float64)
        fine = np.interp(fine_grid, time[~missing], values[~missing]) * weight
        sums, weights = (_decimate(np.pad(part, points), kernel, len(grid), points) for part in (fine, weight))
        result = sums / np.where(weights > 0, weights, 1.0)
    closest = nearest(time, values, grid)
    return np.where(np.isfinite(closest), result, closest)


def nearest(time: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    """Value [unit of the column] of the row nearest in time [s], shape of `grid`."""
    right = np.clip(np.searchsorted(time, grid), 1, len(time) - 1) if len(time) > 1 else np.zeros(len(grid), dtype=int)
    left = np.maximum(right - 1, 0)
    return values[np.where(grid - time[left] <= time[right] - grid, left, right)]


def in_digits(values: FloatArray) -> FloatArray:
    """Twelve digits of the largest: averages of equal numbers are equal, whatever their errors."""
    largest = float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
    return np.round(values, 12 - int(np.ceil(np.log10(largest)))) if largest > 0.0 else values


def _points(time: FloatArray, grid: FloatArray) -> int:
    """Of the fine grid, per step of the grid: no fewer than there are rows."""
    rows = (grid[1] - grid[0]) / np.median(np.diff(time))
    return max(OVERSAMPLING, int(np.ceil(rows - STAMP_ERROR)))


def _fine_grid(grid: FloatArray, points: int) -> FloatArray:
    return np.linspace(grid[0], grid[-1], (len(grid) - 1) * points + 1)


def _decimate(extended: FloatArray, kernel: FloatArray, n: int, points: int) -> FloatArray:
    windows = np.lib.stride_tricks.sliding_window_view(extended, len(kernel))[::points]
    return np.asarray(windows[:n] @ kernel)
