"""Which rows of a recording are road-following, and which recordings are refused.

Lane changes, gaps and short rests are cut. Offsets count to the left of travel, so a recording whose axes, headings or
side of the road are not those of its lanes has all signs wrong: wherever a vehicle moves, the directions of its way
through x and y, of its heading as recorded and of its lane have to agree, else it is refused with the likeliest cause.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray, blocks
from xosc_lateral.base.errors import FormatError
from xosc_lateral.base.lazy import pd
from xosc_lateral.drivers.drives.drive import MAX_GAP
from xosc_lateral.drivers.drives.lane_changes import MAXIMUM_HALF_DURATION, SETTLED_OFFSET, Course
from xosc_lateral.files.mapping import COMPASS

KEPT_ROWS = "kept"


@dataclass(frozen=True)
class CutSettings:
    """How tracks are cut."""

    max_gap: float = 1.0  # longest stretch of rows that the provider made up (between two cameras) that is kept [s]
    longest_change: float = MAXIMUM_HALF_DURATION  # a lane change is not sought farther from its crossing than this [s]
    margin: float = 1.0  # cut in addition before and after each lane change [s]
    # edge: cut at both ends of what is left: vehicles still settle there, or are about to set off, and trackers
    # have less to go by [s]
    edge: float = 2.0
    shortest: float = 5.0  # stretches below this are dropped [s]
    # open_offset: a track that begins or ends farther from the lane centre than this, moving sideways, is taken to do
    # so in a lane change whose rest was not seen [m]
    open_offset: float = SETTLED_OFFSET


DEFAULT_CUTS = CutSettings()


def lane_changes(
    x: FloatArray,
    offset: FloatArray,
    lane: IntArray,
    vehicle: IntArray,
    clock: FloatArray | float,
    settings: CutSettings,
) -> BoolArray:
    """Rows from where a vehicle sets off towards another lane to where it has settled there; arrays of shape (n,).

    `x`: lateral position, continuous through lane changes. [m] `offset`: from the centre of its lane. [m] Both NaN
    where unknown; rows sorted by vehicle and time; `clock`: their times, or the step between them. [s]
    """
    changing = np.zeros(len(x), dtype=np.bool_)
    side = np.broadcast_to(settings.open_offset, len(x))
    edges = np.flatnonzero(np.diff(vehicle, prepend=vehicle[:1] - 1, append=vehicle[-1:] + 1))
    for rows in (slice(*edge) for edge in pairwise(edges.tolist())):
        y, base = x[rows], x[rows] - offset[rows]
        known = np.flatnonzero(np.isfinite(base))
        if len(known) > 1:  # where it is in no lane, those before and after count
            time = clock[rows] if isinstance(clock, np.ndarray) else clock * np.arange(len(y), dtype=np.float64)
            base, y = (np.interp(time, time[known], values[known]) for values in (base, y))
            course = Course.across(time, y, base, lane[rows], side[rows], longest=settings.longest_change)
            changing[rows] = course.changing(settings.margin)
    return changing


def long_gaps(made_up: BoolArray, vehicle: IntArray, step: float, max_gap: float) -> BoolArray:
    """Rows in made-up stretches longer than `max_gap` [s]."""
    run = _runs((made_up[1:] != made_up[:-1]) | (vehicle[1:] != vehicle[:-1]))
    length = np.bincount(run) * step
    return np.asarray(made_up & (length[run] > max_gap + 1e-9))


def name_states(
    reasons: dict[str, BoolArray],
    lane: IntArray,
    vehicle: IntArray,
    time: FloatArray,
    step: float,
    settings: CutSettings,
) -> pd.Categorical[str]:
    """Per row `KEPT_ROWS`, or the first reason that cuts it; "edge" at the ends of what is left, "short" for crumbs."""
    code = np.zeros(len(time), dtype=np.int8)
    for k, cut in reversed([*enumerate(reasons.values(), 1)]):
        code[cut] = k
    kept = code == 0
    run = _kept_runs(kept, lane, vehicle, time)
    first = np.flatnonzero(np.r_[True, run[1:] != run[:-1]][: len(run)])
    begin, end = time[first], time[np.r_[first[1:], len(run)][: len(first)] - 1]
    row_seconds = (end - begin) / np.maximum(np.bincount(run) - 1, 1)  # a row stands for its step
    edge = settings.edge - 0.5 * row_seconds
    is_short = end - begin + row_seconds - 2 * settings.edge < settings.shortest - 1e-6
    for rows in blocks(len(run)):
        of, at = run[rows], time[rows]
        code[rows][kept[rows] & ((at - begin[of] < edge[of]) | (end[of] - at < edge[of]))] = len(reasons) + 1
        code[rows][kept[rows] & is_short[of]] = len(reasons) + 2
    return pd.Categorical.from_codes(code, categories=pd.Index([KEPT_ROWS, *reasons, "edge", "short"]))


def number_runs(state: pd.Categorical[str], lane: IntArray, vehicle: IntArray, time: FloatArray) -> IntArray:
    """Number of the kept stretch of each row, counted from 0 in every vehicle; -1 for rows that are cut."""
    kept = np.asarray(state == KEPT_ROWS)
    run = _kept_runs(kept, lane, vehicle, time)
    begins = kept & np.r_[True, (run[1:] != run[:-1])]
    del run
    counted = np.cumsum(begins)
    edges = np.flatnonzero(np.r_[True, vehicle[1:] != vehicle[:-1], True])
    counted -= np.repeat((counted - begins)[edges[:-1]] + 1, np.diff(edges))
    counted[~kept] = -1
    return counted


def _kept_runs(kept: BoolArray, lane: IntArray, vehicle: IntArray, time: FloatArray) -> IntArray:
    """Number of each row's stretch of equal fate, in one lane and without a gap that `fit` would not bridge."""
    other = (kept[1:] != kept[:-1]) | (vehicle[1:] != vehicle[:-1]) | (lane[1:] != lane[:-1])
    return _runs(other | (time[1:] - time[:-1] > MAX_GAP + 1e-9))


def _runs(new: BoolArray) -> IntArray:
    return np.cumsum(np.r_[False, new], dtype=np.int64)


MOVING_SPEED = 3.0  # slower vehicles have no direction: 2 cm of noise in 0.4 s turn the way at 3 m/s by 1 degree [m/s]
LANE_AGREEMENT = 0.7  # cosine of a vehicle's direction and that of the lane that it is taken to follow: 45 degrees [-]
HEADING_AGREEMENT = 0.94  # cosine of a vehicle's heading and of its way: 20 degrees, as of its front at R = 10 m [-]
MAX_AGAINST = 0.1
"""Share of the moving rows that may contradict: mirrored or turned recordings have all, or half where headings are
random; overtaking in the oncoming lane and vehicles that reverse have a few in a hundred. [-]"""

STRAIGHT_AGREEMENT = np.cos(np.radians(3.0))  # cosine of a heading and its edge's that is straight [-]
LEAST_SPREAD = 0.1  # standard deviation of places across the road from which their side can be told [m]
CLOCKWISE, NORTH = "counted clockwise", "counted clockwise from north"


def require_headings(heading: FloatArray, way: FloatArray, speed: FloatArray, path: Path) -> None:
    """Refuse headings as recorded that are not those of the way through x and y; all of shape (n,). [rad], [m/s]"""
    moving = (speed > MOVING_SPEED) & np.isfinite(heading + way)
    wrong = _share(np.cos(heading - way)[moving] < HEADING_AGREEMENT)
    if wrong <= MAX_AGAINST:
        return
    meant = {
        "in degrees, heading=COLUMN:deg": np.radians(heading),
        "the opposite direction": heading + np.pi,
        "counted from y": heading + 0.5 * np.pi,
        CLOCKWISE: -heading,
        NORTH: 0.5 * np.pi - heading,
        "in degrees, " + CLOCKWISE: -np.radians(heading),
        f"in degrees, {NORTH}, heading=COLUMN:{COMPASS}": 0.5 * np.pi - np.radians(heading),
    }
    shares = {name: _share(np.cos(other - way)[moving] < HEADING_AGREEMENT) for name, other in meant.items()}
    likely = min(shares, key=lambda name: shares[name])
    is_known = shares[likely] <= MAX_AGAINST
    cause = f"it may be {likely}" if is_known else "radians counter-clockwise from x are meant"
    what = f"contradicts the way through x and y in {100 * wrong:.0f} % of the moving rows; {cause}"
    raise FormatError(what, path=path, element="column 'heading'")


def require_lane_direction(agreement: FloatArray, speed: FloatArray, where: str, path: Path) -> BoolArray:
    """Rows against their lane by the cosine of way and lane (NaN: in none), shape (n,); refuse a recording of them."""
    against = (speed > MOVING_SPEED) & (agreement < 0.0)
    share = _share(against[(speed > MOVING_SPEED) & np.isfinite(agreement)])
    if share > MAX_AGAINST:
        cause = "y may point down, or one is of left-hand, the other of right-hand traffic"
        what = f"{100 * share:.0f} % of the moving rows drive against the direction of their lanes in {where}: {cause}"
        raise FormatError(what, path=path)
    return np.asarray(against)


def is_right_to_left(
    x: FloatArray, y: FloatArray, heading: FloatArray, across: FloatArray, edge: IntArray
) -> bool | None:
    """Whether places across an edge, as counted by a source, grow to the left of travel, by where they are; None: it
    can't be told. All of shape (n,). [m], [rad]"""
    from_line, counted = list[FloatArray](), list[FloatArray]()
    for number in np.unique(edge):
        mine = np.flatnonzero((edge == number) & np.isfinite(x + y + heading))
        if len(mine) < 2:
            continue
        way = float(np.arctan2(np.sin(heading[mine]).mean(), np.cos(heading[mine]).mean()))
        straight = mine[np.cos(heading[mine] - way) > STRAIGHT_AGREEMENT]
        if len(straight) > max(1, 0.9 * len(mine)):
            left = np.cos(way) * y[straight] - np.sin(way) * x[straight]
            from_line.append(left - left.mean())
            counted.append(across[straight] - across[straight].mean())
    left, places = (np.concatenate([np.zeros(0), *parts]) for parts in (from_line, counted))
    if not len(left) or min(left.std(), places.std()) < LEAST_SPREAD:
        return None
    agreement = float(np.corrcoef(left, places)[0, 1])
    return agreement > 0.0 if abs(agreement) > LANE_AGREEMENT else None


def _share(rows: BoolArray) -> float:
    return float(rows.mean()) if len(rows) else 0.0
