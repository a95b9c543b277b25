"""From nominal motion and a lateral deviation to the path that is written.

The shift is one across the lane; headings and speeds follow from the shifted path [1]_.

References
----------
.. [1] M. Werling, J. Ziegler, S. Kammel, S. Thrun, "Optimal trajectory generation for dynamic street scenarios
       in a Frenét frame", IEEE ICRA 2010.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray
from xosc_lateral.base.rows import blocks, columns, empty, put, rows_where, scratch
from xosc_lateral.world.motion.nominal import Activity, EntityMotion
from xosc_lateral.world.road.network import RoadNetwork

_STANDSTILL = 1e-3
"""Displacement per step under which a direction of motion can't be read from it. [m]"""

_LEAP_DISTANCE = 0.3
"""Further than what is driven in a step, and slid sideways at `_MAXIMUM_LATERAL_SPEED`, by this much: a leap. [m]"""

_MAXIMUM_LATERAL_SPEED = 10.0
"""No lateral action is faster. [m/s]"""


@dataclass(frozen=True, eq=False, slots=True)
class WorldTrajectory:
    """A path in the world over time, on the rows of the nominal motion; arrays of shape (n,)."""

    time: FloatArray
    """[s]"""
    x: FloatArray
    y: FloatArray
    z: FloatArray
    """[m]"""
    heading: FloatArray
    pitch: FloatArray
    roll: FloatArray
    """[rad]"""
    speed: FloatArray
    """Along the path, negative when driving backwards. [m/s]"""


def distance_driven(motion: EntityMotion) -> FloatArray:
    """Distance driven on the nominal path up to each row, shape (n,); being placed anew is no driving. [m]"""
    distance = scratch(len(motion.x))
    distance[:1] = 0.0
    for rows in blocks(len(distance), 1):
        around = slice(rows.start - 1, rows.stop)
        ahead = np.hypot(np.diff(motion.x[around]), np.diff(motion.y[around]))
        placed_anew = (motion.activity[rows] & Activity.TELEPORTED) != 0
        steps = np.concatenate((distance[rows.start - 1 : rows.start], np.where(placed_anew, 0.0, ahead)))
        distance[rows] = np.cumsum(steps)[1:]
    return distance


def leaps(motion: EntityMotion) -> list[tuple[float, float]]:
    """Times [s] and lengths [m] of jumps that nobody asked for: a followed lane closes, roads don't meet.

    What a scenario places anew is none (`Activity.TELEPORTED`).
    """

    def moved(around: slice) -> FloatArray:
        return np.hypot(np.diff(motion.x[around]), np.diff(motion.y[around]))

    def leaps_there(rows: slice) -> BoolArray:
        around = slice(rows.start - 1, rows.stop)
        step, speed, activity = np.diff(motion.time[around]), np.abs(motion.speed[around]), motion.activity[around]
        active = (activity & Activity.ACTIVE) != 0
        whole = active[1:] & active[:-1] & ((activity[1:] & Activity.TELEPORTED) == 0)
        driven = np.maximum(speed[1:], speed[:-1]) * step
        return np.asarray(whole & (moved(around) > driven + _LEAP_DISTANCE + _MAXIMUM_LATERAL_SPEED * step))

    leaping = rows_where(len(motion.time), leaps_there, 1)
    return [(float(motion.time[k]), float(moved(slice(k - 1, k + 1))[0])) for k in leaping]


def displace(motion: EntityMotion, network: RoadNetwork, deviation: FloatArray) -> WorldTrajectory:
    """Shift a motion sideways in lane coordinates; headings and speeds follow from the shifted path.

    The deviation [m], shape (n,), is added to the nominal offset, positive to the left of the vehicle's travel; it is
    ignored where the vehicle is on no road.
    """
    n = len(motion.time)
    x, y, z = columns(n, _shifted(motion, network, deviation)) if n else (motion.x, motion.y, motion.z)
    heading, speed = motion.heading, motion.speed
    if any(_moves(motion, deviation, rows).any() for rows in blocks(n)):
        heading, speed = _turned_and_longer(motion, x, y)
    return WorldTrajectory(motion.time, x, y, z, heading, motion.pitch, motion.roll, speed)


def _moves(motion: EntityMotion, deviation: FloatArray, rows: slice) -> BoolArray:
    return np.asarray((motion.road[rows] >= 0) & (deviation[rows] != 0.0))


def _shifted(motion: EntityMotion, network: RoadNetwork, deviation: FloatArray) -> Iterator[list[FloatArray]]:
    """x, y and z in blocks of rows. [m]"""
    for part in blocks(len(motion.time)):
        shifted = [values[part].copy() for values in (motion.x, motion.y, motion.z)]
        moved = np.flatnonzero(_moves(motion, deviation, part))
        if len(moved):
            rows = moved + part.start
            # a vehicle that meets its lane's traffic head-on has its left on the lane's right
            along_lane = np.where(np.cos(motion.heading_relative[rows]) >= 0.0, 1.0, -1.0)
            road, lane, s, nominal = motion.road[rows], motion.lane[rows], motion.s[rows], motion.offset[rows]
            points = network.lane_points(road, lane, s, nominal, nominal + along_lane * deviation[rows])
            # the nominal pose is kept to the bit and only the difference added, so that none changes nothing
            for values, before, after in zip(shifted, *points, strict=True):
                values[moved] += after - before
        yield shifted


def _pieces(motion: EntityMotion) -> list[slice]:
    """Runs of rows between which the entity was not placed anew."""
    n = len(motion.time)
    cut = rows_where(n, lambda rows: (motion.activity[rows] & Activity.TELEPORTED) != 0)
    borders = sorted({0, *cut.tolist(), n})
    return [slice(a, b) for a, b in pairwise(borders)]


def _overlapping(piece: slice) -> Iterator[tuple[slice, slice, slice]]:
    """Rows of a piece in blocks; with a row more on each side, for derivatives; those counted in these."""
    for rows in blocks(piece.stop, piece.start):
        first, last = max(rows.start - 1, piece.start), min(rows.stop + 1, piece.stop)
        yield rows, slice(first, last), slice(rows.start - first, rows.stop - first)


def _turned_and_longer(motion: EntityMotion, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Heading and speed on a shifted path, shape (n,) each. [rad], [m/s]

    Nominal heading, and the shifted path's direction against the nominal one's, held where one stands. Nominal speed
    times the ratio of path lengths, which stays right at a speed step.
    """
    heading, speed = empty(len(x)), empty(len(x))
    for piece in _pieces(motion):
        if piece.stop - piece.start < 2:
            put(heading, piece, motion.heading[piece] + 0.0)
            put(speed, piece, motion.speed[piece])
            continue
        held, waiting = 0.0, piece.start  # rows from `waiting` on stand at the piece's start: as where it moves first
        for rows, around, inside in _overlapping(piece):
            nominal = (np.gradient(motion.x[around]) + 1j * np.gradient(motion.y[around]))[inside]
            shifted = (np.gradient(x[around]) + 1j * np.gradient(y[around]))[inside]
            moving = np.minimum(np.abs(nominal), np.abs(shifted)) > _STANDSTILL
            turn = np.angle(shifted * np.conj(nominal))
            length, longer = (np.hypot(step.real, step.imag) for step in (nominal, shifted))
            driven = length > _STANDSTILL
            put(speed, rows, motion.speed[rows] * np.where(driven, longer / np.where(driven, length, 1.0), 1.0))
            last = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), -1))
            if waiting >= 0 and moving.any():
                held = float(turn[int(np.argmax(moving))])
                for earlier in blocks(rows.start, waiting):
                    put(heading, earlier, motion.heading[earlier] + held)
                waiting = -1
            put(heading, rows, motion.heading[rows] + np.where(last < 0, held, turn[last]))
            held = held if last[-1] < 0 else float(turn[last[-1]])
    return heading, speed
