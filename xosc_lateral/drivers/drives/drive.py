"""Measured drives as numbers: rows as recorded, and the separate runs on an even grid that a cut leaves.

References
----------
.. [1] J. F. Kaiser, "Nonrecursive digital filter design using the I0-sinh window function", Proc. IEEE ISCAS 1974.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.errors import NotEnoughDataError
from xosc_lateral.base.track import MAX_GAP as MAX_GAP
from xosc_lateral.drivers.drives.filters import low_pass_between, mirrored
from xosc_lateral.drivers.drives.lane_changes import Course

# ---- from rows at irregular times to an even grid, without aliasing ----
# Rows are interpolated linearly to 40 Hz, or to their own rate where that is higher (else what is above 20 Hz would
# fold back here already), which evens out irregular stamps; a zero-phase low-pass (Kaiser window [1]_, pass to 1.5 Hz,
# stop from 2.5 Hz = half the final rate, 50 dB) then keeps what lies above half the final rate from folding back. Past
# its two ends a run is continued point-symmetrically, so that a slope is kept. Context is averaged over +-0.2 s with
# positive weights instead: a leader that appears must not ring.
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


# ---- drives and runs ----
@dataclass(frozen=True, slots=True)
class MarkingShares:
    """Rows in which a camera had misjudged a lane marking."""

    one_marking: float
    # Shares of a drive's rows that follow one marking because the other was misjudged (by 5 cm of offset and more), and
    # that were left out because both were. [-]
    no_marking: float


@dataclass(frozen=True, eq=False, slots=True)
class Drive:
    """One drive as recorded, in clean units: finite, sorted, each time once. Arrays of shape (n,)."""

    name: str  # Drive in the table, else the file's stem.
    time: FloatArray  # Strictly increasing, steps may vary. [s]
    offset: FloatArray  # From the lane centre, positive to the LEFT of travel. [m]
    lane_width: FloatArray  # [m]
    # Every other numeric column, and `speed` and `lane_width` under these names. NaN: there is none.
    context: Mapping[str, FloatArray] = field(default_factory=dict)
    # Context columns that hold a few whole numbers (lane index, flags): never averaged.
    levels: frozenset[str] = frozenset()
    source: str = ""  # Where it was read. For messages.
    # Number of each row's road-following stretch, where an import has cut the drive already: lane changes and their
    # margins are gone, and none are searched again. None: nothing has been cut.
    run: IntArray | None = None
    mended: MarkingShares | None = None  # Rows in which a camera had misjudged a marking, see `markings`.
    # Columns of its table that hold nothing in this drive, and are not in `context`: there is none, all along (no lane
    # to that side). Of a column that the table lacks, nothing is known.
    empty: frozenset[str] = frozenset()
    # Half the lane width as a camera recorded it, with errors of both markings, as the offset has them. None: the lane
    # width comes from a map, or from elsewhere than the offset. [m]
    half_width: FloatArray | None = None
    valid_below: float | None = None  # Frequency below which the recording shows driving, where it is known. [Hz]
    resolution: float | None = None  # Step or noise of the offsets, where it is known. [m]
    driver: str = ""  # Who drove, where the table says; several drives may be one driver's.

    def __post_init__(self) -> None:
        """Copy and freeze; refuse unequal lengths and what readers must have taken out."""
        _freeze(self, self.name)
        if np.any(np.diff(self.time) <= 0):
            raise ValueError(f"drive {self.name}: time does not increase")

    def __len__(self) -> int:
        return len(self.time)

    @property
    def speed(self) -> FloatArray | None:
        """Shape (n,) [m/s], None when not recorded."""
        return self.context.get("speed")


@dataclass(frozen=True, eq=False, slots=True)
class Run:
    """Road-following driving on an even grid, arrays of shape (n,); nothing may be counted across two runs."""

    drive: str  # Name of the drive that it comes from.
    index: int  # Number of the run in its drive, from 0.
    time: FloatArray  # Even, in the drive's own clock. [s]
    offset: FloatArray  # Positive to the LEFT of travel. [m]
    lane_width: FloatArray  # [m]
    context: Mapping[str, FloatArray] = field(default_factory=dict)  # As in `Drive`.
    levels: frozenset[str] = frozenset()
    empty: frozenset[str] = frozenset()  # As in `Drive`, as are the next two.
    valid_below: float | None = None
    resolution: float | None = None

    def __post_init__(self) -> None:
        """Copy and freeze; refuse unequal lengths and missing values."""
        _freeze(self, self.drive)

    def part(self, rows: slice, drive: str | None = None) -> Run:
        """Some of its rows, under its drive's name or another."""
        return replace(
            self,
            drive=drive or self.drive,
            time=self.time[rows],
            offset=self.offset[rows],
            lane_width=self.lane_width[rows],
            context={name: values[rows] for name, values in self.context.items()},
        )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def rel_offset(self) -> FloatArray:
        """Offset / lane width, shape (n,). [-]"""
        return self.offset / self.lane_width

    @property
    def speed(self) -> FloatArray | None:
        """Shape (n,) [m/s], None when not recorded."""
        return self.context.get("speed")


def _freeze(series: Drive | Run, name: str) -> None:
    """Copies that nobody can write to in place of its arrays; all but context and the run's number are finite."""
    n = len(series.time)

    def frozen(label: str, values: NDArray[Any], kind: DTypeLike = np.float64) -> NDArray[Any]:
        array = np.array(values, dtype=kind)
        if array.shape != (n,):
            raise ValueError(f"drive {name}: {label}: shape {array.shape}, expected ({n},)")
        array.flags.writeable = False
        return array

    if (number := getattr(series, "run", None)) is not None:
        object.__setattr__(series, "run", frozen("run", number, np.int64))
    width = series.lane_width
    for label in ("time", "offset", "lane_width", "half_width"):
        if (values := getattr(series, label, None)) is not None:
            object.__setattr__(series, label, frozen(label, values))
            if not np.isfinite(values).all():
                raise ValueError(f"drive {name}: {label} is not finite")
    context = {
        key: series.lane_width if values is width else frozen(key, values) for key, values in series.context.items()
    }
    object.__setattr__(series, "context", MappingProxyType(context))


# ---- what is cut out of a drive ----
LANE_JUMP_SHARE = 0.5
"""A change of the relative offset between two rows that means another lane. [-]"""

HALF_WIDTH = 0.9
"""Half of a car's width: a centre nearer than this to a marking has a wheel on it. [m]"""


ON_GRID = 1e-6
"""Steps by which a row may miss an instant of the grid and still be at it: times are sums of steps. [-]"""

MIN_RUN = 10.0
"""Shorter runs are left out: they hold no whole snippet. [s]"""


@dataclass(frozen=True, slots=True)
class CutRules:
    """What is cut out of a drive; the defaults are the paper's where it gives one."""

    min_speed: float = 40.0 / 3.6  # Slower driving is cut out (arXiv:2405.17080, section III). [m/s]
    # Cut on each side of the moment in which the marking is crossed: a lane change takes 4-6 s, half of it before. [s]
    lane_change_margin: float = 4.0
    max_gap: float = MAX_GAP  # Longest gap that is bridged. [s]
    min_run: float = MIN_RUN  # Shortest run that is kept. [s]
    step: float = STEP  # Of the runs. [s]


PAPER_RULES = CutRules()


def cut_runs(drive: Drive, rules: CutRules = PAPER_RULES) -> list[Run]:
    """Road-following runs of one drive at an even step; empty when nothing is left."""
    keep = ~(lane_change_rows(drive, rules) | slow_rows(drive, rules))
    parts = [(rows, grid_of(drive, rows, rules.step)) for rows in _uninterrupted(drive, keep, rules.max_gap)]
    lasting = [(rows, grid) for rows, grid in parts if (len(grid) - 0.5) * rules.step >= rules.min_run]
    return [_run(drive, index, rows, grid) for index, (rows, grid) in enumerate(lasting)]


def all_runs(drives: Sequence[Drive], rules: CutRules = PAPER_RULES) -> list[Run]:
    """Runs of several drives.

    Raises `NotEnoughDataError` when no run is left in any drive; says what was cut and why.
    """
    runs = [run for drive in drives for run in cut_runs(drive, rules)]
    if not runs:
        raise NotEnoughDataError(_why_nothing(drives, rules))
    return runs


def whole_run(drive: Drive) -> Run:
    """The drive from its first row to its last at an even step, nothing cut out, gaps bridged: for its context."""
    rows = slice(0, len(drive))
    return _run(drive, 0, rows, grid_of(drive, rows, STEP))


def grid_of(drive: Drive, rows: slice, step: float) -> FloatArray:
    """Instants of the drive's grid, from its first row on every `step` [s], within some of its rows. [s]

    All that is cut from a drive lies on one grid, so that it can be laid beside anything else of that drive.
    """
    first, last = (drive.time[[rows.start, rows.stop - 1]] - drive.time[0]) / step
    return np.asarray(drive.time[0] + step * np.arange(np.ceil(first - ON_GRID), np.floor(last + ON_GRID) + 1.0))


def lane_change_rows(drive: Drive, rules: CutRules = PAPER_RULES) -> BoolArray:
    """Rows within the margin of a lane change, shape (n,).

    From where it sets off to where it has settled, and by the margin at least on both sides of the crossing. A lane has
    changed where `lane_index` does, where the offset jumps by half a lane width and more, and where rows are
    missing while a wheel is on a marking: a camera that loses the lane there has another when it is back. None where an
    import has cut them already.
    """
    if drive.run is not None:
        return np.zeros(len(drive), dtype=np.bool_)
    at = np.flatnonzero(_changes(drive, rules))
    change = np.zeros(len(drive), dtype=np.bool_)
    if len(at):
        course = Course.of(drive.time, drive.offset, drive.lane_width, 2.0 * HALF_WIDTH)
        change = course.changing(0.0, in_part=False)
    first = np.searchsorted(drive.time, drive.time[at] - rules.lane_change_margin)
    last = np.searchsorted(drive.time, drive.time[at + 1] + rules.lane_change_margin, side="right")
    for begin, end in zip(first, last, strict=True):
        change[begin:end] = True
    return change


def lane_steps(offset: FloatArray, lane_width: FloatArray) -> BoolArray:
    """Steps from row to row by which the offset jumps into another lane, shape (n - 1,); both [m] of shape (n,)."""
    return np.asarray(np.abs(np.diff(offset)) > LANE_JUMP_SHARE * np.minimum(lane_width[1:], lane_width[:-1]))


def _changes(drive: Drive, rules: CutRules) -> BoolArray:
    """Steps from row to row between which the lane is another, shape (n - 1,)."""
    step = lane_steps(drive.offset, drive.lane_width)
    on_marking = np.abs(drive.offset) > 0.5 * drive.lane_width - HALF_WIDTH
    step |= (np.diff(drive.time) > rules.max_gap) & (on_marking[1:] | on_marking[:-1])
    lane = drive.context.get("lane_index")
    if lane is not None:
        known = np.flatnonzero(np.isfinite(lane))
        moved = known[:-1][np.diff(lane[known]) != 0]
        step[moved] = True
    return step


def slow_rows(drive: Drive, rules: CutRules = PAPER_RULES) -> BoolArray:
    """Rows below the least speed; none when no speed was recorded. Shape (n,). [-]"""
    return np.zeros(len(drive), dtype=np.bool_) if drive.speed is None else np.asarray(drive.speed < rules.min_speed)


def _run(drive: Drive, index: int, rows: slice, grid: FloatArray) -> Run:
    time = drive.time[rows]
    context = {
        name: (nearest if name in drive.levels else average)(time, values[rows], grid)
        for name, values in drive.context.items()
    }
    lane_width, offset = average(time, drive.lane_width[rows], grid), resample(time, drive.offset[rows], grid)
    return Run(
        drive.name, index, grid, offset, lane_width, context, drive.levels, drive.empty,
        drive.valid_below, drive.resolution,
    )  # fmt: skip


def _uninterrupted(drive: Drive, keep: BoolArray, max_gap: float) -> list[slice]:
    """Runs of kept rows without a gap."""
    if not keep.any():
        return []
    rows = np.flatnonzero(keep)
    new = (np.diff(rows) > 1) | (np.diff(drive.time[rows]) > max_gap)
    if drive.run is not None:
        new |= np.diff(drive.run[rows]) != 0
    parts = np.split(rows, np.flatnonzero(new) + 1)
    return [slice(int(part[0]), int(part[-1]) + 1) for part in parts]


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
