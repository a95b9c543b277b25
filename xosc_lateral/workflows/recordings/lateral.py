"""Lateral maneuvers of a recorded vehicle: lane changes, aborted ones, lane offsets; when, how long, of what shape.

A transition goes from one lateral level to another; its start, duration and shape are those of the least squares.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.rows import true_slices
from xosc_lateral.workflows.recordings.recorded import MOVING_SPEED, RecordedVehicle
from xosc_lateral.world.motion.segments import bell_share
from xosc_lateral.world.scenario.enums import DynamicsShape

SETTLED_OFFSET = 0.7  # nobody has settled in a lane who is farther from its centre, see `recordings.cuts` [m]
CALM_RATE = 0.1  # a lane change reaches to where the lateral speed falls below this, see there [m/s]
CROSSING_RATE = 0.3  # a side that crosses a marking faster is in a lane change; which returns, an aborted one [m/s]
MAXIMUM_HALF_DURATION = 8.0  # from the crossing to either end, see there [s]
STILL_RATE = 1e-3  # lateral speed below which a vehicle stands still sideways [m/s] ...
STILL_DURATION = 0.5  # ... for at least so long [s]
MINIMUM_MOVEMENT = 0.02  # between two still stretches: what is worth a maneuver [m]
RATE_WINDOW = 0.5  # the lateral speed is a difference over this [s]
FIT_MARGIN = 1.0  # rows of road-following that are fitted along, at both ends [s]
DURATIONS = (1.0, 16.0)
"""Of lane changes; naturalistic ones last 1 to 16.5 s (T. Toledo, D. Zohar, Transportation Research Record 1999, 2007:
mean 4.6 s). [s]"""
Share: TypeAlias = Callable[[FloatArray], FloatArray]
SHAPES: Mapping[DynamicsShape, Share] = {
    DynamicsShape.SINUSOIDAL: lambda u: 0.5 - 0.5 * np.cos(np.pi * u),
    DynamicsShape.CUBIC: lambda u: u * u * (3.0 - 2.0 * u),
    DynamicsShape.LINEAR: lambda u: u,
}
"""Share of the way over share of the duration, as in `player.transition`."""


@dataclass(frozen=True, slots=True)
class Transition:
    """From one lateral level to another."""

    start: float  # start, duration: [s]
    duration: float
    shape: DynamicsShape
    lanes: int  # lanes to the left (negative: to the right); 0: within the lane
    offset: float  # where it ends, from the centre of the lane that it leads to, positive left [m]
    level: float  # the same from the centre of the first row's lane [m]
    aborted: bool = False  # one half of a lane change that was not carried through
    cut: bool = False  # the recording begins or ends within it
    change: float = 0.0  # of the level, positive left [m]
    residual: float = 0.0  # root mean square of the recorded path from the fitted one [m]
    bell_residual: float = np.inf  # the same from the bell that drivers take, where one was fitted [m]

    @property
    def end(self) -> float:
        """[s]"""
        return self.start + self.duration

    @property
    def is_bell(self) -> bool:
        """Whether the bell fits better than what a maneuver can say."""
        return self.bell_residual < self.residual


@dataclass(frozen=True, slots=True)
class Rough:
    """Rows of a transition as found, and between which levels; `held`: no person drove it, it begins and ends there."""

    first: int
    last: int
    before: float
    after: float
    lanes: int
    offset: float = 0.0
    held: bool = False
    aborted: bool = False
    cut: bool = False


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
    time, y = course.time, course.y
    still_parts = [
        part
        for part in true_slices(np.abs(course.rate) < STILL_RATE)
        if time[part.stop - 1] - time[part.start] >= STILL_DURATION
    ]
    still = np.zeros(len(y), dtype=np.bool_)
    for part in still_parts:
        still[part] = True
    driven = np.hypot(lateral_speed(vehicle.time, vehicle.x), lateral_speed(vehicle.time, vehicle.y))
    moving = driven >= MOVING_SPEED  # in a jam, people stand still sideways too
    is_played = bool((still[moving] if moving.any() else still).mean() > 0.5)
    if is_played:
        rough = course.between_levels(still_parts)
        start = float(np.median(y[still_parts[0]])) if still[0] else float(y[0])
    else:
        rough = course.maneuvers()
        first = rough[0].first if rough else len(y)
        near = np.append(np.abs(y) < SETTLED_OFFSET, True)
        is_off = abs(y[0]) > SETTLED_OFFSET and first < int(np.argmax(near))
        start = float(y[0]) if is_off or first == 0 else 0.0
    transitions = list[Transition]()
    free, before = begin, start
    for movement in rough:
        transition = fit_transition(time, y, movement, free)
        transitions.append(replace(transition, change=transition.level - before))
        free, before = transition.end, transition.level
    return LateralPlan(start, tuple(transitions), is_played)


def lateral_speed(time: FloatArray, y: FloatArray) -> FloatArray:
    """Difference over `RATE_WINDOW`, one-sided at the ends, shape (n,). [m/s]"""
    half = max(1, round(0.5 * RATE_WINDOW / float(np.median(np.diff(time)))))
    rows = np.arange(len(y))
    low, high = np.maximum(rows - half, 0), np.minimum(rows + half, len(y) - 1)
    return np.asarray((y[high] - y[low]) / (time[high] - time[low]))


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

    def between_levels(self, still_parts: Sequence[slice]) -> list[Rough]:
        """Movements between the levels that a vehicle which nobody drives stands still at."""
        y, levels = self.y, [float(np.median(self.y[part])) for part in still_parts]
        rough = list[Rough]()
        if still_parts and still_parts[0].start > 0:
            still_parts, levels = [slice(0, 1), *still_parts], [float(y[0]), *levels]
        for (part, before), (next_part, after) in pairwise(zip(still_parts, levels, strict=True)):
            for first, last, low, high in self._turned(part.stop - 1, next_part.start, before, after):
                if abs(high - low) > MINIMUM_MOVEMENT:
                    # rows between which it is at neither level, to a thousandth of the way, and one row of each
                    inner, near = y[first : last + 1], 1e-3 * abs(high - low)
                    away = np.flatnonzero((np.abs(inner - low) > near) & (np.abs(inner - high) > near))
                    rows = (first + max(int(away[0]) - 1, 0), first + int(away[-1]) + 1) if len(away) else (first, last)
                    change = int(self.lanes[last] - self.lanes[first])
                    rough.append(Rough(*rows, low, high, change, float(high - self.base[last]), held=True))
        if still_parts and still_parts[-1].stop < len(y):
            first, after = still_parts[-1].stop - 1, float(y[-1])
            if abs(after - levels[-1]) > MINIMUM_MOVEMENT:
                change, offset = int(self.lanes[-1] - self.lanes[first]), float(after - self.base[-1])
                rough.append(Rough(first, len(y) - 1, levels[-1], after, change, offset, held=True, cut=True))
        return rough

    def _turned(self, first: int, last: int, before: float, after: float) -> list[tuple[int, int, float, float]]:
        """Movements to one side between two rows: where it turns back beyond both levels, there are two of them."""
        part = self.y[first : last + 1]
        beyond = np.maximum(part - max(before, after), min(before, after) - part)
        if beyond.max() <= MINIMUM_MOVEMENT:
            return [(first, last, before, after)]
        top = float(part[int(beyond.argmax())])
        rest = first + np.flatnonzero(np.abs(part - top) < MINIMUM_MOVEMENT)
        return [(first, int(rest[0]), before, top), (int(rest[-1]), last, top, after)]

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
            rough += self._open(settled[0], 0)
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
            rough += self._open(slice(settled[-1].start, len(lanes)), -1)
        return _apart(sorted(rough, key=lambda part: part.first))

    def _is_settled(self, part: slice, *, is_passing: bool) -> bool:
        """Near the lane's centre, and not just crossing it: between two crossings to one side, speed falls by half."""
        near = np.abs(self.y[part] - self.base[part]) < np.maximum(self.side[part], SETTLED_OFFSET)
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
        calm = np.flatnonzero((rate[rows] < CALM_RATE) & (away < SETTLED_OFFSET))
        return int(rows.start) + int(calm[pick] if len(calm) else away.argmin() if len(away) else 0)

    def _open(self, part: slice, edge: int) -> list[Rough]:
        """A track that begins (`edge` 0) or ends (-1) far from its lane's centre, moving: within a lane change."""
        level, place = float(self.base[edge]), float(self.y[edge])
        away = (1.0 if edge else -1.0) * np.sign(place - level) * self.rate
        is_near = (np.abs(self.y[part] - level) < SETTLED_OFFSET).any()
        if abs(place - level) <= SETTLED_OFFSET or away[edge] < CALM_RATE or not is_near:
            return []
        row = self._calm_row(part, level, away, edge)
        if edge == 0:
            return [Rough(0, row, place, level, 0, cut=True)]
        return [Rough(row, len(self.y) - 1, level, place, 0, place - level, cut=True)]

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


# ---- transitions by least squares -----------------------------------------------------------------------------------
def peak_acceleration(shape: DynamicsShape, change: float, duration: float) -> float:
    """Largest lateral acceleration [m/s2], by which a lane offset states its duration; of a linear one the cubic's."""
    factor = 0.5 * np.pi**2 if shape is DynamicsShape.SINUSOIDAL else 6.0
    return float(factor * abs(change) / duration**2)


def fit_transition(time: FloatArray, y: FloatArray, rough: Rough, free: float) -> Transition:
    """Start, duration and shape, not before `free` [s]; of a person, from where he sets off to where he settles."""
    level = rough.after
    if not rough.held and not rough.aborted:
        rough = replace(rough, before=float(y[rough.first]), after=float(y[rough.last]))
    margin = 0.0 if rough.aborted else FIT_MARGIN
    first = int(np.searchsorted(time, max(time[rough.first] - margin, free)))
    last = int(np.searchsorted(time, time[rough.last] + margin, side="right"))
    t, rows = time[first:last], y[first:last]
    if len(t) < 4:
        t, rows = time[rough.first : rough.last + 1], y[rough.first : rough.last + 1]
    begin, end = max(time[rough.first], free), max(time[rough.last], free + 0.1)
    shortest = 0.1 if rough.held else DURATIONS[0]
    middle, duration = 0.5 * (begin + end), float(np.clip(end - begin, shortest, DURATIONS[1]))
    best: tuple[float, float, float, DynamicsShape] = (np.inf, begin, duration, DynamicsShape.SINUSOIDAL)
    for shape in SHAPES if rough.held else (DynamicsShape.SINUSOIDAL, DynamicsShape.CUBIC):
        candidate = _search(t, rows, rough, SHAPES[shape], middle, duration, free)
        if candidate[0] < best[0] * (1.0 - 1e-9):
            best = (*candidate, shape)
    _, start, duration, shape = best
    residual, bell_residual = float(np.sqrt(best[0] / len(t))) if np.isfinite(best[0]) else 0.0, np.inf
    if rough.lanes and not rough.held and not rough.cut and len(t):
        cost = _search(t, rows, rough, bell_share, middle, duration, free)[0]
        bell_residual = float(np.sqrt(cost / len(t)))
    kind = rough.lanes, rough.offset, level, rough.aborted, rough.cut
    return Transition(start, duration, shape, *kind, residual=residual, bell_residual=bell_residual)


def _search(
    t: FloatArray, y: FloatArray, rough: Rough, share_of: Share, middle: float, duration: float, free: float
) -> tuple[float, float, float]:
    """Least cost [m2], start and duration [s]."""
    shortest = 0.1 if rough.held else DURATIONS[0]
    half, factor = 0.5 * duration + 0.5, 2.0
    best = (np.inf, middle - 0.5 * duration, duration)
    for _ in range(7 if rough.held else 5):
        middles = middle + half * np.linspace(-1.0, 1.0, 13)
        durations = np.clip(duration * factor ** np.linspace(-1.0, 1.0, 13), shortest, DURATIONS[1])
        m, d = (each.ravel() for each in np.meshgrid(middles, durations))
        possible = m - 0.5 * d >= free - 1e-9
        if not possible.any():
            m, d = np.array([free + 0.5 * duration]), np.array([duration])
            possible = np.ones(1, dtype=bool)
        m, d = m[possible], d[possible]
        share = share_of(np.clip((t - (m - 0.5 * d)[:, None]) / d[:, None], 0.0, 1.0))
        cost = ((y - rough.before - (rough.after - rough.before) * share) ** 2).sum(axis=1)
        k = int(cost.argmin())
        if cost[k] < best[0]:
            best = (float(cost[k]), float(m[k] - 0.5 * d[k]), float(d[k]))
        middle, duration = best[1] + 0.5 * best[2], best[2]
        half, factor = half / 4.0, factor**0.25
    return best
