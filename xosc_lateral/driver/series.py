"""Measured drives as numbers: rows as recorded, and the separate 5 Hz runs that are left once they are cut.

Resampling in two steps. Rows are interpolated linearly to 40 Hz, which evens out irregular stamps; a zero-phase
low-pass (Kaiser window, pass to 1.5 Hz, stop from 2.5 Hz = half the final rate, 50 dB) then keeps what lies above
half the final rate from folding back. Past its two ends a run is continued point-symmetrically, so that a slope is
kept. Context is averaged over +-0.2 s with positive weights instead: a leader that appears must not ring.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.errors import NotEnoughDataError

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

STEP = 0.2
"""Step of the model. [s]"""

MIN_SPEED = 40.0 / 3.6
"""Slower driving is cut out (arXiv:2405.17080, section III). [m/s]"""

LANE_CHANGE_MARGIN = 4.0
"""Cut on each side of the moment in which the marking is crossed: a lane change takes 4-6 s, half of it before. [s]"""

JUMP = 0.5
"""A change of the relative offset between two rows that means another lane. [-]"""

MAX_GAP = 0.5
"""Missing rows up to this long are bridged; longer ones end a run. [s]"""

MIN_RUN = 10.0
"""Shorter runs are left out: they hold no whole snippet. [s]"""

OVERSAMPLING = 8
"""Points of the even grid per final step: 40 Hz. [-]"""

PASS_STEP = 0.18
"""Rows at least this far apart (in the median) are taken as 5 Hz already and only interpolated. [s]"""


@dataclass(frozen=True, eq=False, slots=True)
class Drive:
    """One drive as recorded, in clean units: finite, sorted, each time once.

    Parameters
    ----------
    name : str
        Drive in the table, else the file's stem.
    time : array, shape (n,)
        Strictly increasing, steps may vary. [s]
    offset : array, shape (n,)
        From the lane centre, positive to the LEFT of travel. [m]
    lane_width : array, shape (n,)
        [m]
    context : mapping of str to array, shape (n,)
        Every other numeric column, and `speed` and `lane_width` under these names. NaN: there is none.
    levels : frozenset of str
        Context columns that hold a few whole numbers (lane index, flags): never averaged.
    source : str
        Where it was read. For messages.
    """

    name: str
    time: FloatArray
    offset: FloatArray
    lane_width: FloatArray
    context: Mapping[str, FloatArray] = field(default_factory=dict)
    levels: frozenset[str] = frozenset()
    source: str = ""

    def __post_init__(self) -> None:
        """Copy and freeze; refuse unequal lengths and what readers must have taken out."""
        _freeze(self)
        if np.any(np.diff(self.time) <= 0):
            raise ValueError(f"drive {self.name}: time does not increase")

    def __len__(self) -> int:
        """Count of rows."""
        return len(self.time)

    @property
    def speed(self) -> FloatArray | None:
        """[m/s], None when not recorded."""
        return self.context.get("speed")


@dataclass(frozen=True, eq=False, slots=True)
class Run:
    """A stretch of road-following driving on an even grid; nothing may be counted across two runs.

    Parameters
    ----------
    drive : str
        Name of the drive that it comes from.
    index : int
        Number of the run in its drive, from 0.
    time : array, shape (n,)
        Even, in the drive's own clock. [s]
    offset : array, shape (n,)
        Positive to the LEFT of travel. [m]
    lane_width : array, shape (n,)
        [m]
    context : mapping of str to array, shape (n,)
        As in `Drive`.
    levels : frozenset of str
        As in `Drive`.
    """

    drive: str
    index: int
    time: FloatArray
    offset: FloatArray
    lane_width: FloatArray
    context: Mapping[str, FloatArray] = field(default_factory=dict)
    levels: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        """Copy and freeze; refuse unequal lengths and missing values."""
        _freeze(self)

    def __len__(self) -> int:
        """Count of rows."""
        return len(self.time)

    @property
    def rel_offset(self) -> FloatArray:
        """Offset / lane width. [-]"""
        return self.offset / self.lane_width

    @property
    def speed(self) -> FloatArray | None:
        """[m/s], None when not recorded."""
        return self.context.get("speed")


@dataclass(frozen=True, slots=True)
class CutRules:
    """What is cut out of a drive; the defaults are the paper's where it gives one.

    Parameters
    ----------
    min_speed : float
        [m/s]
    lane_change_margin : float
        Cut on each side of a lane change. [s]
    max_gap : float
        Longest gap that is bridged. [s]
    min_run : float
        Shortest run that is kept. [s]
    step : float
        Of the runs. [s]
    """

    min_speed: float = MIN_SPEED
    lane_change_margin: float = LANE_CHANGE_MARGIN
    max_gap: float = MAX_GAP
    min_run: float = MIN_RUN
    step: float = STEP


PAPER_RULES = CutRules()


def cut_runs(drive: Drive, rules: CutRules = PAPER_RULES) -> list[Run]:
    """Road-following runs of one drive at an even step; empty when nothing is left."""
    keep = ~(lane_change_rows(drive, rules) | slow_rows(drive, rules))
    stretches = [rows for rows in _stretches(drive.time, keep, rules.max_gap) if _lasts(drive, rows, rules)]
    return [_run(drive, index, rows, rules.step) for index, rows in enumerate(stretches)]


def all_runs(drives: Sequence[Drive], rules: CutRules = PAPER_RULES) -> list[Run]:
    """Runs of several drives.

    Raises
    ------
    NotEnoughDataError
        When no run is left in any drive; says what was cut and why.
    """
    runs = [run for drive in drives for run in cut_runs(drive, rules)]
    if not runs:
        raise NotEnoughDataError(_why_nothing(drives, rules))
    return runs


def whole_run(drive: Drive, step: float = STEP) -> Run:
    """The drive from its first row to its last at an even step, nothing cut out, gaps bridged: for its context."""
    return _run(drive, 0, slice(0, len(drive)), step)


def lane_change_rows(drive: Drive, rules: CutRules = PAPER_RULES) -> BoolArray:
    """Rows within the margin of a lane change: `lane_index` changes, or the offset jumps by about a lane width.

    Returns
    -------
    array of bool, shape (n,)
    """
    step = np.abs(np.diff(drive.offset)) > JUMP * np.minimum(drive.lane_width[1:], drive.lane_width[:-1])
    lane = drive.context.get("lane_index")
    if lane is not None:
        known = np.flatnonzero(np.isfinite(lane))
        moved = known[:-1][np.diff(lane[known]) != 0]
        step[moved] = True
    at = np.flatnonzero(step)
    change = np.zeros(len(drive), dtype=np.bool_)
    first = np.searchsorted(drive.time, drive.time[at] - rules.lane_change_margin)
    last = np.searchsorted(drive.time, drive.time[at + 1] + rules.lane_change_margin, side="right")
    for begin, end in zip(first, last, strict=True):
        change[begin:end] = True
    return change


def slow_rows(drive: Drive, rules: CutRules = PAPER_RULES) -> BoolArray:
    """Rows below the least speed; none when no speed was recorded. Shape (n,)."""
    if drive.speed is None:
        return np.zeros(len(drive), dtype=np.bool_)
    return np.asarray(drive.speed < rules.min_speed)


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
    half_extension = min(half, len(fine) - 1)
    before = 2 * fine[0] - fine[half_extension:0:-1]
    after = 2 * fine[-1] - fine[-2 : -half_extension - 2 : -1]
    extended = np.concatenate([before, fine, after])
    if half_extension < half:
        extended = np.pad(extended, half - half_extension, mode="edge")
    return _decimate(extended, kernel, oversampling, len(grid))


def average(time: FloatArray, values: FloatArray, grid: FloatArray, *, oversampling: int = OVERSAMPLING) -> FloatArray:
    """Average a context column over one step to each side (Hann weights); NaN where the nearest row is NaN."""
    missing = np.isnan(values)
    if missing.all():
        return np.full(len(grid), np.nan)
    if len(grid) < 2 or np.median(np.diff(time)) >= PASS_STEP / STEP * (grid[1] - grid[0]):
        result = np.interp(grid, time[~missing], values[~missing])
    else:
        kernel = np.hanning(2 * oversampling + 1)
        fine_grid = _fine_grid(grid, oversampling)
        weight = (nearest(time, missing.astype(np.float64), fine_grid) == 0).astype(np.float64)
        fine = np.interp(fine_grid, time[~missing], values[~missing]) * weight
        sums = _decimate(np.pad(fine, len(kernel) // 2), kernel, oversampling, len(grid))
        weights = _decimate(np.pad(weight, len(kernel) // 2), kernel, oversampling, len(grid))
        result = sums / np.where(weights > 0, weights, 1.0)
    result[nearest(time, missing.astype(np.float64), grid) != 0] = np.nan
    return result


def nearest(time: FloatArray, values: FloatArray, grid: FloatArray) -> FloatArray:
    """Value of the row nearest in time, shape of `grid`."""
    right = np.clip(np.searchsorted(time, grid), 1, len(time) - 1) if len(time) > 1 else np.zeros(len(grid), dtype=int)
    left = np.maximum(right - 1, 0)
    return values[np.where(grid - time[left] <= time[right] - grid, left, right)]


def _run(drive: Drive, index: int, rows: slice, step: float) -> Run:
    time = drive.time[rows]
    grid = time[0] + step * np.arange(int((time[-1] - time[0]) / step + 1e-6) + 1)
    context = {
        name: (nearest if name in drive.levels else average)(time, values[rows], grid)
        for name, values in drive.context.items()
    }
    lane_width = average(time, drive.lane_width[rows], grid)
    offset = resample(time, drive.offset[rows], grid)
    return Run(drive.name, index, grid, offset, lane_width, context, drive.levels)


def _stretches(time: FloatArray, keep: BoolArray, max_gap: float) -> list[slice]:
    """Runs of kept rows without a gap."""
    if not keep.any():
        return []
    rows = np.flatnonzero(keep)
    ends = np.flatnonzero((np.diff(rows) > 1) | (np.diff(time[rows]) > max_gap))
    firsts = np.concatenate([[0], ends + 1])
    lasts = np.concatenate([ends, [len(rows) - 1]])
    return [slice(int(rows[first]), int(rows[last]) + 1) for first, last in zip(firsts, lasts, strict=True)]


def _lasts(drive: Drive, rows: slice, rules: CutRules) -> bool:
    time = drive.time[rows]
    return bool(time[-1] - time[0] >= rules.min_run - 0.5 * rules.step and len(time) > 1)


def _why_nothing(drives: Sequence[Drive], rules: CutRules) -> str:
    driven = sum(float(drive.time[-1] - drive.time[0]) for drive in drives if len(drive))
    rows = max(1, sum(map(len, drives)))
    slow = sum(float(slow_rows(drive, rules).sum()) for drive in drives) / rows
    changes = sum(float(lane_change_rows(drive, rules).sum()) for drive in drives) / rows
    return (
        f"no run of {rules.min_run:g} s is left in {driven:.1f} s of driving: {100 * slow:.0f} % of the rows are "
        f"below {3.6 * rules.min_speed:.0f} km/h, {100 * changes:.0f} % within "
        f"{rules.lane_change_margin:g} s of a lane change"
    )


def _fine_grid(grid: FloatArray, oversampling: int) -> FloatArray:
    return np.linspace(grid[0], grid[-1], (len(grid) - 1) * oversampling + 1)


def _decimate(extended: FloatArray, kernel: FloatArray, every: int, n: int) -> FloatArray:
    windows = np.lib.stride_tricks.sliding_window_view(extended, len(kernel))[::every]
    return np.asarray(windows[:n] @ kernel)


def _low_pass(oversampling: int) -> FloatArray:
    """Kaiser-windowed sinc, gain 1; cut-off 0.8, transition 0.4 of half the final rate wide, 50 dB."""
    attenuation = 50.0
    width, cutoff = 0.4 / oversampling, 0.8 / oversampling
    half = int(np.ceil((attenuation - 7.95) / (2.285 * np.pi * width) / 2))
    beta = 0.5842 * (attenuation - 21) ** 0.4 + 0.07886 * (attenuation - 21)
    kernel = np.sinc(cutoff * np.arange(-half, half + 1)) * np.kaiser(2 * half + 1, beta)
    return np.asarray(kernel / kernel.sum())


def _freeze(series: Drive | Run) -> None:
    name = series.name if isinstance(series, Drive) else series.drive
    n = len(series.time)
    for label in ("time", "offset", "lane_width"):
        values = _frozen(getattr(series, label), n, f"drive {name}: {label}")
        if not np.isfinite(values).all():
            raise ValueError(f"drive {name}: {label} is not finite")
        object.__setattr__(series, label, values)
    context = {key: _frozen(values, n, f"drive {name}: {key}") for key, values in series.context.items()}
    object.__setattr__(series, "context", MappingProxyType(context))


def _frozen(values: FloatArray, n: int, what: str) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    if array.shape != (n,):
        raise ValueError(f"{what}: shape {array.shape}, expected ({n},)")
    array.flags.writeable = False
    return array
