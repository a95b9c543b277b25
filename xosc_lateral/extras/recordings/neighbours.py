"""Who drives ahead, behind and beside at every instant of a recording, whoever misses a frame included."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BLOCK, BoolArray, FloatArray, IntArray
from xosc_lateral.base.track import MAX_GAP
from xosc_lateral.extras.recordings.lane_order import NEIGHBOUR_DISTANCE, LaneGraph, Order, in_groups


def neighbour_columns(
    graph: LaneGraph,
    piece: IntArray,
    middle: FloatArray,
    time: FloatArray,
    vehicle: IntArray,
    step: float,
    speed: FloatArray,
    length: FloatArray,
    is_truck: BoolArray,
    *,
    scale: FloatArray | float = 1.0,
) -> dict[str, FloatArray]:
    """Columns of leader and neighbours, see `find_neighbours`, at every instant, whoever misses a frame included.

    Rows sorted by vehicle and time, shape (n,); `piece`: -1: in no lane; `middle`: of the vehicle, along its piece. [m]
    `step`: usual from row to row. [s] `scale`: metres along the lane per metre of `middle`. [-]
    """
    inside, piece = piece >= 0, np.maximum(piece, 0)
    part, middle, rank, own_scale = graph.stations(piece, middle)
    own_scale *= scale
    rank = np.where(inside, rank - int(rank.min()), -1)
    row_of, instant, middle, place = at_instants(
        middle, np.where(inside, part, -1), speed / own_scale, time, vehicle, step
    )  # fmt: skip
    on_left, on_right = graph.left >= 0, np.zeros(len(graph.left), dtype=np.bool_)
    on_right[graph.left[on_left]] = True
    by_time, parts = np.argsort(instant, kind="stable").astype(np.int32), int(part.max()) + 1
    columns, begin, n = dict[str, FloatArray | BoolArray](), 0, len(by_time)
    while begin < n:  # as many instants at a time as have some rows
        last = instant[by_time[min(begin + BLOCK, n) - 1]]
        end = int(np.searchsorted(instant, last, side="right", sorter=by_time))
        rows = by_time[begin:end]
        row, begin = row_of[rows], end
        near = find_neighbours(
            instant[rows] * parts + part[row], rank[row], middle[rows], length[row], is_truck[row],
            lane_on_left=on_left[piece[row]], lane_on_right=on_right[piece[row]], scale=own_scale[row],
        )  # fmt: skip
        for name, values in near.items():
            # an eighth of the memory where it will do, as long as all else is here
            columns.setdefault(name, np.empty(n, np.bool_ if name.endswith("is_truck") else np.float64))[rows] = values
    del row_of, instant, middle, by_time
    return {name: columns.pop(name)[place].astype(np.float64, copy=False) for name in list(columns)}


def find_neighbours(
    frame: IntArray,
    lane: IntArray,
    s: FloatArray,
    length: FloatArray,
    is_truck: BoolArray,
    *,
    lane_on_left: BoolArray,
    lane_on_right: BoolArray,
    scale: FloatArray | float = 1.0,
) -> dict[str, FloatArray]:
    """Leader in the same lane and nearest vehicle in the lanes beside: columns of the drive table, shape (n,) each.

    Distances are free space along the road, 0 while side by side; infinite: nobody is near, NaN: no such lane. [m]
    `frame`: equal for rows of one instant and carriageway. `lane`: 0 = rightmost driving lane, counting up to the left;
    negative: in none. `s`: vehicle centres, growing in the direction of travel. [m]
    `scale`: metres along the own lane per metre of `s`. [-]
    """
    known = lane >= 0
    group = in_groups(np.where(known, frame, -1), lane)
    order = Order(group, s)

    def nearest(aside: int, there: BoolArray, back: BoolArray) -> tuple[FloatArray, FloatArray]:
        best, truck = np.full(len(s), np.inf), np.zeros(len(s))
        for is_ahead in (True, False) if aside else (True,):
            other = order.next_to(np.where(known, group + aside, -1), s, is_ahead=is_ahead)
            free = np.maximum(scale * np.abs(s[other] - s) - 0.5 * (length[other] + length), 0.0)
            # a ramp's lane lies beside nothing before it comes in
            gap = np.where((other >= 0) & (there | back[other]), free, np.inf)
            closer = (gap < best) & (gap <= NEIGHBOUR_DISTANCE)
            best, truck = np.where(closer, gap, best), np.where(closer, is_truck[other], truck)
        return np.where(there & known | np.isfinite(best), best, np.nan), truck

    lead, lead_is_truck = nearest(0, known, known)
    left, left_is_truck = nearest(1, lane_on_left, lane_on_right)
    right, right_is_truck = nearest(-1, lane_on_right, lane_on_left)
    return {
        "lead_distance": lead, "lead_is_truck": lead_is_truck, "left_distance": left, "left_is_truck": left_is_truck,
        "right_distance": right, "right_is_truck": right_is_truck,
    }  # fmt: skip


STAMP_DISTANCE = 0.25  # stamps farther apart than this are of two instants ... [steps]
INSTANT_WIDTH = 0.5  # ... if no instant is then wider; else every vehicle has a clock of its own [steps]
FIRST_STEPS = 100  # a common clock is fitted to so many steps first, then to twice as many: never off by half a step


def instants(time: FloatArray, vehicle: IntArray, step: float) -> tuple[IntArray, FloatArray]:
    """Number of each row's instant, counted up from 0, and its time, shape (n,); `step`: median of a vehicle. [s]"""
    stamps = np.unique(time)
    at = np.searchsorted(stamps, time)
    new = np.r_[True, np.diff(stamps) > STAMP_DISTANCE * step]
    number = np.cumsum(new) - 1
    first = stamps[new]
    if (np.r_[stamps[:-1][new[1:]], stamps[-1]] - first <= INSTANT_WIDTH * step).all():
        return number[at], first[number][at]
    step, start = _clock(time, vehicle, step)
    number = np.round((time - start) / step).astype(np.int64)
    return number - number.min(), start + step * number


def _clock(time: FloatArray, vehicle: IntArray, step: float) -> tuple[float, float]:
    """Step and time of instant 0 of the even clock that fits all stamps best. [s]"""
    passed = np.diff(time)[np.diff(vehicle) == 0]
    count = np.round(passed / step)
    near = (count >= 1.0) & (count <= 3.0)
    step = float(passed[near].sum() / count[near].sum())
    start, span = float(time.min()), FIRST_STEPS * step
    begin = start
    while True:
        rows = time <= begin + span
        number = np.round((time[rows] - start) / step)
        if np.ptp(number) > 0.0:
            step, start = np.polyfit(number, time[rows], 1).tolist()
        if rows.all():
            return step, start
        span *= 2.0


def at_instants(
    along: FloatArray, part: IntArray, speed: FloatArray, time: FloatArray, vehicle: IntArray, step: float
) -> tuple[NDArray[np.int32], IntArray, FloatArray, NDArray[np.int32]]:
    """Every vehicle at every instant from its first to its last, those too that it misses for at most `MAX_GAP`.

    Row of the recording, or the last one before; number of the instant; way along the road there: between two rows of
    one part of the road, else as fast as before [m]; and place of each row of the recording among these, shape (n,).
    """
    instant, when = instants(time, vehicle, step)
    new = np.r_[True, (np.diff(vehicle) != 0) | (np.diff(instant) != 0)]
    row = np.flatnonzero(new)
    is_missed = (np.diff(vehicle[row]) == 0) & (np.diff(time[row]) <= MAX_GAP + 1e-9)
    missing = np.r_[np.where(is_missed, np.maximum(np.diff(instant[row]) - 1, 0), 0), 0]
    last, following = np.repeat(row, missing), np.repeat(np.r_[row[1:], row[-1]], missing)  # about what is filled
    after = np.arange(len(last)) - np.repeat(np.cumsum(missing) - missing, missing) + 1
    times = np.full(int(instant.max()) + 1, np.nan)
    times[instant] = when
    filled = instant[last] + after
    known = np.isfinite(times[filled])  # nobody was seen at others
    last, following, filled = last[known], following[known], filled[known]
    later = times[filled] - time[last]
    share = np.clip(later / np.maximum(time[following] - time[last], 1e-9), 0.0, 1.0)
    between = (share > 0.0) & (part[following] == part[last])
    way = along[last] + np.where(between, share * (along[following] - along[last]), speed[last] * later)
    moved = along[row] + speed[row] * (when[row] - time[row])
    del when
    instant = np.r_[instant[row], filled]  # no longer of every row
    # rows as numbers of half the usual size
    return np.r_[row, last].astype(np.int32), instant, np.r_[moved, way], np.cumsum(new, dtype=np.int32) - 1
