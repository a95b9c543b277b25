"""A curve to be followed, by length or by time."""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot
from typing import NamedTuple, Protocol


class PathPoint(NamedTuple):
    """A place on a path: [m], [rad]; NaN: as the road there.

    `tangent` is the direction of the path itself; `is_headed` tells whether the file gives the heading here.
    """

    x: float
    y: float
    z: float
    heading: float
    pitch: float
    roll: float
    tangent: float
    is_headed: bool = False


class Path(Protocol):
    """A shape that was laid out in the world."""

    @property
    def length(self) -> float:
        """[m]"""

    @property
    def start_time(self) -> float:
        """Of the path's own clock; NaN without times. [s]"""

    @property
    def end_time(self) -> float:
        """Of the path's own clock; NaN without times. [s]"""

    def at(self, s: float) -> PathPoint:
        """The point at a length, clamped to the ends. [m]"""

    def s_at(self, time: float) -> float:
        """Length reached at a time of the path's own clock. [m]"""

    def time_at(self, s: float) -> float:
        """Time of the path's own clock at a length. [s]"""

    def speed_at(self, s: float) -> float:
        """Speed that the times of the path ask for. [m/s]"""


def nearest_s(path: Path, x: float, y: float) -> float:
    """Length at which a path comes nearest to a point: sampled each metre, then narrowed down. [m]"""
    count = min(max(int(path.length), 1), _MOST_SAMPLES)
    spacing = path.length / count

    def away(s: float) -> float:
        point = path.at(s)
        return hypot(point.x - x, point.y - y)

    middle = min((i * spacing for i in range(count + 1)), key=away)
    low, high = max(middle - spacing, 0.0), min(middle + spacing, path.length)
    while high - low > _CLOSE:
        third = (high - low) / 3.0
        if away(low + third) < away(high - third):
            high -= third
        else:
            low += third
    return 0.5 * (low + high)


_MOST_SAMPLES = 5000
_CLOSE = 1e-6
"""Where narrowing down ends. [m]"""


@dataclass(slots=True)
class PathProgress:
    """How far an entity has come on its path. [m]"""

    path: Path
    s: float
