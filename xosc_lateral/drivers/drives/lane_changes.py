"""When a vehicle changes lanes, by its movement across them: the one answer for drives, recordings and detectors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, pairwise

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray, fitted_rate, rate, true_slices, white_noise
from xosc_lateral.base.track import lane_levels

SETTLED_OFFSET = 0.7  # nobody has settled in a lane who is farther from its centre: 1.8 m touch a marking at 0.95 m [m]
CALM_RATE = 0.1  # a lane change reaches back and forth to where the lateral speed falls below this [m/s]
CROSSING_RATE = 0.3  # a side that crosses a marking faster is in a lane change; which returns, an aborted one [m/s]
MAXIMUM_HALF_DURATION = 8.0  # from the crossing to either end [s]
MINIMUM_MOVEMENT = 0.02  # between two still stretches: what is worth a maneuver [m]
RATE_WINDOW = 0.5  # the lateral speed is a difference over this [s]
NOISE_LAG = 0.2  # noise is told from movement over this: rows may be made, between measured ones half as far apart [s]
ON_ROW = 1e-6  # by which a time may miss a row [s]


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
class Course:
    """How a vehicle moves across its lanes, at the recorded rows; arrays of shape (n,)."""

    time: FloatArray  # [s]
    y: FloatArray  # from the centre of the first row's lane, positive left [m]
    base: FloatArray  # the same of the centre of its lane [m]
    lanes: IntArray  # of its lane, from the first row's
    rate: FloatArray  # lateral speed [m/s]
    side: FloatArray  # offset at which a side comes to a marking; negative of a vehicle that is wider than its lane [m]
    longest: float = MAXIMUM_HALF_DURATION  # from a crossing to either end, at most [s]

    @classmethod
    def of(cls, time: FloatArray, offset: FloatArray, lane_width: FloatArray, width: float | FloatArray) -> Course:
        """Of offsets from the centre of each row's lane; `width`: of the vehicle. [s], [m]"""
        base, lanes = lane_levels(offset, lane_width)
        return cls.across(time, offset + base, base, lanes, np.asarray(0.5 * (lane_width - width)))

    @classmethod
    def across(
        cls, time: FloatArray, y: FloatArray, base: FloatArray, lanes: IntArray, side: FloatArray, **limits: float
    ) -> Course:
        """Of a position across the lanes and the centres of the lanes that it is in."""
        return cls(time, y, base, lanes, _calm_rate(y, time), side, **limits)

    def changing(self, margin: float, *, in_part: bool = True) -> BoolArray:
        """Rows from a margin [s] before a lane change begins to a margin after it is over, shape (n,).

        `in_part`: also of those whose begin or end was not seen.
        """
        rows = np.zeros(len(self.time), dtype=np.bool_)
        for change in self.maneuvers():
            if (change.lanes or change.cut) and (in_part or not change.cut):
                begin, end = self.time[change.first] - margin, self.time[change.last] + margin
                rows[slice(*np.searchsorted(self.time, (begin - ON_ROW, end + ON_ROW)))] = True
        return rows

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
        rough += chain.from_iterable(map(self._given_up, settled))
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
        return _without_overlaps(sorted(rough, key=lambda part: part.first))

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
        low = int(np.searchsorted(self.time, self.time[crossing] - self.longest))
        return self._calm_row(slice(low, before + 1), level, side * self.rate, -1)

    def _end(self, crossing: int, after: int, level: float, side: float) -> int:
        """Row at which movement to a side is over."""
        high = min(int(np.searchsorted(self.time, self.time[crossing] + self.longest)), len(self.time) - 1)
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


def _calm_rate(y: FloatArray, time: FloatArray) -> FloatArray:
    """Lateral speed, over a window in which noise is no movement: else a lane change seems calm before it is over."""
    step = float(np.median(np.diff(time))) if len(time) > 1 else RATE_WINDOW
    noise, most = white_noise(y, max(1, round(NOISE_LAG / step))), CALM_RATE / 3.0
    if np.sqrt(2.0) * noise <= most * RATE_WINDOW:
        return rate(y, time, RATE_WINDOW)
    window = (12.0 * max(step, 0.5 * NOISE_LAG) * (noise / most) ** 2) ** (1.0 / 3.0)
    return fitted_rate(y, time, max(window, RATE_WINDOW))


def _without_overlaps(rough: list[Rough]) -> list[Rough]:
    """Without movement within a lane that is part of a lane change; both halves of an aborted one, or none."""
    changes = [(movement.first, movement.last) for movement in rough if movement.lanes]
    inside = [any(first < movement.last and movement.first < last for first, last in changes) for movement in rough]
    halves = {movement.first: k for k, movement in enumerate(rough) if movement.aborted}
    for k, movement in enumerate(rough):
        if movement.aborted and (half := halves.get(movement.last, k)) != k:
            inside[k] = inside[half] = inside[k] or inside[half]
    return [movement for movement, is_part in zip(rough, inside, strict=True) if movement.lanes or not is_part]
