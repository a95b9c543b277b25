"""Whole drives on the model's grid, context throughout, offsets where road-following; each with room around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.drives.drive import STEP, CutRules, Drive, Run, average, cut_runs, grid_of, in_digits, nearest

MAXIMUM_LEVELS = 8
"""A column with no more different values than this holds levels. [-]"""


def circular_period(drives: Sequence[FloatArray]) -> float:
    """Full circle of a column, given for every drive, that wraps around, else 0. [unit of the column]

    It has a value everywhere; it jumps across its whole range again and again, hardly ever by a part of it, and mostly
    moves in small steps. The range is the circle, rounded to 360 or 2 pi when that is within 2 %.
    """
    values = np.concatenate(list(drives))
    if len(values) < 100 or not np.isfinite(values).all():
        return 0.0
    extent = float(values.max() - values.min())
    if extent <= 0.0 or len(np.unique(values)) <= MAXIMUM_LEVELS:
        return 0.0
    jump = np.concatenate([np.abs(np.diff(own)) for own in drives]) / extent
    wraps, between = int((jump > 0.9).sum()), int(((jump > 0.25) & (jump <= 0.9)).sum())
    if wraps < 2 or between > 0.3 * wraps or wraps > 0.05 * len(jump):
        return 0.0
    for circle in (360.0, 2.0 * np.pi):
        if abs(extent / circle - 1.0) < 0.02:
            return circle
    return extent


@dataclass(frozen=True, eq=False, slots=True)
class GriddedDrive:
    """One drive on the 0.2 s grid, arrays of shape (n,); context holds its outermost values in the pads around it."""

    name: str
    time: FloatArray  # The drive's own clock. [s]
    offset: FloatArray  # Positive to the LEFT of travel; 0 outside `valid`. [m]
    valid: BoolArray  # Road-following, not cut out.
    lane_width: FloatArray  # [m]
    context: Mapping[str, FloatArray]  # NaN: there is none.
    levels: frozenset[str]  # Columns of whole numbers.

    def __len__(self) -> int:
        return len(self.time)


def grid_drives(
    drives: Sequence[Drive], rules: CutRules, *, pad: int, multiple: int
) -> tuple[list[GriddedDrive], dict[str, float]]:
    """Every drive that has road-following in it, gridded, and the full circle of the columns that wrap around.

    With at least `pad` rows before and after each drive; each one's rows are a multiple of `multiple`, and all of them
    together a number whose Fourier transform is quick.
    """
    from scipy.fft import next_fast_len

    periods = circular_columns(drives)
    cut = [
        (drive, runs, grid_of(drive, slice(0, len(drive)), STEP))
        for drive in drives
        if (runs := cut_runs(drive, rules))
    ]
    rows = [-(-(len(grid) + 2 * pad) // multiple) * multiple for _, _, grid in cut]
    if rows:
        rows[-1] += multiple * next_fast_len(sum(rows) // multiple, real=True) - sum(rows)
    held = frozenset(periods)
    return [
        _gridded(drive, runs, grid, held, (pad, number - len(grid) - pad))
        for (drive, runs, grid), number in zip(cut, rows, strict=True)
    ], periods


def circular_columns(drives: Sequence[Drive]) -> dict[str, float]:
    """Full circle of every column that all drives have and that wraps around. [unit of the column]"""
    names = set(drives[0].context).intersection(*(drive.context for drive in drives))
    numbers = [name for name in sorted(names) if not any(name in drive.levels for drive in drives)]
    periods = {name: circular_period([drive.context[name] for drive in drives]) for name in numbers}
    return {name: period for name, period in periods.items() if period > 0.0}


def _gridded(
    drive: Drive, runs: Sequence[Run], grid: FloatArray, circular: frozenset[str], pads: tuple[int, int]
) -> GriddedDrive:
    """On its grid, with so many more rows before and after it."""
    offset, valid = np.zeros(len(grid)), np.zeros(len(grid), dtype=np.bool_)
    for run in runs:
        first = round((run.time[0] - grid[0]) / STEP)
        rows = slice(first, first + len(run))
        offset[rows], valid[rows] = run.offset, True
    held = drive.levels | circular

    def column(values: FloatArray, *, as_is: bool) -> FloatArray:
        gridded = nearest(drive.time, values, grid) if as_is else in_digits(average(drive.time, values, grid))
        return np.pad(gridded, pads, mode="edge")

    return GriddedDrive(
        drive.name,
        grid[0] + STEP * (np.arange(len(grid) + sum(pads)) - pads[0]),
        np.pad(offset, pads),
        np.pad(valid, pads),
        column(drive.lane_width, as_is=False),
        {name: column(values, as_is=name in held) for name, values in drive.context.items()},
        drive.levels,
    )
