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

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.world.motion.trajectory import settle, smoother_step
from xosc_lateral.world.motion.way import RoadPlace

SETTLING_LENGTH = 60.0
"""In which a path takes up its lateral speed, and gives it up again where its end is known. [m]"""
APPROACH_TIME = 8.0
"""In which it comes to where it would be from where the entity is: 0.3 m then take 0.03 m/s2. [s]"""
LONGEST_PIECE = 4000.0
"""Longer paths are several, one after the other; each begins without lateral speed. [m]"""
VERTEX_TIME = 0.09995
"""Between vertices, as it is driven nominally: closer ones change nothing. As in a replay, they move slowly against a
player's frames: vertices that always lie on a frame are told from those that do not (AUC 1.00). [s]"""
SHORTEST_GAP, LONGEST_GAP = 1.0, 4.0
"""Between vertices. [m]"""
CHORD_ERROR = 0.002
"""By which straight pieces may cut a bend. [m]"""
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
    """A path over what no other leads over: from where the entity is then, to places in the world, shape (2, n). [m]"""

    nominal: FloatArray
    aside: FloatArray  # from there to where it is driven

    def resized(self, factor: float) -> Bridge:
        """With offsets of another size."""
        return self._replace(aside=factor * self.aside)


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
    # settles: it is led there first, from wherever it is: so far along +t from its lane's centre, within a way [m]
    settles: tuple[float, float] | None = None


def resized(path: OffsetPath, factor: float) -> OffsetPath:
    """With offsets of another size; without any, and nothing to place, with a factor of 0."""
    pieces = (one.resized(factor) for one in path.pieces if factor)
    placed = path.placed_t if path.placed_t is None else path.placed_t - path.side * (1.0 - factor) * path.start
    settles = None if path.settles is None else (factor * path.settles[0], path.settles[1])
    return replace(path, pieces=tuple(pieces), placed_t=placed, start=factor * path.start, settles=settles)


Offset = Callable[[FloatArray], FloatArray]
"""Offset, positive left, at distances along the way. [m]"""


class Spacing(Struct, frozen=True, eq=False):
    """How many vertices there are up to each distance along the way, shape (n,); both increase."""

    distance: FloatArray  # [m]
    count: FloatArray  # [-]

    def between(self, first: float, last: float) -> FloatArray:
        """Distances of vertices from the first to the last, both included. [m]"""
        begin, end = np.interp((first, last), self.distance, self.count)
        inside = np.arange(begin + 1.0, end - 0.5)  # the last gap is a half to one and a half
        return np.concatenate(([first], np.interp(inside, self.count, self.distance), [last]))


def spacing_of(distance: FloatArray, speed: FloatArray, curvature: FloatArray) -> Spacing:
    """Every 0.1 s at these speeds [m/s], closer in bends [1/m], from `SHORTEST_GAP` to `LONGEST_GAP`."""
    chord = np.sqrt(8.0 * CHORD_ERROR / np.maximum(np.abs(curvature), 1e-6))
    gap = np.clip(np.minimum(VERTEX_TIME * np.abs(speed), chord), SHORTEST_GAP, LONGEST_GAP)
    return Spacing(distance, np.concatenate(([0.0], np.cumsum(np.diff(distance) / gap[1:]))))


def approached(offset: Offset, begin: float, start: float, approach: float) -> Offset:
    """Offsets from a distance on, led to from where the entity is then, within a length; below 0: up to one, led from
    to where the entity is to be. [m]
    """
    away = float(offset(np.array([begin]))[0]) - start
    length = np.copysign(max(abs(approach), SETTLING_LENGTH), approach)
    return lambda at: offset(at) - away * (1.0 - smoother_step((at - begin) / length))


def calm(offset: Offset, at: FloatArray, *, end: bool = True) -> FloatArray:
    """Offsets at distances, shape (n,), that begin without lateral speed, and end so. [m]"""
    room = min(SETTLING_LENGTH, 0.5 * float(at[-1] - at[0]))
    values = offset(at) - settle(at - at[0], room, *_derivatives(offset, float(at[0])))
    slope, bend = _derivatives(offset, float(at[-1])) if end else (0.0, 0.0)
    return np.asarray(values - settle(at[-1] - at, room, -slope, bend))


def pieces_along(offset: Offset, spacing: Spacing, cuts: Sequence[float], *, calm_end: bool) -> Iterator[PathPiece]:
    """Pieces from the first of some distances to the last; without lateral speed at each but the last. [m]"""
    for first, last in pairwise(cuts):
        at = spacing.between(first, last)
        yield from _pieces(at, calm(offset, at, end=calm_end or last < cuts[-1]))


def _derivatives(offset: Offset, at: float) -> tuple[float, float]:
    """Slope and second derivative. [-], [1/m]"""
    before, here, behind = offset(np.array([at - 1.0, at, at + 1.0])).tolist()
    return 0.5 * (behind - before), behind - 2.0 * here + before


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
