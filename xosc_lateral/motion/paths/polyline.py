"""Polylines: straight pieces between vertices, perhaps with headings and times.

In `position` mode the speed is constant on each piece and the heading that of the vertex at its start, blended into its
neighbours within 2 m (or half the piece) of the corners. In `follow` mode the heading changes evenly over a piece, and
so does the speed.
"""

from __future__ import annotations

import itertools
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import atan2, hypot, nan

from xosc_lateral.motion.angles import difference, wrap
from xosc_lateral.motion.paths.base import PathPoint
from xosc_lateral.motion.transition import EPSILON

CORNER = 2.0
"""Around a corner, the heading turns over this length before and after it (or half the piece). [m]"""


@dataclass(frozen=True, slots=True)
class Corner:
    """A vertex: [m], [rad], [s]. NaN in `heading`: the pieces'; in z, pitch, roll: the road's; in `time`: none."""

    x: float
    y: float
    z: float = nan
    heading: float = nan
    pitch: float = nan
    roll: float = nan
    time: float = nan


class PolylinePath:
    """A polyline.

    Parameters
    ----------
    corners : sequence of Corner
        At least one.
    follow : bool
        Follow mode, else position mode.
    initial_speed : float
        With which the entity comes (follow mode needs it). [m/s]
    """

    def __init__(self, corners: Sequence[Corner], *, follow: bool = False, initial_speed: float = 0.0) -> None:
        self.corners = tuple(corners)
        self.follow = follow
        self.has_headings = all(c.heading == c.heading for c in self.corners)
        self.lengths = _lengths(self.corners)
        self._times = [corner.time for corner in self.corners]
        self.tangents = _tangents(self.corners)
        self.headings = tuple(
            tangent if c.heading != c.heading else wrap(c.heading)
            for c, tangent in zip(self.corners, self.tangents, strict=True)
        )
        self._speeds, self._accelerations = self._lay_out_speed(initial_speed)

    @property
    def length(self) -> float:
        """[m]"""
        return self.lengths[-1]

    @property
    def start_time(self) -> float:
        """[s]"""
        return self.corners[0].time

    @property
    def end_time(self) -> float:
        """[s]"""
        return self.corners[-1].time

    def at(self, s: float) -> PathPoint:
        """The point at a length; beyond the ends, the ends."""
        i, u = self._piece(s)
        a = self.corners[i]
        if i == len(self.corners) - 1:
            return PathPoint(a.x, a.y, a.z, self.headings[i], a.pitch, a.roll, self.tangents[i])
        b = self.corners[i + 1]
        along = u * (self.lengths[i + 1] - self.lengths[i])
        heading = self._blend(i, u) if self.follow else self._around_corners(self.headings, i, along)
        return PathPoint(
            a.x + u * (b.x - a.x),
            a.y + u * (b.y - a.y),
            a.z + u * (b.z - a.z),
            heading,
            a.pitch + u * difference(b.pitch, a.pitch),
            a.roll + u * difference(b.roll, a.roll),
            self.tangents[i],
        )

    def s_at(self, time: float) -> float:
        """Length at a time: before the first and after the last time stamp, the ends."""
        times = self._times
        if time > times[-1] or len(times) == 1:
            return self.length
        i = max(bisect_left(times, time) - 1, 0)
        elapsed = max(time - times[i], 0.0)
        acceleration = self._accelerations[i]
        if acceleration < 0.0:
            elapsed = min(elapsed, -self._speeds[i] / acceleration)
        return min(self.lengths[i] + elapsed * (self._speeds[i] + 0.5 * acceleration * elapsed), self.lengths[i + 1])

    def time_at(self, s: float) -> float:
        """Time at a length, evenly on each piece. [s]"""
        i, u = self._piece(s)
        following = min(i + 1, len(self.corners) - 1)
        return self.corners[i].time + u * (self.corners[following].time - self.corners[i].time)

    def speed_at(self, s: float) -> float:
        """Speed where a piece begins, or linearly in between (follow mode). [m/s]"""
        i, u = self._piece(s)
        if not self.follow or i == len(self.corners) - 1:
            return self._speeds[i]
        return self._speeds[i] + u * (self._speeds[i + 1] - self._speeds[i])

    # ---- in detail ---------------------------------------------------------------------------------------------------
    def _piece(self, s: float) -> tuple[int, float]:
        """The piece that s lies on (on a corner: the one before it), and how far along it, 0 to 1."""
        if s > self.length or len(self.corners) == 1:
            return len(self.corners) - 1, 0.0
        i = max(bisect_left(self.lengths, s - EPSILON) - 1, 0)
        length = max(self.lengths[i + 1] - self.lengths[i], EPSILON)
        return i, min(max((s - self.lengths[i]) / length, 0.0), 1.0)

    def _blend(self, i: int, u: float) -> float:
        return wrap(self.headings[i] + u * difference(self.headings[i + 1], self.headings[i]))

    def _around_corners(self, headings: tuple[float, ...], i: int, along: float) -> float:
        length = self.lengths[i + 1] - self.lengths[i]
        radius = max(min(CORNER, 0.5 * length), EPSILON)
        here = headings[i]
        if along < radius:
            if i == 0:
                return here
            share = (radius + along) / (2.0 * radius)
            return wrap(headings[i - 1] + share * difference(here, headings[i - 1]))
        if along > length - radius:
            is_last = i == len(headings) - 2
            share = (length - along) / radius if is_last else (radius + length - along) / (2.0 * radius)
            return wrap(here + (1.0 - share) * difference(headings[i + 1], here))
        return here

    def _lay_out_speed(self, initial_speed: float) -> tuple[list[float], list[float]]:
        """Speed at each corner (the start of its piece), and acceleration on the piece."""
        speed = initial_speed
        speeds, accelerations = [speed], [0.0]
        for i in range(1, len(self.corners)):
            ds = self.lengths[i] - self.lengths[i - 1]
            dt = self.corners[i].time - self.corners[i - 1].time
            if not self.follow:
                speed = ds / dt if dt > EPSILON else 0.0
                speeds[i - 1] = speed
            else:
                accelerations[i - 1], speed = _constant_acceleration(speed, ds, dt)
            speeds.append(speed)
            accelerations.append(0.0)
        return speeds, accelerations


def _constant_acceleration(speed: float, ds: float, dt: float) -> tuple[float, float]:
    """Acceleration that covers ds in dt, and the speed then; where that would mean going back, a stop on the way."""
    if abs(ds) <= EPSILON or not dt > EPSILON:
        return 0.0, 0.0
    acceleration = 2.0 * (ds - speed * dt) / (dt * dt)
    if (speed + acceleration * dt) * (speed or 1.0) < 0.0:
        return -speed * speed / (2.0 * ds), 0.0
    return acceleration, speed + acceleration * dt


def _lengths(corners: Sequence[Corner]) -> tuple[float, ...]:
    lengths = [0.0]
    for a, b in itertools.pairwise(corners):
        lengths.append(lengths[-1] + hypot(b.x - a.x, b.y - a.y))
    return tuple(lengths)


def _tangents(corners: Sequence[Corner]) -> tuple[float, ...]:
    """Direction of the piece that begins at each corner, at the last that of the piece before."""
    tangents: list[float] = []
    for a, b in itertools.pairwise(corners):
        if hypot(b.x - a.x, b.y - a.y) >= EPSILON:
            tangents.append(wrap(atan2(b.y - a.y, b.x - a.x)))
        else:
            tangents.append(tangents[-1] if tangents else nan)
    fallback = corners[0].heading if corners[0].heading == corners[0].heading else 0.0
    known = next((tangent for tangent in tangents if tangent == tangent), fallback)
    tangents = [known if tangent != tangent else tangent for tangent in tangents]
    return (*tangents, tangents[-1] if tangents else known)


def merge_close(corners: Sequence[Corner], radius: float, angle: float = 0.1) -> tuple[Corner, ...]:
    """Leave out corners that are nearer to the one before than `radius` [m] and turned by less than `angle` [rad].

    The reference player does so, and its logs can't be met otherwise. The first and the last corner stay.
    """
    if len(corners) <= 2:
        return tuple(corners)
    kept = [corners[0]]
    for corner in corners[1:-1]:
        before = kept[-1]
        near = hypot(corner.x - before.x, corner.y - before.y) < radius
        turned = abs(difference(corner.heading, before.heading)) if corner.heading == corner.heading else 0.0
        if not near or turned > angle:
            kept.append(corner)
    return (*kept, corners[-1])


def has_gaps_in_time(corners: Sequence[Corner]) -> bool:
    """Whether the first and the last corner have a time, but not all between them."""
    first, *_, last = corners if len(corners) > 1 else (corners[0], corners[0])
    return first.time == first.time and last.time == last.time and any(c.time != c.time for c in corners)


def fill_times(corners: Sequence[Corner]) -> list[Corner]:
    """Give corners without a time one, evenly along the way between those that have one."""
    lengths = _lengths(corners)
    known = [i for i, corner in enumerate(corners) if corner.time == corner.time]
    filled = list(corners)
    for a, b in itertools.pairwise(known):
        way = lengths[b] - lengths[a]
        for i in range(a + 1, b):
            share = (lengths[i] - lengths[a]) / way if way > 0.0 else 0.0
            time = corners[a].time + share * (corners[b].time - corners[a].time)
            filled[i] = replace(corners[i], time=time)
    return filled
