"""Whole drives on the model's grid, context throughout, offsets where road-following; each with room around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.drivers.drives.drive import CutRules, Drive, Run, cut_runs, grid_of
from xosc_lateral.drivers.drives.resampling import STEP, average, in_digits, nearest

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

    def padded(self, before: int, after: int, time: FloatArray) -> GriddedDrive:
        """With so many more rows, in which nothing is valid and context holds; `time` is the whole new one. [s]"""
        pads = (before, after)
        return replace(
            self,
            time=time,
            offset=np.pad(self.offset, pads),
            valid=np.pad(self.valid, pads),
            lane_width=np.pad(self.lane_width, pads, mode="edge"),
            context={name: np.pad(values, pads, mode="edge") for name, values in self.context.items()},
        )


def grid_drives(
    drives: Sequence[Drive], rules: CutRules, *, pad: int, multiple: int
) -> tuple[list[GriddedDrive], dict[str, float]]:
    """Every drive that has road-following in it, gridded, and the full circle of the columns that wrap around.

    With at least `pad` rows before and after each drive; each one's rows are a multiple of `multiple`, and all of them
    together a number whose Fourier transform is quick.
    """
    from scipy.fft import next_fast_len

    periods = circular_columns(drives)
    cut = [(drive, cut_runs(drive, rules)) for drive in drives]
    kept = []
    for drive, runs in cut:
        if runs:
            part = _gridded(drive, runs, frozenset(periods))
            rows = -(-(len(part) + 2 * pad) // multiple) * multiple
            time = part.time[0] + STEP * (np.arange(rows) - pad)
            kept.append(part.padded(pad, rows - len(part) - pad, time))
    if kept:
        last, total = kept[-1], sum(map(len, kept))
        more = multiple * next_fast_len(total // multiple, real=True) - total
        later = last.time[-1] + STEP * np.arange(1, more + 1)
        kept[-1] = last.padded(0, more, np.concatenate([last.time, later]))
    return kept, periods


def circular_columns(drives: Sequence[Drive]) -> dict[str, float]:
    """Full circle of every column that all drives have and that wraps around. [unit of the column]"""
    names = set(drives[0].context).intersection(*(drive.context for drive in drives))
    numbers = [name for name in sorted(names) if not any(name in drive.levels for drive in drives)]
    periods = {name: circular_period([drive.context[name] for drive in drives]) for name in numbers}
    return {name: period for name, period in periods.items() if period > 0.0}


def _gridded(drive: Drive, runs: Sequence[Run], circular: frozenset[str]) -> GriddedDrive:
    grid = grid_of(drive, slice(0, len(drive)), STEP)
    offset, valid = np.zeros(len(grid)), np.zeros(len(grid), dtype=np.bool_)
    for run in runs:
        first = round((run.time[0] - grid[0]) / STEP)
        rows = slice(first, first + len(run))
        offset[rows], valid[rows] = run.offset, True
    held = drive.levels | circular
    context = {
        name: nearest(drive.time, values, grid) if name in held else in_digits(average(drive.time, values, grid))
        for name, values in drive.context.items()
    }
    lane_width = in_digits(average(drive.time, drive.lane_width, grid))
    return GriddedDrive(drive.name, grid, offset, valid, lane_width, context, drive.levels)
