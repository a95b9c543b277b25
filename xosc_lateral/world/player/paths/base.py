"""A curve to be followed, by length or by time."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot
from typing import NamedTuple

from xosc_lateral.world.player.transition import EPSILON


class PathPoint(NamedTuple):
    """A place on a path: [m], [rad]; NaN: as the road there."""

    x: float
    y: float
    z: float
    heading: float
    pitch: float
    roll: float
    tangent: float  # direction of the path itself
    is_headed: bool = False  # the file gives the heading here


class Path:
    """A shape laid out in the world: pieces between `lengths` [m], reached at `times` of its own clock, or NaN. [s]"""

    def __init__(self, lengths: Sequence[float], times: Sequence[float]) -> None:
        self.lengths, self.times = tuple(lengths), tuple(times)
        self.spans = tuple(b - a for a, b in pairwise(lengths))
        """Lengths of the pieces. [m]"""
        self.length = lengths[-1]
        self.start_time, self.end_time = times[0], times[-1]

    def at(self, s: float) -> PathPoint:
        """The point at a length; beyond the ends, the ends. [m]"""
        raise NotImplementedError

    def s_at(self, time: float) -> float:
        """Length reached at a time, evenly on each piece; beyond its times, the ends. [m]"""
        if not time > self.start_time:
            return 0.0
        for i, span in enumerate(self.spans):
            begin, end = self.times[i], self.times[i + 1]
            if time < end:
                return self.lengths[i] + (time - begin) / (end - begin) * span
        return self.length

    def time_at(self, s: float) -> float:
        """Time at a length, evenly on each piece. [s]"""
        i, u = self.piece(s)
        following = min(i + 1, len(self.times) - 1)
        return self.times[i] + u * (self.times[following] - self.times[i])

    def speed_at(self, s: float) -> float:
        """Speed that the times ask for. [m/s]"""
        i = min(self.piece(s)[0], len(self.spans) - 1)
        dt = self.times[i + 1] - self.times[i]
        return self.spans[i] / dt if dt > EPSILON else 0.0

    def piece(self, s: float) -> tuple[int, float]:
        """The piece that s lies on (between two: the one before), and how far along it, 0 to 1."""
        if s > self.length or not self.spans:
            return len(self.spans), 0.0
        i = max(bisect_left(self.lengths, s - EPSILON) - 1, 0)
        return i, min(max((s - self.lengths[i]) / max(self.spans[i], EPSILON), 0.0), 1.0)


def nearest_s(path: Path, x: float, y: float) -> float:
    """Length at which a path comes nearest to a point: sampled each metre, then narrowed down. [m]"""
    count = min(max(int(path.length), 1), _MOST_SAMPLES)
    spacing = path.length / count

    def away(s: float) -> float:
        point = path.at(s)
        return hypot(point.x - x, point.y - y)

    middle = min((i * spacing for i in range(count + 1)), key=away)
    low, high = max(middle - spacing, 0.0), min(middle + spacing, path.length)
    while high - low > _BISECTION_WIDTH:
        third = (high - low) / 3.0
        if away(low + third) < away(high - third):
            high -= third
        else:
            low += third
    return 0.5 * (low + high)


_MOST_SAMPLES = 5000
_BISECTION_WIDTH = 1e-6
"""Where narrowing down ends. [m]"""


@dataclass(slots=True)
class PathProgress:
    """How far an entity has come on its path. [m]"""

    path: Path
    s: float
