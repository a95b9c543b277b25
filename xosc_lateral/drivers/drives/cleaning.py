"""Raw rows of one drive into clean ones: the same for every source, be it a file, a DataFrame or an import."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, true_slices
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.limits import DRIVE_SPAN, TIME
from xosc_lateral.drivers.drives.drive import MAX_GAP, Drive
from xosc_lateral.drivers.drives.evidence import UNIT_SIZES, of_clock
from xosc_lateral.drivers.drives.markings import both_markings

MAX_STEP = 0.25
"""Median step of a table that can give 5 Hz. [s]"""

LANE_WIDTHS = (2.0, 6.0)
"""What a lane's median width is believed to be. [m]"""

MAX_MEDIAN_SPEED = 50.0
"""A drive faster than this (180 km/h) in the median has its speed in km/h: 50 to 60 km/h are towns. [m/s]"""

MAX_OUTSIDE = 0.01
"""Share of rows farther than one lane width from the lane centre that is still taken for glitches. [-]"""

OWN_ROWS = 0.3
"""Share of a column's values in rows without a place that speaks of a bus of its own: all, less those that coincide;
where a camera loses the lane for that long, other columns are bridged over 0.5 s, and no more. [-]"""

CONTRADICTION_DISTANCE, MAX_CONTRADICTIONS = 0.05, 0.01
"""Rows of one time further apart contradict each other [m]; a larger share of them means several drives in one [-]."""

RUN = "following_run"
"""Column of tables that an import has cut: number of the road-following stretch. What it has cut is not cut again."""

VALID_BELOW, RESOLUTION = "valid_below", "resolution"
"""Columns of what a recording shows: driving below this frequency [Hz], offsets to this step [m]; each is one number
for a whole drive."""

DRIVE_COLUMNS = frozenset(
    {
        *("time", "drive", "driver", "offset", "lane_width", "distance_left", "distance_right"),
        *(RUN, VALID_BELOW, RESOLUTION),
    }
)
"""Columns that are no context."""


def clean_drive(
    name: str,
    columns: dict[str, FloatArray],
    levels: frozenset[str],
    path: Path,
    lost: Counter[str] | None = None,
) -> Drive | None:
    """Rows of one drive, from whatever source, sorted by time, without repeated times and rows without a place in the
    lane; None when nothing is left.

    `columns`, shape (n,): `time` [s], and `offset` and `lane_width` or `distance_left` and `distance_right` [m];
    `speed` [m/s] if known; `RUN` where an import has cut the drive; all others are context, of which `levels` hold
    levels. NaN: missing, or "there is none". Raises `FormatError` if a column can't be in the unit meant, or the rows
    are too far apart; `path` is what messages call the source. `lost` counts rows that are left out, by reason.
    """
    lost = Counter[str]() if lost is None else lost
    columns = _in_order(columns, name, path, lost)
    if RUN not in columns:
        _require_opposite(columns, name, path)
        place = np.isfinite(position(columns)[0])
        columns = {key: _bridged(key, columns, levels, place) for key in columns}
    offset, lane_width = position(columns)
    _check_units(name, columns, offset, lane_width, path)
    narrow = (lane_width < LANE_WIDTHS[0] / 2) | (lane_width > 2 * LANE_WIDTHS[1])
    good = np.isfinite(offset) & np.isfinite(lane_width) & ~narrow
    good[good] = np.abs(offset[good]) <= lane_width[good]
    left = [("no place in a lane", int(good.sum()))]
    if RUN in columns:
        good &= columns[RUN] >= 0  # also NaN is none
        left.append(("cut by the import", int(good.sum())))
    speed = columns.get("speed")
    if speed is not None and np.isfinite(speed).any():
        good &= np.isfinite(speed)
        left.append(("no speed", int(good.sum())))
    if RUN not in columns:
        good[good] = ~frozen_rows(columns["time"][good], offset[good], lane_width[good])
        left.append(("frozen", int(good.sum())))
    for (reason, after), before in zip(left, (len(good), *(count for _, count in left)), strict=False):
        lost[reason] += before - after
    if good.sum() < 2:
        lost["a drive of one row"] += int(good.sum())
        return None
    every = {key: values[good] for key, values in columns.items() if key not in DRIVE_COLUMNS}
    empty = frozenset(key for key, values in every.items() if np.isnan(values).all())
    width = lane_width[good]
    context = {key: values for key, values in every.items() if key not in empty} | {"lane_width": width}
    run = columns[RUN][good].astype(np.int64) if RUN in columns else None
    drive = Drive(
        name, columns["time"][good], offset[good], width,
        context, frozenset(levels & context.keys()), str(path), run, empty=empty,
        valid_below=_stated(VALID_BELOW, columns, good, path), resolution=_stated(RESOLUTION, columns, good, path),
    )  # fmt: skip
    seen = drive if run is not None else _seen_through(drive)
    lost["no marking to trust"] += len(drive) - len(seen)
    return seen


TOGETHER, LEAST_MOVEMENT = 0.7, 0.02
"""Correlation of how both distances change within a second from which they can't count from the vehicle to both sides:
lanes hardly get wider so fast, and a camera errs at each side by itself [-]; changes below tell nothing [m]."""


def _require_opposite(columns: Mapping[str, FloatArray], name: str, path: Path) -> None:
    """Refuse distances to the markings that grow and shrink together."""
    if not {"distance_left", "distance_right"} <= columns.keys() or len(columns["time"]) < 2:
        return
    rows = max(1, round(1.0 / max(float(np.median(np.diff(columns["time"]))), 1e-3)))
    left, right = (columns[key][rows:] - columns[key][:-rows] for key in ("distance_left", "distance_right"))
    known = np.isfinite(left + right) & (np.abs(left) < 1.0) & (np.abs(right) < 1.0)  # another lane is no movement
    if known.sum() < 2 or min(left[known].std(), right[known].std()) < LEAST_MOVEMENT:
        return
    if (agreement := float(np.corrcoef(left[known], right[known])[0, 1])) > TOGETHER:
        what = f"drive {name}: both grow and shrink together (correlation {agreement:.2f}), so one counts the other way"
        raise FormatError(
            f"{what}, or is not of the lane's other marking",
            path=path,
            element="columns 'distance_left', 'distance_right'",
        )


def _stated(column: str, columns: Mapping[str, FloatArray], good: BoolArray, path: Path) -> float | None:
    """The one number above 0 that a column has for a drive; None without the column, or where it is empty."""
    if column not in columns:
        return None
    values = np.unique(columns[column][good & np.isfinite(columns[column])])
    if not len(values):
        return None
    if len(values) > 1 or not values[0] > 0.0:
        what = (
            f"{values[0]:g}{f' and {values[-1]:g}' if len(values) > 1 else ''}, expected one number above 0 per drive"
        )
        raise FormatError(what, path=path, element=f"column {column!r}")
    return float(values[0])


def _bridged(name: str, columns: Mapping[str, FloatArray], levels: frozenset[str], place: BoolArray) -> FloatArray:
    """A context column at the rows with a `place`, where it comes in rows of its own, as buses are joined: without
    gaps as short as those of the offset that are bridged. Others stay as they are: no value, "there is none"."""
    values, time = columns[name], columns["time"]
    known = np.flatnonzero(~np.isnan(values))
    if name in DRIVE_COLUMNS or not len(known) or (~place[known]).mean() < OWN_ROWS:
        return values
    after = np.searchsorted(known, np.arange(len(values)))
    before, after = known[np.maximum(after - 1, 0)], known[np.minimum(after, len(known) - 1)]
    short = np.isnan(values) & (before < after) & (time[after] - time[before] <= MAX_GAP + 1e-9)
    if name in levels or not np.isfinite(values[known]).all():
        nearest = np.where(time - time[before] <= time[after] - time, before, after)
        return np.where(short, values[nearest], values)
    return np.where(short, np.interp(time, time[known], values[known]), values)


def _seen_through(drive: Drive) -> Drive:
    """With the other marking followed where a camera had misjudged one, and with what it saw of both."""
    seen = both_markings(drive.time, drive.offset, drive.lane_width)
    if seen is None:
        return drive
    mended, half_width = seen.mended(), 0.5 * drive.lane_width
    if mended is None:
        return replace(drive, half_width=half_width)
    kept = mended.kept
    context = {key: values[kept] for key, values in drive.context.items()} | {"lane_width": mended.lane_width[kept]}
    return replace(
        drive,
        time=drive.time[kept],
        offset=mended.offset[kept],
        lane_width=mended.lane_width[kept],
        context=context,
        mended=mended.shares,
        half_width=half_width[kept],
    )


def _in_order(columns: dict[str, FloatArray], name: str, path: Path, lost: Counter[str]) -> dict[str, FloatArray]:
    """Rows sorted by time, the first of each time kept."""
    known = np.flatnonzero(np.isfinite(columns["time"]))
    lost["no time"] += len(columns["time"]) - len(known)
    order = known[np.argsort(columns["time"][known], kind="stable")]
    columns = {key: values[order] for key, values in columns.items()}
    time = columns["time"]
    if len(time) < 2:
        return columns

    def refuse(what: str) -> None:
        raise FormatError(f"drive {name}: {what}", path=path, element="column 'time'")

    latest, span = float(np.abs(time[[0, -1]]).max()), float(time[-1] - time[0])
    for limit, duration in ((TIME, latest), (DRIVE_SPAN, span)):
        if duration > limit.value:
            refuse(limit.refusal(duration))
    repeated = np.concatenate([[False], np.diff(time) <= 0])
    lost["repeated time"] += int(repeated.sum())
    offset, later = position(columns)[0], np.flatnonzero(repeated)
    apart = int((np.abs(offset[later] - offset[later - 1]) > CONTRADICTION_DISTANCE).sum())
    if apart > max(5, MAX_CONTRADICTIONS * len(time)):
        refuse(
            f"{apart} of {len(time)} rows repeat a time with another offset; if the table holds several drives it "
            "needs a column 'drive'"
        )
    if wrong := of_clock(time[~repeated], MAX_STEP, is_named=True):
        refuse(wrong)
    return {key: values[~repeated] for key, values in columns.items()}


def position(columns: Mapping[str, FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Offset, positive to the left (far from the right marking), and lane width. [m]"""
    if {"offset", "lane_width"} <= columns.keys():
        return columns["offset"], columns["lane_width"]
    left, right = columns["distance_left"], columns["distance_right"]
    return (right - left) / 2, right + left


def _in_likely_unit(columns: Mapping[str, FloatArray], width: float) -> str:
    """Lanes' columns in the unit in which they would be nearest to usual ones; `width`: believed to be in m."""
    named = ("lane_width",) if "lane_width" in columns else ("distance_left", "distance_right")
    unit = min(UNIT_SIZES, key=lambda name: abs(np.log(max(width, 1e-9) / UNIT_SIZES[name] / np.mean(LANE_WIDTHS))))
    return " ".join(f"{name}=COLUMN:{unit}" for name in named)


def _check_units(
    name: str, columns: Mapping[str, FloatArray], offset: FloatArray, width: FloatArray, path: Path
) -> None:
    known = np.isfinite(offset) & np.isfinite(width)
    if not known.any():
        return
    offset, width = offset[known], width[known]
    median_width = float(np.median(width))
    if not LANE_WIDTHS[0] <= median_width <= LANE_WIDTHS[1]:
        raise FormatError(
            f"drive {name}: the lane is {median_width:.4g} m wide (median), expected {LANE_WIDTHS[0]:g} to "
            f"{LANE_WIDTHS[1]:g} m; name the unit with --map, as in {_in_likely_unit(columns, median_width)}",
            path=path,
        )
    outside = np.abs(offset) > np.maximum(width, LANE_WIDTHS[0])
    if outside.mean() > MAX_OUTSIDE:
        raise FormatError(
            f"drive {name}: offsets of up to {float(np.max(np.abs(offset))):.4g} m in a lane of {median_width:.3g} m, "
            f"{100 * outside.mean():.0f} % of the rows beyond a whole lane width; name the unit with --map, "
            "as in offset=COLUMN:cm",
            path=path,
        )


# ---- a camera that goes on saying the same ----
FROZEN_TIME = 1.0
"""Shorter repetitions do no harm: they are bridged or averaged. [s]"""

FROZEN_CHANCE = 1e-6
"""A stretch is frozen where a drive whose values otherwise repeat as often would have one so long this rarely. [-]"""

MINIMUM_CHANGES = 20
"""Fewer changes of value in a whole drive don't tell how often a value repeats: it was made, not measured. [-]"""


def frozen_rows(time: FloatArray, offset: FloatArray, lane_width: FloatArray) -> BoolArray:
    """Rows, but the first, of stretches in which offset and lane width repeat to the last digit; shape (n,)."""
    frozen = np.zeros(len(time), dtype=np.bool_)
    same = (np.diff(offset) == 0.0) & (np.diff(lane_width) == 0.0)
    if (~same).sum() < MINIMUM_CHANGES or (np.diff(offset) != 0.0).sum() < MINIMUM_CHANGES:
        return frozen
    repeated = int(same.sum())
    for part in true_slices(same):
        count = part.stop - part.start
        usual = (repeated - count) / max(len(same) - count, 1)
        if time[part.stop] - time[part.start] >= FROZEN_TIME and len(same) * usual**count < FROZEN_CHANCE:
            frozen[part.start + 1 : part.stop + 1] = True
    return frozen


def summary_of(drives: Sequence[Drive], left_out: Mapping[str, int]) -> dict[str, Any]:
    """What shows exchanged sides and wrong units: mean and spread of the offset, lane width [m]; 5 and 95 % quantile of
    the speed [m/s]; time driven [h]; drivers, and rows left out by reason, where there are any.
    """
    offset = np.concatenate([drive.offset for drive in drives])
    speed = np.concatenate([drive.speed for drive in drives if drive.speed is not None] or [np.zeros(0)])
    speed = speed[np.isfinite(speed)]
    figures = {
        "offset_mean_m": float(offset.mean()),
        "offset_sd_m": float(offset.std()),
        "lane_width_m": float(np.median(np.concatenate([drive.lane_width for drive in drives]))),
        "driven_h": sum(float(drive.time[-1] - drive.time[0]) for drive in drives) / 3600.0,
    }
    if len(speed):
        figures |= {f"speed_{share}": float(np.quantile(speed, share / 100.0)) for share in (5, 95)}
    if drivers := {drive.driver for drive in drives if drive.driver}:
        figures["drivers"] = len(drivers)
    rounded: dict[str, Any] = {name: round(value, 4) for name, value in figures.items()}
    return rounded | ({"left_out": dict(left_out)} if left_out else {})
