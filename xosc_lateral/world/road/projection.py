"""From x, y to s, t on roads that are known already: the foot of the perpendicular on the reference line.

References
----------
.. [1] W. H. Press et al., "Numerical Recipes", 3rd ed., 2007, section 9.4: Newton's method kept within a bracket.
"""

from __future__ import annotations

from collections.abc import Collection
from math import asin, atan, atan2, ceil, cos, inf, pi, sin
from typing import NamedTuple

import numpy as np

from xosc_lateral.base.arrays import FloatArray, Int32Array
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.world.road.lane_tables import CHUNK
from xosc_lateral.world.road.lanes import Lane
from xosc_lateral.world.road.positions import LaneCoordinates, Pose
from xosc_lateral.world.road.road import Road
from xosc_lateral.world.road.tables import NetworkTables

ITERATIONS = 40
"""Newton takes 3-6; bisection, where the reference line has a corner, 40 for 1e-11 m."""

MAX_STEP = 25.0
"""Longest step: a guess is never much further off. [m]"""

CONVERGED_STEP = 1e-11
"""A step this short is the last. [m]"""


class Feet(NamedTuple):
    """Feet of perpendiculars: s, t in the leaning surface, how far the point lies ahead of the foot, heading.

    `ahead` differs from 0 beyond the ends of a road and in the outside of corners. [m], [rad]
    """

    s: FloatArray
    t: FloatArray
    ahead: FloatArray
    heading: FloatArray


def project(tables: NetworkTables, road: Int32Array, x: FloatArray, y: FloatArray, guess: FloatArray) -> Feet:
    """Feet on the given roads, from guesses of s; arrays of one length. Shape (n,). [m]"""
    parts = [
        _project(tables, road[part], x[part], y[part], guess[part])
        for part in (slice(begin, begin + CHUNK) for begin in range(0, len(x), CHUNK))
    ]
    if not parts:
        return Feet(*(np.empty(0) for _ in Feet._fields))
    return Feet(*(np.concatenate(field) for field in zip(*parts, strict=True)))


def _project(tables: NetworkTables, road: Int32Array, x: FloatArray, y: FloatArray, guess: FloatArray) -> Feet:
    length = tables.lengths[road]
    s = np.minimum(np.maximum(guess, 0.0), length)
    low, high = np.full(len(x), -1.0), length + 1.0  # beyond the ends: nothing is known yet
    active = np.arange(len(x))
    for _ in range(ITERATIONS):
        at = s[active]
        frame = tables.lines.at(road[active], at, derivatives=True)
        dx, dy = x[active] - frame.x, y[active] - frame.y
        ahead = dx * frame.cos + dy * frame.sin
        across = dy * frame.cos - dx * frame.sin
        lead = tables.lead(road[active], at, across)
        ahead = ahead if lead is None else ahead - lead
        # The foot lies where `ahead` is 0; its derivative is -(1 - k t) |dC/ds|, held off 0 near the evolute.
        lo, hi = np.where(ahead >= 0.0, at, low[active]), np.where(ahead <= 0.0, at, high[active])
        rate = np.maximum(1.0 - frame.curvature * across, 0.2) * np.maximum(frame.speed, 1e-3)
        step = np.clip(ahead / rate, -MAX_STEP, MAX_STEP)
        moved = at + step
        outside = ((moved <= lo) | (moved >= hi)) & (np.abs(step) > CONVERGED_STEP)
        moved = np.where(outside, 0.5 * (lo + hi), moved)
        moved = np.minimum(np.maximum(moved, 0.0), length[active])
        s[active], low[active], high[active] = moved, lo, hi
        active = active[np.abs(moved - at) > CONVERGED_STEP]
        if not len(active):
            break
    return _feet(tables, road, x, y, s)


def _feet(tables: NetworkTables, road: Int32Array, x: FloatArray, y: FloatArray, s: FloatArray) -> Feet:
    frame = tables.lines.at(road, s)
    dx, dy = x - frame.x, y - frame.y
    t = (dy * frame.cos - dx * frame.sin) / tables.shrink(road, s)
    ahead = dx * frame.cos + dy * frame.sin
    lead = tables.lead(road, s, dy * frame.cos - dx * frame.sin)
    ahead = ahead if lead is None else ahead - lead
    return Feet(s, t, np.where(np.abs(ahead) < 1e-9, 0.0, ahead), frame.heading)


def project_at(road: Road, x: float, y: float, guess: float) -> tuple[float, float, float]:
    """`project` of one point in plain floats: s, t, ahead. [m]"""
    length = road.length
    s = min(max(guess, 0.0), length)
    low, high = -1.0, length + 1.0
    leans = not road.surface.superelevation.is_zero and not road.surface.elevation.is_zero
    for _ in range(ITERATIONS):
        line_x, line_y, heading = road.reference_at(s)
        dx, dy, c, d = x - line_x, y - line_y, cos(heading), sin(heading)
        ahead, across = dx * c + dy * d, dy * c - dx * d
        if leans:
            ahead -= road.surface.lead_at(s, across)
        if ahead >= 0.0:
            low = s
        if ahead <= 0.0:
            high = s
        step = min(max(ahead / max(1.0 - road.curvature_at(s) * across, 0.2), -MAX_STEP), MAX_STEP)
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
    if leans:
        ahead -= road.surface.lead_at(s, t)
    if not road.surface.is_level:
        t /= cos(road.surface.superelevation.at(s))
    return s, t, 0.0 if abs(ahead) < 1e-9 else ahead


# ---- one place at a time, in plain floats ----
# Derived here: the surface's axes are the reference line's, turned by its pitch and then by its roll; heading, pitch
# and roll of a vehicle follow from the axes that its own heading gives within that surface.
TWO_PI = 2.0 * pi


def normal_angle(angle: float) -> float:
    """The angle in (-pi, pi]. [rad]"""
    if -pi < angle <= pi:
        return angle
    return angle - TWO_PI * ceil((angle - pi) / TWO_PI)


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
    """Turn within a surface that pitches and rolls, for a change of heading: the reverse of `turned_in_surface`.

    [rad]
    """
    sideways, ahead = sin(change), cos(change)
    return atan2(cos(pitch) * sideways, cos(roll) * ahead - sin(pitch) * sin(roll) * sideways)


def across_lane(lane: Lane, t: float, centre: float, width: float) -> float:
    """How far across a lane t lies, from its inner (0) to its outer edge (1). [-]"""
    if width <= 0.0:
        return 0.0
    outwards = (t - centre) / width if lane.id > 0 else (centre - t) / width
    return min(max(0.5 + outwards, 0.0), 1.0)


def lane_at(road: Road, index: int, s: float, t: float, lane_types: Collection[str] | None) -> LaneCoordinates:
    """The lane of these types that holds t, else the nearest; lanes of no width only where there is nothing else.

    `s`, `t` in [m].
    """
    best: tuple[float, float, float] | None = None
    nearest: tuple[Lane, float] | None = None
    for lane in road.section_at(s).lanes:
        if lane_types is not None and lane.type not in lane_types:
            continue
        centre, _, width = lane.state_at(s)
        away = abs(t - centre)
        score = (max(away - 0.5 * width, 0.0) + (1e3 if width <= 1e-6 else 0.0), away, width)
        if best is None or score < best:
            best, nearest = score, (lane, centre)
    if best is None or nearest is None:
        return LaneCoordinates(index, 0, s, t, t, inf)
    lane, centre = nearest
    return LaneCoordinates(index, lane.id, s, lane.direction * (t - centre), t, max(best[1] - 0.5 * best[2], 0.0))


def limit_at(speeds: tuple[tuple[float, float], ...], s: float) -> float:
    """The speed limit of (s, limit) records at s; inf where there is none. [m/s]"""
    limit = inf
    for start, value in speeds:
        if start <= s:
            limit = value
    return limit
