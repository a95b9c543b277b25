"""Lateral maneuvers of a recorded vehicle: lane changes, aborted ones, lane offsets; when, how long, of what shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.arrays import FloatArray, IntArray
from xosc_lateral.reconstruction.recorded import RecordedVehicle
from xosc_lateral.reconstruction.transitions import SHAPES, Rough, Transition, fit_transition
from xosc_lateral.rows import true_slices

SETTLED = 0.7
"""Nobody has settled in a lane who is farther from its centre, see `formats.importers.cuts`. [m]"""
CALM = 0.1
"""A lane change reaches to where the lateral speed falls below this, see there. [m/s]"""
LEAVING = 0.3
"""Who crosses a marking at this lateral speed means to; slower, he drifts. [m/s]"""
LONGEST = 8.0
"""From the crossing to either end, see there. [s]"""
STILL, STEADY = 1e-3, 0.5
"""Lateral speed below which a vehicle stands still sideways [m/s], for at least so long [s]."""
LEVEL = 0.02
"""Movement between two still stretches that is worth a maneuver. [m]"""
RATE_WINDOW = 0.5
"""The lateral speed is a difference over this. [s]"""


@dataclass(frozen=True, eq=False, slots=True)
class LateralPlan:
    """Lateral maneuvers of a vehicle."""

    start: float  # level at the first row [m]
    transitions: tuple[Transition, ...]  # in order; none begins before the one before it is over
    is_played: bool  # the track stands still sideways for most of the time: no person drove it

    def at(self, time: FloatArray) -> FloatArray:
        """Level at some times, shape as the argument. [m]"""
        value = np.full(len(time), self.start)
        before = self.start
        for one in self.transitions:
            share = SHAPES[one.shape](np.clip((time - one.start) / one.duration, 0.0, 1.0))
            value = np.where(time >= one.start, before + (one.level - before) * share, value)
            before = one.level
        return value


def lateral_plan(vehicle: RecordedVehicle, begin: float) -> LateralPlan:
    """Find and fit all lateral maneuvers; none starts before `begin` [s]."""
    base, lanes = vehicle.levels
    y = vehicle.offset + base
    rate = lateral_speed(vehicle.time, y)
    still = _still(vehicle.time, rate)
    is_played = bool(still.mean() > 0.5)
    if is_played:
        rough = _between_levels(vehicle, y, base, lanes, still)
        start = float(np.median(y[true_slices(still)[0]])) if still[0] else float(y[0])
    else:
        rough = _lane_changes(vehicle, y, base, lanes, rate)
        first = rough[0].first if rough else len(y)
        is_off = abs(y[0]) > SETTLED and first < int(np.argmax(np.append(np.abs(y) < SETTLED, True)))
        start = float(y[0]) if is_off or first == 0 else 0.0
    transitions = list[Transition]()
    free, before = begin, start
    for one in rough:
        found = fit_transition(vehicle.time, y, one, free)
        transitions.append(replace(found, change=found.level - before))
        before = found.level
        free = found.end
    return LateralPlan(start, tuple(transitions), is_played)


def lateral_speed(time: FloatArray, y: FloatArray) -> FloatArray:
    """Difference over `RATE_WINDOW`, one-sided at the ends, shape (n,). [m/s]"""
    half = max(1, round(0.5 * RATE_WINDOW / float(np.median(np.diff(time)))))
    rows = np.arange(len(y))
    low, high = np.maximum(rows - half, 0), np.minimum(rows + half, len(y) - 1)
    return np.asarray((y[high] - y[low]) / (time[high] - time[low]))


def _still(time: FloatArray, rate: FloatArray) -> NDArray[np.bool_]:
    still = np.abs(rate) < STILL
    for part in true_slices(still):
        if time[part.stop - 1] - time[part.start] < STEADY:
            still[part] = False
    return still


# ---- who stands still between maneuvers ------------------------------------------------------------------------------
def _between_levels(
    vehicle: RecordedVehicle, y: FloatArray, base: FloatArray, lanes: IntArray, still: NDArray[np.bool_]
) -> list[Rough]:
    rough = []
    parts = true_slices(still)
    for one, other in pairwise([slice(0, 1), *parts] if not still[0] else parts):
        before, after = float(np.median(y[one])), float(np.median(y[other]))
        there = other.start
        for first, last, low, high in _turned(y, one.stop - 1, there, before, after):
            if abs(high - low) > LEVEL:
                change = int(lanes[last] - lanes[first])
                rows = _reach(y, first, last, low, high)
                rough.append(Rough(*rows, low, high, change, float(high - base[last]), held=True))
    if not still[-1] and parts:
        first, before = parts[-1].stop - 1, float(np.median(y[parts[-1]]))
        if abs(y[-1] - before) > LEVEL:
            change = int(lanes[-1] - lanes[first])
            after = float(y[-1])
            rough.append(Rough(first, len(y) - 1, before, after, change, float(after - base[-1]), held=True, cut=True))
    return rough


def _turned(y: FloatArray, first: int, last: int, before: float, after: float) -> list[tuple[int, int, float, float]]:
    """Movements to one side between two rows: where it turns back beyond both levels, there are two of them."""
    part = y[first : last + 1]
    beyond = np.maximum(part - max(before, after), min(before, after) - part)
    if beyond.max() <= LEVEL:
        return [(first, last, before, after)]
    top = float(part[int(beyond.argmax())])
    rest = first + np.flatnonzero(np.abs(part - top) < LEVEL)
    return [(first, int(rest[0]), before, top), (int(rest[-1]), last, top, after)]


def _reach(y: FloatArray, first: int, last: int, before: float, after: float) -> tuple[int, int]:
    """Rows between which it is at neither level, to a thousandth of the way; one row of each level along."""
    near = 1e-3 * abs(after - before)
    away = np.flatnonzero((np.abs(y[first : last + 1] - before) > near) & (np.abs(y[first : last + 1] - after) > near))
    return (first, last) if not len(away) else (first + max(int(away[0]) - 1, 0), first + int(away[-1]) + 1)


# ---- drivers ---------------------------------------------------------------------------------------------------------
def _lane_changes(
    vehicle: RecordedVehicle, y: FloatArray, base: FloatArray, lanes: IntArray, rate: FloatArray
) -> list[Rough]:
    """Changes between lanes that the vehicle settled in, and excursions from one of them."""
    edges = np.r_[0, np.flatnonzero(np.diff(lanes)) + 1, len(lanes)]
    episodes = [slice(int(a), int(b)) for a, b in pairwise(edges)]
    settled = [part for k, part in enumerate(episodes) if _is_settled(vehicle, y, base, rate, episodes, k)]
    if not settled:
        settled = [max(episodes, key=lambda part: part.stop - part.start)]
    rough = list[Rough]()
    if settled[0].start > 0:  # it comes from a lane that was not seen
        rough.append(_rough(vehicle, y, base, lanes, rate, 0, settled[0].start, settled[0].start, cut=True))
    else:
        rough += _open_start(vehicle, y, base, rate, settled[0])
    for one, other in pairwise(settled):
        crossing = (one.stop + other.start) // 2
        if lanes[one.start] == lanes[other.start]:
            rough += _excursion(vehicle, y, rate, float(base[one.start]), one.stop, other.start)
        else:
            rough.append(_rough(vehicle, y, base, lanes, rate, one.stop - 1, crossing, other.start))
    if settled[-1].stop < len(lanes):
        last = settled[-1].stop
        if lanes[-1] == lanes[last - 1]:
            rough += _open_end(vehicle, y, base, rate, slice(settled[-1].start, len(lanes)))
        else:
            rough.append(_rough(vehicle, y, base, lanes, rate, last - 1, last, len(lanes) - 1, cut=True))
    else:
        rough += _open_end(vehicle, y, base, rate, settled[-1])
    return _apart(sorted(rough, key=lambda one: one.first))


def _is_settled(
    vehicle: RecordedVehicle, y: FloatArray, base: FloatArray, rate: FloatArray, episodes: Sequence[slice], k: int
) -> bool:
    """Near the lane's centre, and not just crossing it: between two crossings to one side, speed falls by half."""
    part = episodes[k]
    near = np.abs(y[part] - base[part]) < _room(vehicle, part)
    if not near.any():
        return False
    if k in (0, len(episodes) - 1):
        return True
    into, out = rate[part.start], rate[part.stop - 1]
    if into * out <= 0.0:
        return True
    return bool((np.abs(rate[part])[near] < 0.5 * min(abs(into), abs(out))).any())


def _room(vehicle: RecordedVehicle, part: slice) -> FloatArray:
    """Offset at which a side comes to a marking; at least `SETTLED`, for who is as wide as the lane. [m]"""
    return np.asarray(np.maximum(0.5 * (vehicle.lane_width[part] - vehicle.width), SETTLED))


def _rough(
    vehicle: RecordedVehicle,
    y: FloatArray,
    base: FloatArray,
    lanes: IntArray,
    rate: FloatArray,
    before: int,
    crossing: int,
    after: int,
    *,
    cut: bool = False,
) -> Rough:
    """A change from the lane of row `before` to that of row `after`, as far as it moves towards it."""
    towards = np.sign(base[after] - base[before]) or 1.0
    first, last = _ends(vehicle, y, rate * towards, before, crossing, after, base)
    change = int(lanes[after] - lanes[before])
    begin = float(y[0]) if cut and first == 0 else float(base[before])
    return Rough(first, last, begin, float(base[after]), change, cut=cut)


def _ends(
    vehicle: RecordedVehicle,
    y: FloatArray,
    towards: FloatArray,
    before: int,
    crossing: int,
    after: int,
    base: FloatArray,
) -> tuple[int, int]:
    """Rows at which the movement begins and is over."""
    time = vehicle.time
    low = int(np.searchsorted(time, time[crossing] - LONGEST))
    high = min(int(np.searchsorted(time, time[crossing] + LONGEST)), len(time) - 1)
    calm = towards < CALM
    left = np.flatnonzero(calm[low : before + 1] & (np.abs(y - base[before]) < SETTLED)[low : before + 1])
    right = np.flatnonzero(calm[after : high + 1] & (np.abs(y - base[after]) < SETTLED)[after : high + 1])
    # who never comes to rest there has begun, or is over, where he is nearest to the centre
    first = low + int(left[-1]) if len(left) else low + _nearest(y[low : before + 1] - base[before])
    last = after + int(right[0]) if len(right) else after + _nearest(y[after : high + 1] - base[after])
    return first, last


def _nearest(away: FloatArray) -> int:
    return int(np.abs(away).argmin()) if len(away) else 0


def _open_start(
    vehicle: RecordedVehicle, y: FloatArray, base: FloatArray, rate: FloatArray, part: slice
) -> list[Rough]:
    """A track that begins far from its lane's centre, moving towards it: within a lane change."""
    begin, level = float(y[0]), float(base[0])
    towards = -np.sign(begin - level)
    if abs(begin - level) <= SETTLED or towards * rate[0] < CALM:
        return []
    near = np.abs(y[part] - level) < SETTLED
    if not near.any():
        return []
    done = np.flatnonzero(near & (towards * rate[part] < CALM))
    return [Rough(0, int(done[0]) if len(done) else _nearest(y[part] - level), begin, level, 0, cut=True)]


def _open_end(vehicle: RecordedVehicle, y: FloatArray, base: FloatArray, rate: FloatArray, part: slice) -> list[Rough]:
    """A track that ends far from its lane's centre, moving away: within a lane change, or on its way to a ramp."""
    level, end = float(base[-1]), float(y[-1])
    away = np.sign(end - level)
    if abs(end - level) <= SETTLED or away * rate[-1] < CALM:
        return []
    near = np.abs(y[part] - level) < SETTLED
    if not near.any():
        return []
    calm = np.flatnonzero(near & (away * rate[part] < CALM))
    first = part.start + (int(calm[-1]) if len(calm) else _nearest(y[part] - level))
    return [Rough(first, len(y) - 1, level, end, 0, end - level, cut=True)]


def _drifts(vehicle: RecordedVehicle, y: FloatArray, rate: FloatArray, level: float, part: slice) -> list[Rough]:
    """Excursions within a lane: a side beyond the marking, left for quickly, and back."""
    found = []
    for out in true_slices(np.abs(y[part] - level) > _room(vehicle, part)):
        first, last = part.start + out.start, part.start + out.stop - 1
        side = np.sign(y[first] - level)
        back = np.flatnonzero(np.abs(y[last : part.stop] - level) < SETTLED)
        if first == part.start or not len(back) or side * rate[first] < LEAVING:
            continue
        found += _excursion(vehicle, y, rate, level, first, last + int(back[0]))
    return found


def _excursion(
    vehicle: RecordedVehicle, y: FloatArray, rate: FloatArray, level: float, first: int, last: int
) -> list[Rough]:
    """Out of a lane and back into it: two lane offsets."""
    peak = first + int(np.abs(y[first : last + 1] - level).argmax())
    side, height = np.sign(y[peak] - level), float(y[peak])
    base = np.full(len(y), level)
    begin, _ = _ends(vehicle, y, side * rate, first, peak, peak, base)
    _, end = _ends(vehicle, y, -side * rate, peak, peak, last, base)
    offset = height - level
    return [
        Rough(begin, peak, level, height, 0, offset, aborted=True),
        Rough(peak, end, height, level, 0, aborted=True),
    ]


def _apart(rough: list[Rough]) -> list[Rough]:
    """Without movement within a lane that is part of a lane change."""
    changes = [(one.first, one.last) for one in rough if one.lanes]
    return [
        one for one in rough if one.lanes or not any(first < one.last and one.first < last for first, last in changes)
    ]
