"""Cut an entity's path where it stands, is placed anew or is gone, and choose the vertices that are written.

The reference player merges polyline vertices closer than 0.1 m, and with them their times: written at 10 Hz, a car that
stops for 5 s ends up 0.67 m off. So a path is cut at every stop; where it is driven slowly, vertices are spaced by
distance instead of time. Between two vertices the player drives at constant speed: 0.1 s of acceleration a is then off
by a * 0.1^2 / 8 (1 cm at 8 m/s2), and the last 0.1 m before a stop by a quarter of that distance. Where that is not
enough, at a sudden change of speed, a vertex is added.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, blocks, rows_where, slices_where
from xosc_lateral.world.motion.nominal import Activity

VERTEX_STEP = 0.1
"""Time between vertices where distance and bends allow it. [s]"""
LEAST_BEND_GAPS = 3
"""Gaps in a row that a path is cut in by half the tolerance or more: a kink is in one gap, or in two. [-]"""
VERTEX_SPACING = 0.105
"""Least distance between vertices: the player's 0.1 m and a margin for rounding. [m]"""
LEAST_SPACING = VERTEX_SPACING - 1e-6
"""What counts as that far, rounding aside. [m]"""
VERTEX_DISTANCE = 4.0
"""Distance between vertices: the player turns cars within 2 m of one, more sharply where they are farther apart. [m]"""
TOLERANCE = 0.01
"""Where straight motion between two vertices is further off than this, a vertex is added. [m]"""
LARGE_ERROR = 0.04
"""Where it is still further off than this, a vertex takes the place of its neighbours. [m]"""
REFINEMENTS = 4
"""How often vertices are added, and then replaced: each time one per gap."""
LEAST_STEP = 1e-5
"""A smaller step has no direction. [m]"""
STANDSTILL_SPEED = 0.005
"""Slower counts as standing. [m/s]"""
STANDSTILL_TIME = 0.3
"""A shorter stop is driven through, unless the piece begins or ends with it. [s]"""


class RowStretch(Struct, frozen=True):
    """A stretch of rows without a stop."""

    first: int  # rows, both included; equal: the entity is only placed there
    last: int
    placed: bool  # it begins by being placed there (teleport, or added), in the step that ends with row `first`
    stops: bool  # the entity stands when it is over


def cut_path(time: FloatArray, x: FloatArray, y: FloatArray, activity: NDArray[np.uint8]) -> list[RowStretch]:
    """Pieces of one entity's path, in order, from its rows, shape (n,): [s], [m], `Activity` bits."""

    def active(rows: slice) -> BoolArray:
        return np.asarray((activity[rows] & Activity.ACTIVE) != 0)

    def teleported(rows: slice) -> BoolArray:
        return np.asarray((activity[rows] & Activity.TELEPORTED) != 0)

    pieces: list[RowStretch] = []
    for part in slices_where(len(time), active):
        cuts = [part.start, *rows_where(part.stop, teleported, part.start + 1).tolist(), part.stop]
        for begin, end in pairwise(cuts):
            placed = begin > 0
            pieces.extend(_cut_at_stops(time, x, y, begin, end - 1, placed))
    return pieces


def vertex_times(time: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Times of the vertices of one piece, ends included; fewer than 2 when it is shorter than the vertex spacing. [s]

    Every `VERTEX_STEP` (or evenly more often, for sharp bends), but never closer than `VERTEX_SPACING`. Counted from
    the start, and near the end from the end, so that the last stretch before a stop is not longer than it has to be.
    """
    way, driven = np.empty(len(time)), np.zeros(1)
    way[:1] = 0.0
    for rows in blocks(len(time), 1):
        around = slice(rows.start - 1, rows.stop)
        driven = np.cumsum(np.append(driven[-1:], np.hypot(np.diff(x[around]), np.diff(y[around]))))
        # Strictly increasing distance, so that it can be turned into time where the entity creeps.
        way[rows] = driven[1:] + np.arange(rows.start, rows.stop) * 1e-12
    if driven[-1] < LEAST_SPACING:
        return time[:1]
    step, head = _step(time, way, x, y)
    tail = _tail(time, way, step)
    if _way_at(tail[0], time, way) < 2.0 * VERTEX_SPACING and len(tail) > 1:
        # Slow from end to end: evenly, so that no gap is left over.
        times = np.interp(np.linspace(0.0, way[-1], int(way[-1] / VERTEX_SPACING) + 1), way, time)
    else:
        head = _head(time, way, tail[0], step) if len(tail) > 1 else head
        while len(head) > 1 and _way_at(tail[0], time, way) - _way_at(head[-1], time, way) < LEAST_SPACING:
            head = head[:-1]
        times = np.append(head, tail)
    error = _error(times, time, x, y)
    for replace in (False, True):
        for _ in range(REFINEMENTS):
            refined = _refined(times, time, way, error, replace=replace)
            after = error if refined is times else _error(refined, time, x, y)
            if after.largest >= error.largest:
                break
            times, error = refined, after
    return _thinned(times, _interpolated(times, time, x), _interpolated(times, time, y))


def _interpolated(moments: FloatArray, time: FloatArray, values: FloatArray) -> FloatArray:
    """`np.interp` in blocks of moments."""
    return np.concatenate([np.interp(moments[part], time, values) for part in blocks(len(moments))])


def _thinned(times: FloatArray, x: FloatArray, y: FloatArray) -> FloatArray:
    """Without vertices too close to their neighbours in the plane; the ends stay, or the first alone: no path."""
    if (np.hypot(np.diff(x), np.diff(y)) >= LEAST_SPACING).all():
        return times
    kept = [0]
    for k in range(1, len(times)):
        if np.hypot(x[k] - x[kept[-1]], y[k] - y[kept[-1]]) >= LEAST_SPACING:
            kept.append(k)
    last = len(times) - 1
    if kept[-1] != last:
        # The end takes the place of what is too close before it.
        while len(kept) > 1 and np.hypot(x[last] - x[kept[-1]], y[last] - y[kept[-1]]) < LEAST_SPACING:
            kept.pop()
        if np.hypot(x[last] - x[kept[-1]], y[last] - y[kept[-1]]) >= LEAST_SPACING:
            kept.append(last)
    return times[kept]


class _Error(NamedTuple):
    """How far straight motion between the vertices is from the path: at most, and on rows beyond the tolerance. [m]"""

    largest: float
    rows: NDArray[np.intp]
    there: FloatArray


def _error(times: FloatArray, time: FloatArray, x: FloatArray, y: FloatArray) -> _Error:
    at_x, at_y = _interpolated(times, time, x), _interpolated(times, time, y)
    largest, places, there = 0.0, [np.empty(0, dtype=np.intp)], [np.empty(0)]
    for rows in blocks(len(time)):
        away = np.hypot(x[rows] - np.interp(time[rows], times, at_x), y[rows] - np.interp(time[rows], times, at_y))
        beyond = np.flatnonzero(away > TOLERANCE)
        largest = max(largest, float(away.max()))
        places.append(rows.start + beyond)
        there.append(away[beyond])
    return _Error(largest, np.concatenate(places), np.concatenate(there))


def _refined(times: FloatArray, time: FloatArray, way: FloatArray, error: _Error, *, replace: bool) -> FloatArray:
    """A vertex on the worst row of each gap that needs one; `replace`: those too close give way to large errors'."""
    if not (error.there > (LARGE_ERROR if replace else TOLERANCE)).any():
        return times
    at = _interpolated(times, time, way)
    gap = np.searchsorted(times, time[error.rows], side="right")
    if replace:
        room = np.minimum(way[error.rows], way[-1] - way[error.rows])  # way to the ends
    else:
        before = np.clip(gap - 1, 0, len(at) - 2)
        room = np.minimum(way[error.rows] - at[before], at[before + 1] - way[error.rows])  # to the next vertices
    wanted = np.flatnonzero((error.there > (LARGE_ERROR if replace else TOLERANCE)) & (room >= LEAST_SPACING))
    if len(wanted) == 0:
        return times
    order = wanted[np.lexsort((-error.there[wanted], gap[wanted]))]
    _, worst = np.unique(gap[order], return_index=True)
    added = _spaced(error.rows[order[worst]], way)
    taken = np.concatenate(([-np.inf], way[added], [np.inf]))
    after = np.searchsorted(taken, at)
    keep = np.minimum(at - taken[after - 1], taken[after] - at) >= LEAST_SPACING
    keep[[0, -1]] = True
    return np.sort(np.concatenate((times[keep], time[added])))


def _spaced(rows: NDArray[np.intp], way: FloatArray) -> NDArray[np.intp]:
    """Those rows that are far enough from the one kept before."""
    kept = [rows[0]]
    for row in rows[1:]:
        if way[row] - way[kept[-1]] >= LEAST_SPACING:
            kept.append(row)
    return np.array(kept)


def _cut_at_stops(
    time: FloatArray, x: FloatArray, y: FloatArray, first: int, last: int, placed: bool
) -> list[RowStretch]:
    """Pieces between the stops and turns backwards inside rows first..last, which hold no jump."""
    stops = _stops(time, x, y, first, last)
    pieces = []
    begin = first
    for stop_begin, stop_end in stops:
        if stop_begin > begin or (begin == first and placed):
            pieces.append(RowStretch(begin, stop_begin, placed and begin == first, stops=stop_end > stop_begin))
        begin = stop_end
    if begin < last or (begin == first and placed):
        pieces.append(RowStretch(begin, last, placed and begin == first, stops=False))
    return pieces


def _stops(time: FloatArray, x: FloatArray, y: FloatArray, first: int, last: int) -> list[tuple[int, int]]:
    """Rows between which it stands, and those in which it turns round, in order."""

    def still(rows: slice) -> BoolArray:
        around = slice(rows.start, rows.stop + 1)
        moved = np.hypot(np.diff(x[around]), np.diff(y[around]))
        return np.asarray(moved < STANDSTILL_SPEED * np.diff(time[around]))

    stops = [
        (part.start, part.stop)
        for part in slices_where(last, still, first)
        if part.start == first or part.stop == last or time[part.stop] - time[part.start] >= STANDSTILL_TIME
    ]
    turned = _reversals(x, y, first, last)
    stops += [(row, row) for row in turned if not any(begin <= row <= end for begin, end in stops)]
    return sorted(stops)


def _reversals(x: FloatArray, y: FloatArray, first: int, last: int) -> list[int]:
    """Rows at which the entity goes back the way it came: a path that is followed by its length has no such fold."""
    turns: list[int] = []
    before = np.empty(0, dtype=np.complex128)
    for rows in blocks(last, first):
        around = slice(rows.start, rows.stop + 1)
        step = np.diff(x[around]) + 1j * np.diff(y[around])
        moving = np.flatnonzero(np.abs(step) > LEAST_STEP)
        moved = np.append(before, step[moving])
        back = (moved[1:] * np.conj(moved[:-1])).real < 0.0
        turns += (rows.start + moving[len(moving) - len(back) :][back]).tolist()
        before = moved[-1:]
    return turns


def _step(time: FloatArray, way: FloatArray, x: FloatArray, y: FloatArray) -> tuple[float, FloatArray]:
    """`VERTEX_STEP`, or less for bends that it would cut, the same everywhere; and the piece's `_head` then."""
    end = float(time[-1])
    for step in (VERTEX_STEP, VERTEX_STEP / 2.0):
        head = _head(time, way, end, step)
        if not _is_cut(np.append(head, end), time, x, y):
            return step, head
    step = float(time[1] - time[0])
    return step, _head(time, way, end, step)


def _is_cut(times: FloatArray, time: FloatArray, x: FloatArray, y: FloatArray) -> bool:
    """A bend, which is more than a kink: too far from straight in the middle of several gaps in a row."""

    def is_far(gaps: slice) -> BoolArray:
        moments = times[gaps.start : gaps.stop + 1]
        ends = np.array([np.interp(moments, time, x), np.interp(moments, time, y)])
        middle = 0.5 * (moments[1:] + moments[:-1])
        chord = np.diff(ends)
        away = np.array([np.interp(middle, time, x), np.interp(middle, time, y)]) - ends[:, :-1]
        aside = np.abs(chord[0] * away[1] - chord[1] * away[0]) / np.maximum(np.hypot(*chord), LEAST_STEP)
        return np.asarray(aside > TOLERANCE / 2.0)

    return any(part.stop - part.start >= LEAST_BEND_GAPS for part in slices_where(len(times) - 1, is_far))


def _head(time: FloatArray, way: FloatArray, until: float, step: float) -> FloatArray:
    """Vertices up to where those of the tail begin; evenly, since a player turns the car within half a gap."""
    times = [time[:1]]
    step = (until - float(time[0])) / max(1, round((until - float(time[0])) / step))
    count = 512
    while True:
        # As long as neither bound counts many at once, the more the longer that holds.
        even = np.add.accumulate(np.array([times[-1][-1], *[step] * count]))
        at = np.interp(even[:-1], time, way)
        nearest, farthest = (np.interp(at + far, way, time, right=np.inf) for far in (VERTEX_SPACING, VERTEX_DISTANCE))
        following = np.minimum(np.maximum(even[1:], nearest), farthest)
        count = 1 + int(np.argmax(np.append(following != even[1:], True)))
        following = following[:count]
        over = following >= until - 1e-9
        if over.any():
            return np.concatenate([*times, following[: int(np.argmax(over))]])
        times.append(following)
        count = min(2 * count, 10_000)


def _tail(time: FloatArray, way: FloatArray, step: float) -> list[float]:
    """Vertices from where time spacing stops being possible to the end, in order of time."""
    times = [float(time[-1])]
    while True:
        target = _way_at(times[-1], time, way) - VERTEX_SPACING
        if target <= VERTEX_SPACING:
            break
        previous = float(np.interp(target, way, time))
        if times[-1] - previous <= step:
            break
        times.append(previous)
    return times[::-1]


def _way_at(moment: float, time: FloatArray, way: FloatArray) -> float:
    return float(np.interp(moment, time, way))
