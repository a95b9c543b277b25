"""Offsets by the distance driven, as paths that begin wherever and whenever a phase without lateral actions does.

A phase lasts from the start, from the end of an action that moves the entity sideways, or from a place behind one that
no path leads over (`way`), to the next such action or place. How long it is under a vehicle under test is not for the
nominal run to say: so a path leads on for as long as any run may last. By the distance driven: whoever is slower, or
stands, moves sideways slowly, or not at all.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray, smoothed
from xosc_lateral.base.segment import within_heading
from xosc_lateral.world.motion.driver_clock import TICK, DriverClock, leading_time
from xosc_lateral.world.motion.trajectory import NaturalSpline, settle, smoother_step
from xosc_lateral.world.motion.way import RoadPlace

LONGEST_PIECE = 4000.0
"""Longer paths are several, one after the other; each begins without lateral speed. [m]"""
VERTEX_TIME = 0.09995
"""Between vertices, as it is driven nominally: closer ones change nothing. As in a replay, they move slowly against a
player's frames: vertices that always lie on a frame are told from those that do not (AUC 1.00). [s]"""
SHORTEST_GAP, LONGEST_GAP = 1.0, 4.0
"""Between vertices where the road is straight. [m]"""
CHORD_ERROR, CORNER, LEAST_GAP = 0.002, 0.008, 0.2
"""By which straight pieces may cut a bend [m], turn from one to the next [rad], and how short they may be. [m]"""
RECORDED_STEP, CORNER_ACCELERATION = 0.05, 1.0
"""Recorded at 20 Hz [s], corners of a path add at most so much to what a bend itself asks. [m/s2]"""
WIDTHS = tuple(0.2 * 1.5 ** np.arange(9))
"""Standard deviations of the kernel by which movement is smoothed, tried in order: up to 5 s of the clock. [s]"""
SPREAD = 2.0
"""Times its width, around what is too hard, a kernel is used. [-]"""
OFFSET_DECIMALS, DISTANCE_DECIMALS = 6, 3
"""With 4 decimals of an offset, a path is told from one that is not rounded (AUC 0.91). [-]"""


class PathPiece(NamedTuple):
    """One path: as many vertices as distances."""

    distance: FloatArray  # from where it begins, increasing, shape (n,) [m]
    offset: FloatArray  # from where the entity is then, positive left, shape (n,) [m]

    def resized(self, factor: float) -> PathPiece:
        """With offsets of another size."""
        return self._replace(offset=np.round(factor * self.offset, OFFSET_DECIMALS))


class Bridge(NamedTuple):
    """A path over what no other leads over: along its road, then from place to place in the world, shape (2, n). [m]"""

    beside: PathPiece
    nominal: FloatArray
    aside: FloatArray  # from there to where it is driven

    def resized(self, factor: float) -> Bridge:
        """With offsets of another size."""
        return self._replace(beside=self.beside.resized(factor), aside=factor * self.aside)


class OffsetPath(Struct, frozen=True, eq=False):
    """What one entity drives in one phase."""

    entity: str
    after: tuple[str, ...] | None  # names from the story down of the action whose end begins it; None: none
    pieces: tuple[PathPiece | Bridge, ...]  # one after the other
    side: float = 1.0  # +1: driven along s, else -1
    time: float = 0.0  # when it begins where no action and no place begins it [s]
    places: tuple[RoadPlace, ...] = ()  # it begins at one of these
    ends: tuple[RoadPlace, ...] = ()  # it ends before each of these
    # span: where both are, what the entity has driven when it begins there or ends; another side is elsewhere [m]
    span: tuple[float, float] = (0.0, np.inf)
    # placed_t: the entity is put down there, along +t from the lane's centre, when the scenario begins [m]
    placed_t: float | None = None
    # start, end: the offset that it is put down with, and that it ends with if all is as in the nominal run [m]
    start: float = 0.0
    end: float = 0.0
    instead: bool = False  # it leads to another lane, in place of the action `after`
    # settles: it is led there first, from wherever it is: so far along +t from its lane's centre, within a way [m];
    # with `instead` the action itself leads there, at a rate [m/s], 0: as it states
    settles: tuple[float, float] | None = None
    # over, unless: an action that it ends, since the entity is where that leads; none of those has begun before
    over: tuple[str, ...] | None = None
    unless: tuple[tuple[str, ...], ...] = ()


def resized(path: OffsetPath, factor: float) -> OffsetPath:
    """With offsets of another size; without any, and nothing to place, with a factor of 0."""
    pieces = (one.resized(factor) for one in path.pieces if factor)
    placed = path.placed_t if path.placed_t is None else path.placed_t - path.side * (1.0 - factor) * path.start
    settles = None if path.settles is None else (factor * path.settles[0], path.settles[1])
    return replace(path, pieces=tuple(pieces), placed_t=placed, start=factor * path.start, settles=settles)


Offset = Callable[[FloatArray], FloatArray]
"""Offset, positive left, at distances along the way. [m]"""


class Spacing(Struct, frozen=True, eq=False):
    """How many vertices there are up to each distance along the way, shape (n,), and how far it is along the roads'
    reference lines; all increase.
    """

    distance: FloatArray  # [m]
    count: FloatArray  # [-]
    along: FloatArray  # [m]

    def between(self, first: float, last: float) -> FloatArray:
        """Distances of vertices from the first to the last, both included. [m]"""
        begin, end = np.interp((first, last), self.distance, self.count)
        inside = np.arange(begin + 1.0, end - 0.5)  # the last gap is a half to one and a half
        return np.concatenate(([first], np.interp(inside, self.count, self.distance), [last]))

    def doubled(self) -> Spacing:
        """Twice as many, where they do not come too close: a lane change bends as much as any road."""
        count = np.diff(self.count)
        more = np.clip(np.diff(self.distance) / np.maximum(count, 1e-9) / LEAST_GAP, 1.0, 2.0)
        return Spacing(self.distance, np.concatenate(([0.0], np.cumsum(count * more))), self.along)


def spacing_of(
    distance: FloatArray, speed: FloatArray, curvature: FloatArray, along: FloatArray, clock: DriverClock
) -> Spacing:
    """Every 0.1 s at these speeds [m/s], closer where it is slow in any run, and in bends [1/m]: by the chord's
    error in place and in direction.
    """
    bend = np.maximum(np.abs(curvature), 1e-6)
    way = np.interp(distance, clock.distance[1:], np.diff(clock.distance) / np.diff(clock.time))
    fastest = np.maximum(np.interp(distance, clock.distance, clock.speed), 1e-3)
    at_speed = RECORDED_STEP * (fastest + CORNER_ACCELERATION / (bend * fastest))
    by_time = np.clip(VERTEX_TIME * np.abs(speed), np.minimum(SHORTEST_GAP, VERTEX_TIME * way), LONGEST_GAP)
    gap = np.maximum(
        np.minimum.reduce([by_time, np.sqrt(8.0 * CHORD_ERROR / bend), CORNER / bend, at_speed]), LEAST_GAP
    )
    return Spacing(distance, np.concatenate(([0.0], np.cumsum(np.diff(distance) / gap[1:]))), along)


def bounded(offset: Offset, clock: DriverClock, *, is_cut: bool = False) -> Offset:
    """Offsets, smoothed where they would turn the entity faster than `DriverClock.limit` in its fastest run; `is_cut`:
    and where it would have more lateral speed than an action that begins anywhere may take away.
    """
    at = clock.ticks()
    values, limit = offset(at), clock.limit(at)
    if is_cut and (np.abs(np.diff(values)) > TICK * clock.limit_where_cut(at[1:])).any():
        values = _slower(values, np.cumsum(TICK * clock.limit_where_cut(at)))
        offset = NaturalSpline.natural(at, values)
    ladder, level = [values], np.zeros(len(at))
    for k, width in enumerate(WIDTHS):
        strained = np.abs(np.diff(ladder[-1], 2, prepend=ladder[-1][:1], append=ladder[-1][-1:])) > limit * TICK**2
        strained[[0, -1]] = False
        if not strained.any():
            break
        reach = int(np.ceil(SPREAD * width / TICK))
        level = np.where(np.convolve(strained, np.ones(2 * reach + 1), "same") > 0.5, k + 1.0, level)
        ladder.append(smoothed(values, width / TICK))
    if len(ladder) == 1:
        return offset
    level = np.clip(smoothed(level, 0.5 * SPREAD * WIDTHS[0] / TICK), 0.0, len(ladder) - 1.0)
    below = np.minimum(level.astype(np.int64), len(ladder) - 2)
    rows, share, stack = np.arange(len(at)), smoother_step(level - below), np.stack(ladder)
    mixed = (1.0 - share) * stack[below, rows] + share * stack[below + 1, rows]
    spline = NaturalSpline.natural(at, within_heading(mixed, at))
    return lambda distance: spline(np.clip(distance, at[0], at[-1]))


def _slower(values: FloatArray, way: FloatArray) -> FloatArray:
    """The nearest movement, in its largest distance from the given one, that is nowhere faster than so; `way`: the
    farthest that it may go since the begin, increasing; shape (n,) each. [m]

    Half way between the least movement above and the greatest below: inf- and sup-convolution with a cone.
    """
    cones = []
    for sign in (1.0, -1.0):
        ahead = np.minimum.accumulate(sign * values - way) + way
        back = np.minimum.accumulate((sign * values + way)[::-1])[::-1] - way
        cones.append(sign * np.minimum(ahead, back))
    return np.asarray(0.5 * (cones[0] + cones[1]))


def approached(offset: Offset, clock: DriverClock, begin: float, start: float, *, back: bool = False) -> Offset:
    """Offsets from a distance on, led to from where the entity is then; `back`: up to one, led from to where it is to
    be then. [m]
    """
    away, sign = float(offset(np.array([begin]))[0]) - start, -1.0 if back else 1.0
    length, there = leading_time(away, 0.0, clock.speed_at(begin)), clock.time_at(begin)
    return lambda at: offset(at) - away * (1.0 - smoother_step(sign * (clock.time_at(at) - there) / length))


def calm(offset: Offset, clock: DriverClock, at: FloatArray, *, end: bool = True) -> FloatArray:
    """Offsets at distances, shape (n,), that begin without lateral speed, and end so. [m]"""
    time, values = clock.time_at(at), offset(at)
    for place, sign in ((at[0], 1.0), (at[-1], -1.0))[: 2 if end else 1]:
        before, here, behind = offset(clock.distance_at(clock.time_at(place) + TICK * np.array([-1.0, 0.0, 1.0])))
        slope, bend = sign * 0.5 * (behind - before) / TICK, (behind - 2.0 * here + before) / TICK**2
        room = min(leading_time(0.0, slope, clock.speed_at(place)), 0.5 * float(time[-1] - time[0]))
        values = values - settle(sign * (time - clock.time_at(place)), room, slope, bend)
    return np.asarray(values)


def pieces_along(
    offset: Offset, clock: DriverClock, spacing: Spacing, cuts: Sequence[float], *, calm_end: bool
) -> Iterator[PathPiece]:
    """Pieces from the first of some distances to the last; without lateral speed at each but the last. [m]"""
    for first, last in pairwise(cuts):
        at = spacing.between(first, last)
        values = calm(offset, clock, at, end=calm_end or last < cuts[-1])
        yield from _pieces(np.interp(at, spacing.distance, spacing.along), values)


def _pieces(at: FloatArray, values: FloatArray) -> Iterator[PathPiece]:
    """Cut where the path turns back, before it is longer than one may be."""
    turns = 1 + np.flatnonzero(np.diff(values[1:]) * np.diff(values[:-1]) <= 0.0)
    cuts = [0]
    while at[-1] - at[cuts[-1]] > LONGEST_PIECE:
        within = turns[(turns > cuts[-1]) & (at[turns] <= at[cuts[-1]] + LONGEST_PIECE)]
        cuts.append(int(within[-1]) if len(within) else int(np.searchsorted(at, at[cuts[-1]] + LONGEST_PIECE)) - 1)
    for first, last in pairwise([*cuts, len(at) - 1]):
        along, aside = at[first : last + 1] - at[first], values[first : last + 1] - values[first]
        yield PathPiece(np.round(along, DISTANCE_DECIMALS), np.round(aside, OFFSET_DECIMALS))
