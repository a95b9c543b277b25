"""From x, y to s, t on roads that are known already: the foot of the perpendicular on the reference line.

References
----------
.. [1] W. H. Press et al., "Numerical Recipes", 3rd ed., 2007, section 9.4: Newton's method kept within a bracket.
"""

from __future__ import annotations

from math import cos, sin
from typing import NamedTuple

import numpy as np

from xosc_lateral.base.arrays import FloatArray, Int32Array
from xosc_lateral.world.road.lane_tables import CHUNK
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
