"""Lateral maneuvers of a recorded vehicle: lane changes, aborted ones, lane offsets; when, how long, of what shape."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.rows import true_slices
from xosc_lateral.workflows.recordings.motion_fits import SHAPES, Rough, Transition, fit_transition
from xosc_lateral.workflows.recordings.recorded import MOVING_SPEED, RecordedVehicle

SETTLED = 0.7  # nobody has settled in a lane who is farther from its centre, see `recordings.cuts` [m]
CALM = 0.1  # a lane change reaches to where the lateral speed falls below this, see there [m/s]
CROSSING_RATE = 0.3  # a side that crosses a marking faster is in a lane change; which returns, an aborted one [m/s]
MAXIMUM_HALF_DURATION = 8.0  # from the crossing to either end, see there [s]
STILL, STEADY = 1e-3, 0.5  # lateral speed below which a vehicle stands still sideways [m/s], for at least so long [s]
LEVEL = 0.02  # movement between two still stretches that is worth a maneuver [m]
RATE_WINDOW = 0.5  # the lateral speed is a difference over this [s]


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
        for transition in self.transitions:
            share = SHAPES[transition.shape](np.clip((time - transition.start) / transition.duration, 0.0, 1.0))
            value = np.where(time >= transition.start, before + (transition.level - before) * share, value)
            before = transition.level
        return value


def lateral_plan(vehicle: RecordedVehicle, begin: float) -> LateralPlan:
    """Find and fit all lateral maneuvers; none starts before `begin` [s]."""
    course = Course.of(vehicle)
    y = course.y
    still = _still(course.time, course.rate)
    driven = np.hypot(lateral_speed(vehicle.time, vehicle.x), lateral_speed(vehicle.time, vehicle.y))
    moving = driven >= MOVING_SPEED  # in a jam, people stand still sideways too
    is_played = bool((still[moving] if moving.any() else still).mean() > 0.5)
    if is_played:
        rough = _between_levels(course, still)
        start = float(np.median(y[true_slices(still)[0]])) if still[0] else float(y[0])
    else:
        rough = course.maneuvers()
        first = rough[0].first if rough else len(y)
        is_off = abs(y[0]) > SETTLED and first < int(np.argmax(np.append(np.abs(y) < SETTLED, True)))
        start = float(y[0]) if is_off or first == 0 else 0.0
    transitions = list[Transition]()
    free, before = begin, start
    for movement in rough:
        transition = fit_transition(course.time, y, movement, free)
        transitions.append(replace(transition, change=transition.level - before))
        before = transition.level
        free = transition.end
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
def _between_levels(course: Course, still: NDArray[np.bool_]) -> list[Rough]:
    y, base, lanes = course.y, course.base, course.lanes
    rough = []
    parts = true_slices(still)
    for part, next_part in pairwise([slice(0, 1), *parts] if not still[0] else parts):
        before, after = float(np.median(y[part])), float(np.median(y[next_part]))
        for first, last, low, high in _turned(y, part.stop - 1, next_part.start, before, after):
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
@dataclass(frozen=True, eq=False, slots=True)
class Course:
    """How a vehicle moves across its lanes, at the recorded rows; arrays of shape (n,)."""

    time: FloatArray  # [s]
    y: FloatArray  # from the centre of the first row's lane, positive left [m]
    base: FloatArray  # the same of the centre of its lane [m]
    lanes: IntArray  # of its lane, from the first row's
    rate: FloatArray  # lateral speed [m/s]
    side: FloatArray  # offset at which a side comes to a marking; negative of a vehicle that is wider than its lane [m]

    @classmethod
    def of(cls, vehicle: RecordedVehicle) -> Course:
        """Of a recorded vehicle."""
        base, lanes = vehicle.levels
        y = vehicle.offset + base
        side = 0.5 * (vehicle.lane_width - vehicle.width)
        return cls(vehicle.time, y, base, lanes, lateral_speed(vehicle.time, y), np.asarray(side))

    def maneuvers(self) -> list[Rough]:
        """Changes between lanes that the vehicle settled in, and excursions from one of them."""
        lanes = self.lanes
        edges = np.r_[0, np.flatnonzero(np.diff(lanes)) + 1, len(lanes)]
        episodes = [slice(int(a), int(b)) for a, b in pairwise(edges)]
        inner = episodes[1:-1]
        settled = [part for part in episodes if self._is_settled(part, is_passing=part in inner)]
        settled = settled or [max(episodes, key=lambda part: part.stop - part.start)]
        rough = list[Rough]()
        if settled[0].start > 0:  # it comes from a lane that was not seen
            rough.append(self._change(0, settled[0].start, settled[0].start, cut=True))
        else:
            rough += self._open_start(settled[0])
        for part in settled:
            rough += self._given_up(part)
        for part, next_part in pairwise(settled):
            if lanes[part.start] == lanes[next_part.start]:
                rough += self._excursion(float(self.base[part.start]), part.stop, next_part.start)
            else:
                rough.append(self._change(part.stop - 1, (part.stop + next_part.start) // 2, next_part.start))
        last = settled[-1].stop
        if last < len(lanes) and lanes[-1] != lanes[last - 1]:
            rough.append(self._change(last - 1, last, len(lanes) - 1, cut=True))
        else:
            rough += self._open_end(slice(settled[-1].start, len(lanes)))
        return _apart(sorted(rough, key=lambda part: part.first))

    def _is_settled(self, part: slice, *, is_passing: bool) -> bool:
        """Near the lane's centre, and not just crossing it: between two crossings to one side, speed falls by half."""
        near = np.abs(self.y[part] - self.base[part]) < np.maximum(self.side[part], SETTLED)
        into, out = self.rate[part.start], self.rate[part.stop - 1]
        if not near.any() or not is_passing or into * out <= 0.0:
            return bool(near.any())
        return bool((np.abs(self.rate[part])[near] < 0.5 * min(abs(into), abs(out))).any())

    def _change(self, before: int, crossing: int, after: int, *, cut: bool = False) -> Rough:
        """A change from the lane of row `before` to that of row `after`, as far as it moves towards it."""
        low, high = float(self.base[before]), float(self.base[after])
        first = self._begin(before, crossing, low, np.sign(high - low) or 1.0)
        last = self._end(crossing, after, high, np.sign(high - low) or 1.0)
        begin = float(self.y[0]) if cut and first == 0 else low
        return Rough(first, last, begin, high, int(self.lanes[after] - self.lanes[before]), cut=cut)

    def _begin(self, before: int, crossing: int, level: float, side: float) -> int:
        """Row at which movement to a side begins."""
        low = int(np.searchsorted(self.time, self.time[crossing] - MAXIMUM_HALF_DURATION))
        return self._calm_row(slice(low, before + 1), level, side * self.rate, -1)

    def _end(self, crossing: int, after: int, level: float, side: float) -> int:
        """Row at which movement to a side is over."""
        high = min(int(np.searchsorted(self.time, self.time[crossing] + MAXIMUM_HALF_DURATION)), len(self.time) - 1)
        return self._calm_row(slice(after, high + 1), level, side * self.rate, 0)

    def _calm_row(self, rows: slice, level: float, rate: FloatArray, pick: int) -> int:
        """The first (0) or last (-1) row near a level at which it hardly moves, else the nearest to it."""
        away = np.abs(self.y[rows] - level)
        calm = np.flatnonzero((rate[rows] < CALM) & (away < SETTLED))
        return int(rows.start) + int(calm[pick] if len(calm) else away.argmin() if len(away) else 0)

    def _open_start(self, part: slice) -> list[Rough]:
        """A track that begins far from its lane's centre, moving towards it: within a lane change."""
        begin, level = float(self.y[0]), float(self.base[0])
        towards = -np.sign(begin - level) * self.rate
        is_near = (np.abs(self.y[part] - level) < SETTLED).any()
        if abs(begin - level) <= SETTLED or towards[0] < CALM or not is_near:
            return []
        return [Rough(0, self._calm_row(part, level, towards, 0), begin, level, 0, cut=True)]

    def _open_end(self, part: slice) -> list[Rough]:
        """A track that ends far from its lane's centre, moving away: within a lane change, or towards a ramp."""
        level, end = float(self.base[-1]), float(self.y[-1])
        away = np.sign(end - level) * self.rate
        is_near = (np.abs(self.y[part] - level) < SETTLED).any()
        if abs(end - level) <= SETTLED or away[-1] < CALM or not is_near:
            return []
        first = self._calm_row(part, level, away, -1)
        return [Rough(first, len(self.y) - 1, level, end, 0, end - level, cut=True)]

    def _given_up(self, part: slice) -> list[Rough]:
        """Excursions within a lane in which a side crosses a marking as in a lane change, and comes back."""
        away, side = self.y[part] - self.base[part], self.side[part]
        rough = list[Rough]()
        for over in true_slices((np.abs(away) > side) & (side > 0.0)):
            first, last = part.start + over.start, part.start + over.stop
            is_within = over.start > 0 and over.stop < len(away)  # else it comes from another lane, or changes to it
            if is_within and np.sign(away[over.start]) * self.rate[first] > CROSSING_RATE:
                rough += self._excursion(float(self.base[first]), first, last)
        return rough

    def _excursion(self, level: float, first: int, last: int) -> list[Rough]:
        peak = first + int(np.abs(self.y[first : last + 1] - level).argmax())
        side, height = np.sign(self.y[peak] - level), float(self.y[peak])
        begin, end = self._begin(first, peak, level, side), self._end(peak, last, level, -side)
        return [
            Rough(begin, peak, level, height, 0, height - level, aborted=True),
            Rough(peak, end, height, level, 0, aborted=True),
        ]


def _apart(rough: list[Rough]) -> list[Rough]:
    """Without movement within a lane that is part of a lane change; both halves of an aborted one, or none."""
    changes = [(movement.first, movement.last) for movement in rough if movement.lanes]
    inside = [any(first < movement.last and movement.first < last for first, last in changes) for movement in rough]
    halves = {movement.first: k for k, movement in enumerate(rough) if movement.aborted}
    for k, movement in enumerate(rough):
        if movement.aborted and (half := halves.get(movement.last, k)) != k:
            inside[k] = inside[half] = inside[k] or inside[half]
    return [movement for movement, is_part in zip(rough, inside, strict=True) if movement.lanes or not is_part]
