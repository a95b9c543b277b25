"""Polylines: straight pieces between vertices, perhaps with headings and times.

In `position` mode the speed is constant on each piece and the heading that of the vertex at its start, blended into
its neighbours within 2 m (or half the piece) of the corners. In `follow` mode the heading changes evenly over a piece,
and so does the speed.

Derived here: a piece of length ds that takes dt, begun at the speed v, has the constant acceleration 2 (ds - v dt) /
dt^2.
"""

from __future__ import annotations

import itertools
from bisect import bisect_left
from collections.abc import Sequence
from math import atan2, hypot, nan

from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.world.player.paths.base import Path, PathPoint
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.positions import difference, wrap

CORNER_LENGTH = 2.0
"""Around a corner, the heading turns over this length before and after it (or half the piece). [m]"""

SAME_HEADING = 0.1
"""Headings that differ by less count as one. [rad]"""

STOP_DURATION = 1.0
"""A stop that is shorter is driven through where its vertices are merged. [s]"""


class Corner(Struct, frozen=True):
    """A vertex [m], [rad], [s]; NaN: heading and pitch of the pieces, z and roll of the road, no time."""

    x: float
    y: float
    z: float = nan
    heading: float = nan
    pitch: float = nan
    roll: float = nan
    time: float = nan
    road_z: float = nan  # height of the road here, for a piece that begins on it and ends above
    is_fixed: bool = True  # it has a place of its own, not one relative to an entity


class PolylinePath(Path):
    """A polyline in follow mode (the entity comes with `initial_speed` [m/s]) or in position mode."""

    def __init__(self, corners: Sequence[Corner], *, follow: bool = False, initial_speed: float = 0.0) -> None:
        self.corners = _lifted(corners)
        self.follow = follow
        super().__init__(_lengths(self.corners), [corner.time for corner in self.corners])
        self.tangents = _tangents(self.corners)
        self.headings = tuple(
            tangent if c.heading != c.heading else wrap(c.heading)
            for c, tangent in zip(self.corners, self.tangents, strict=True)
        )
        self._pitches = _pitches(self.corners, self.lengths)
        self._rolls = tuple(c.roll if c.roll == c.roll else 0.0 for c in self.corners)
        self._is_flat = not any(self._pitches) and not any(self._rolls)
        self._speeds, self._accelerations = self._lay_out_speed(initial_speed)

    def at(self, s: float) -> PathPoint:
        """The point at a length; beyond the ends, the ends."""
        i, u = self.piece(s)
        a = self.corners[i]
        if i == len(self.corners) - 1:
            x, y, z = a.x, a.y, a.z
        else:
            b = self.corners[i + 1]
            end_z = b.road_z if b.z != b.z else b.z
            x, y, z = a.x + u * (b.x - a.x), a.y + u * (b.y - a.y), a.z + u * (end_z - a.z)
        pitch, roll = (0.0, 0.0) if z == z else (nan, nan)
        if z == z and not self._is_flat:
            pitch, roll = self._angle(self._pitches, i, u), self._angle(self._rolls, i, u)
        headed = a.heading == a.heading
        return PathPoint(x, y, z, self._angle(self.headings, i, u), pitch, roll, self.tangents[i], headed)

    def s_at(self, time: float) -> float:
        """Length at a time: before the first and after the last time stamp, the ends."""
        times = self.times
        if time > times[-1] or len(times) == 1:
            return self.length
        i = max(bisect_left(times, time) - 1, 0)
        elapsed = max(time - times[i], 0.0)
        acceleration = self._accelerations[i]
        if acceleration < 0.0:
            elapsed = min(elapsed, -self._speeds[i] / acceleration)
        return min(self.lengths[i] + elapsed * (self._speeds[i] + 0.5 * acceleration * elapsed), self.lengths[i + 1])

    def speed_at(self, s: float) -> float:
        """Speed where a piece begins, and linearly from there to the next. [m/s]"""
        i, u = self.piece(s)
        if i == len(self.spans):
            return self._speeds[i]
        following = self._speeds[i + 1] if self.follow or i + 2 < len(self.corners) else 0.0
        return self._speeds[i] + u * (following - self._speeds[i])

    def _angle(self, angles: tuple[float, ...], i: int, u: float) -> float:
        if i == len(angles) - 1:
            return angles[i]
        if self.follow:
            return wrap(angles[i] + u * difference(angles[i + 1], angles[i]))
        return self._around_corners(angles, i, u * self.spans[i])

    def _around_corners(self, headings: tuple[float, ...], i: int, along: float) -> float:
        length = self.spans[i]
        radius = max(min(CORNER_LENGTH, 0.5 * length), EPSILON)
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
        for i, ds in enumerate(self.spans):
            dt = self.times[i + 1] - self.times[i]
            if not self.follow:
                speed = ds / dt if dt > EPSILON else 0.0
                speeds[i] = speed
            else:
                accelerations[i], speed = _constant_acceleration(speed, ds, dt)
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
    spans = (hypot(b.x - a.x, b.y - a.y) for a, b in itertools.pairwise(corners))
    return tuple(itertools.accumulate(spans, initial=0.0))


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


def merge_close(corners: Sequence[Corner], radius: float) -> tuple[Corner, ...]:
    """Leave out corners that are hardly apart, but keep the times of a stop.

    The reference player does so, and its logs can't be met otherwise. The first and the last corner stay. Of a run of
    corners within `radius` [m] (and `SAME_HEADING`) of the first of them, that one alone is kept, or, when the next
    corner beyond comes `STOP_DURATION` later or more, that one twice: with its own time and with the last of the run.
    """
    if len(corners) <= 2:
        return tuple(corners)
    kept = [corners[0]]
    i = 1
    while i < len(corners) - 1:
        first, last = kept[-1], i
        if _is_apart(first, corners[i], radius):
            kept.append(corners[i])
            i += 1
            continue
        while last + 1 < len(corners) and not _is_apart(first, corners[last + 1], radius):
            last += 1
        if last + 1 >= len(corners):
            i = last
            break
        beyond = corners[last + 1]
        if beyond.time - first.time >= STOP_DURATION + EPSILON:
            kept.append(replace(first, time=corners[last].time))
        kept.append(beyond)
        i = last + 2
    if i < len(corners):
        kept.append(corners[i])
    return tuple(kept)


def _is_apart(a: Corner, b: Corner, radius: float) -> bool:
    if not (a.is_fixed and b.is_fixed) or hypot(b.x - a.x, b.y - a.y) >= radius + EPSILON:
        return True
    turned = difference(a.heading, b.heading) if a.heading == a.heading and b.heading == b.heading else 0.0
    return turned >= SAME_HEADING + EPSILON


def _lifted(corners: Sequence[Corner]) -> tuple[Corner, ...]:
    """A piece that leads up to a height begins at the height of the road."""
    lifted = (
        replace(a, z=a.road_z if a.road_z == a.road_z else b.z) if a.z != a.z and b.z == b.z else a
        for a, b in itertools.pairwise(corners)
    )
    return *lifted, *corners[-1:]


def _pitches(corners: Sequence[Corner], lengths: Sequence[float]) -> tuple[float, ...]:
    """Pitch at each corner, as given or as its piece climbs. [rad]"""
    heights = [c.z if c.z == c.z else c.road_z for c in corners]
    pitches: list[float] = []
    for i, corner in enumerate(corners):
        ahead = min(i, len(corners) - 2)
        climb = nan
        if ahead >= 0 and lengths[ahead + 1] - lengths[ahead] > EPSILON:
            climb = -atan2(heights[ahead + 1] - heights[ahead], lengths[ahead + 1] - lengths[ahead])
        before = pitches[-1] if pitches else 0.0
        tilt = corner.pitch if corner.pitch == corner.pitch else climb
        pitches.append(tilt if tilt == tilt else before)
    return tuple(pitches)


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
