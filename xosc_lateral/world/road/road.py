"""One road: reference line, lane sections, surface, links; everything that is known about one place on it.

References
----------
.. [1] W. H. Press et al., "Numerical Recipes", 3rd ed., 2007, section 9.4: Newton's method kept within a bracket.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from math import asin, atan, atan2, ceil, cos, inf, nan, pi, sin

from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.world.road.geometry import Line, ReferenceElement
from xosc_lateral.world.road.lanes import Lane, LaneSection
from xosc_lateral.world.road.piecewise import Surface
from xosc_lateral.world.road.positions import TWO_PI, LaneCoordinates, Pose


@dataclass(frozen=True, slots=True)
class RoadLink:
    """What a road is linked to at one of its ends."""

    element_type: str  # "road" or "junction"
    element_id: str
    contact: str  # where the other road is touched: "start", "end", or "": the file does not say (junctions)


@dataclass(frozen=True, slots=True)
class Connection:
    """From an incoming road onto a connecting one; `lanes`: (from, to) lane ids, empty where the file gives none."""

    incoming_road: str
    connecting_road: str
    contact: str
    lanes: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Junction:
    """A junction and its connections."""

    id: str
    name: str
    connections: tuple[Connection, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Road:
    """One road."""

    id: str
    name: str
    length: float  # [m]
    rule: str  # side of the traffic: "RHT" or "LHT"
    junction: str | None  # that it is a connecting road of
    starts: tuple[float, ...]  # s of each element [m]
    elements: tuple[ReferenceElement, ...]
    sections: tuple[LaneSection, ...]  # gapless over [0, length]
    surface: Surface
    speeds: tuple[tuple[float, float], ...]  # s [m], and limit from there on [m/s] (``road/type/speed``); inf: none
    directions: Mapping[int, int]  # of travel along s, by lane id
    predecessor: RoadLink | None
    successor: RoadLink | None
    is_motorway: bool = False  # on some of it at least (``road/type``)
    section_starts: tuple[float, ...] = field(init=False)
    is_flat: bool = field(init=False)
    is_level: bool = field(init=False)  # it leans nowhere
    leads: bool = field(init=False)  # it leans and climbs: what is beside it is further along, too

    def __post_init__(self) -> None:
        object.__setattr__(self, "section_starts", tuple(section.start for section in self.sections))
        heights = any(lane.heights for section in self.sections for lane in section.lanes)
        is_flat = self.surface.is_flat and not heights
        leads = not self.surface.superelevation.is_zero and not self.surface.elevation.is_zero
        for name, value in (("is_flat", is_flat), ("is_level", self.surface.is_level), ("leads", leads)):
            object.__setattr__(self, name, value)

    def section_at(self, s: float) -> LaneSection:
        """The lane section at s; beyond the ends the first or last one. `s` in [m]."""
        return self.sections[self.section_number(s)]

    def section_number(self, s: float) -> int:
        """Index of the lane section at s; beyond the ends the first or last one. `s` in [m]."""
        return max(bisect_right(self.section_starts, s) - 1, 0)

    def element_at(self, s: float) -> tuple[ReferenceElement, float]:
        """The piece of the reference line at s, and how far along it that is. [m]"""
        i = bisect_right(self.starts, s) - 1
        if i < 0:
            i = 0
        return self.elements[i], s - self.starts[i]

    def reference_at(self, s: float) -> tuple[float, float, float]:
        """x, y, heading of the reference line. [m], [rad]"""
        element, along = self.element_at(s)
        return element.at(along)

    def curvature_at(self, s: float) -> float:
        """Curvature of the reference line. [1/m]"""
        element, along = self.element_at(s)
        return element.curvature_at(along)

    def stretch_of(self, lane: int, s: float) -> tuple[float, float, ReferenceElement, float, float]:
        """Range around s on one element of the reference line [m], that element, its start, and t of the lane. [m]

        Where the lane's middle changes along s, its t is NaN; on a line, where it does not matter, 0.
        """
        i = max(bisect_right(self.starts, s) - 1, 0)
        low = self.starts[i] if i else -inf
        high = self.starts[i + 1] if i + 1 < len(self.starts) else inf
        element = self.elements[i]
        if isinstance(element, Line):
            return low, high, element, self.starts[i], 0.0
        here = self.section_at(s).by_id.get(lane)
        if here is None:
            return low, high, element, self.starts[i], nan
        j = max(bisect_right(here.starts, s) - 1, 0)
        low = max(low, here.starts[j] if j else -inf)
        high = min(high, (*here.starts[j + 1 :], inf)[0])
        return low, high, element, self.starts[i], nan if any(here.centre[j][1:]) else here.centre[j][0]


# ---- one place at a time, in plain floats: what the player asks for in every frame ----
# Derived here: the surface's axes are the reference line's, turned by its pitch and then by its roll; heading, pitch
# and roll of a vehicle follow from the axes that its own heading gives within that surface.


def normal_angle(angle: float) -> float:
    """The angle in (-pi, pi]. [rad]"""
    return angle if -pi < angle <= pi else angle - TWO_PI * ceil((angle - pi) / TWO_PI)


def find_lane(road: Road, lane: int, s: float, path: str | None = None) -> Lane:
    """A lane at s; raises `PlaybackError` naming the road, the lane and the lanes that are there. `s` in [m]."""
    section = road.section_at(s)
    here = section.by_id.get(lane)
    if here is None:
        there = ", ".join(str(other.id) for other in section.lanes) or "none"
        raise PlaybackError(f"road '{road.id}' has no lane {lane} at s={s:.3f} m (lanes there: {there})", path=path)
    return here


def lane_pose(road: Road, lane: int, s: float, offset: float) -> Pose:
    """Pose of driving along a lane; `offset` positive to the left of travel. [m], [rad]"""
    s = 0.0 if s < 0.0 else s if s < road.length else road.length
    here = road.section_at(s).by_id.get(lane) or find_lane(road, lane, s)
    centre, slope, width = here.state_at(s)
    direction = here.direction
    return surface_pose(road, s, centre + direction * offset, slope, direction, here, centre, width)


def surface_pose(
    road: Road,
    s: float,
    t: float,
    slope: float = 0.0,
    direction: int = 1,
    lane: Lane | None = None,
    centre: float = 0.0,
    width: float = 0.0,
) -> Pose:
    """Pose at (s, t), heading along (+1) or against (-1) s, turned by the slope of what is followed. [m], [rad]"""
    x, y, heading = road.reference_at(s)
    z = pitch = roll = 0.0
    from_line = t
    forward = heading
    if not road.is_flat:
        z, pitch, roll, shrink, drift, lead = road.surface.at(s, t)
        from_line = t * shrink
        if lead != 0.0:
            x, y = x + lead * cos(heading), y + lead * sin(heading)
        if drift != 0.0:
            forward += atan(drift)
        if lane is not None and lane.heights:
            z += lane.height_at(s, across_lane(lane, t, centre, width))
    x -= from_line * sin(heading)
    y += from_line * cos(heading)
    turn = atan(slope) if slope != 0.0 else 0.0
    if turn != 0.0 and (pitch != 0.0 or roll != 0.0):
        turn, pitch, roll = turned_in_surface(turn, pitch, roll)
    if direction < 0:
        turn, pitch, roll = turn + pi, -pitch, -roll
    return Pose(x, y, z, normal_angle(forward + turn), pitch, roll)


def turned_in_surface(turn: float, pitch: float, roll: float) -> tuple[float, float, float]:
    """Heading change, pitch and roll after turning by `turn` within a surface that pitches and rolls.

    The angles of the rotation Ry(pitch) Rx(roll) Rz(turn), seen as Rz Ry Rx again.
    """
    cos_turn, sin_turn, cos_pitch, sin_pitch = cos(turn), sin(turn), cos(pitch), sin(pitch)
    cos_roll, sin_roll = cos(roll), sin(roll)
    forward_x = cos_pitch * cos_turn + sin_pitch * sin_roll * sin_turn
    forward_z = cos_pitch * sin_roll * sin_turn - sin_pitch * cos_turn
    lateral_z = cos_pitch * sin_roll * cos_turn + sin_pitch * sin_turn
    return (
        atan2(cos_roll * sin_turn, forward_x),
        -asin(min(max(forward_z, -1.0), 1.0)),
        atan2(lateral_z, cos_pitch * cos_roll),
    )


def turn_for_heading(change: float, pitch: float, roll: float) -> float:
    """Turn within a surface that pitches and rolls, for a change of heading: undoes `turned_in_surface`. [rad]"""
    sideways, ahead = sin(change), cos(change)
    return atan2(cos(pitch) * sideways, cos(roll) * ahead - sin(pitch) * sin(roll) * sideways)


def across_lane(lane: Lane, t: float, centre: float, width: float) -> float:
    """How far across a lane t lies, from its inner (0) to its outer edge (1). [-]"""
    if width <= 0.0:
        return 0.0
    outwards = (t - centre) / width if lane.id > 0 else (centre - t) / width
    return min(max(0.5 + outwards, 0.0), 1.0)


def lane_at(
    road: Road,
    index: int,
    s: float,
    t: float,
    lane_types: Collection[str] | None,
    *,
    prefer: int | None = None,
    direction: int = 0,
) -> LaneCoordinates:
    """The lane of these types that holds t, else the nearest; lanes of no width only as a last resort. [m]

    At the edge of two it is the lane `prefer`; with a `direction`, it is one driven along (+1) or against (-1) s.
    """
    best: tuple[float, bool, float, float] | None = None
    nearest: tuple[Lane, float] | None = None
    for lane in road.section_at(s).lanes:
        if (lane_types is not None and lane.type not in lane_types) or direction == -lane.direction:
            continue
        centre, _, width = lane.state_at(s)
        away = abs(t - centre)
        outside = max(away - 0.5 * width, 0.0) + (1e3 if width <= 1e-6 else 0.0)
        score = (outside if prefer is None else round(outside, 9), lane.id != prefer, away, width)
        if best is None or score < best:
            best, nearest = score, (lane, centre)
        if away < 0.5 * width - 1e-6:
            break  # it holds t, and lanes do not overlap
    if best is None or nearest is None:
        return LaneCoordinates(index, 0, s, t, t, inf)
    lane, centre = nearest
    return LaneCoordinates(index, lane.id, s, lane.direction * (t - centre), t, max(best[2] - 0.5 * best[3], 0.0))


def limit_at(speeds: tuple[tuple[float, float], ...], s: float) -> float:
    """The speed limit of (s, limit) records at s; inf where there is none. [m/s]"""
    return next((value for start, value in reversed(speeds) if start <= s), inf)


# ---- from x, y to s, t: the foot of the perpendicular on the reference line ----
MOST_ITERATIONS = 40
"""Newton takes 3-6; bisection, where the reference line has a corner, 40 for 1e-11 m."""

MAX_STEP = 25.0
"""Longest step: a guess is never much further off. [m]"""

CONVERGED_STEP = 1e-11
"""A step this short is the last. [m]"""


def project_at(road: Road, x: float, y: float, guess: float) -> tuple[float, float, float]:
    """s, t in the leaning surface, and how far a point lies ahead of the foot: beyond an end, outside a corner. [m]"""
    length = road.length
    s = min(max(guess, 0.0), length)
    low, high = -1.0, length + 1.0
    for _ in range(MOST_ITERATIONS):
        element, along = road.element_at(s)
        line_x, line_y, heading = element.at(along)
        dx, dy, c, d = x - line_x, y - line_y, cos(heading), sin(heading)
        ahead, across = dx * c + dy * d, dy * c - dx * d
        if road.leads:
            ahead -= road.surface.lead_at(s, across)
        if ahead >= 0.0:
            low = s
        if ahead <= 0.0:
            high = s
        step = min(max(ahead / max(1.0 - element.curvature_at(along) * across, 0.2), -MAX_STEP), MAX_STEP)
        moved = s + step
        if abs(step) > CONVERGED_STEP and (moved <= low or moved >= high):
            moved = 0.5 * (low + high)
        moved = min(max(moved, 0.0), length)
        done = abs(moved - s) <= CONVERGED_STEP
        s = moved
        if done:
            break
    line_x, line_y, heading = road.reference_at(s)
    dx, dy, c, d = x - line_x, y - line_y, cos(heading), sin(heading)
    ahead = dx * c + dy * d
    t = dy * c - dx * d
    if road.leads:
        ahead -= road.surface.lead_at(s, t)
    if not road.is_level:
        t /= cos(road.surface.superelevation.at(s))
    return s, t, 0.0 if abs(ahead) < 1e-9 else ahead
