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
from numpy.typing import NDArray

from xosc_lateral.mask import BLOCK, true_blocks
from xosc_lateral.motion.nominal import Activity, EntityMotion
from xosc_lateral.road.network import RoadNetwork

FloatArray = NDArray[np.float64]

_STANDSTILL = 1e-3
"""Displacement per step under which a direction of motion can't be read from it. [m]"""

_LEAP = 0.3
"""Further than what is driven in a step, and slid sideways at `_ASIDE`, by this much is no driving. [m]"""

_ASIDE = 10.0
"""No lateral action is faster. [m/s]"""


@dataclass(frozen=True, eq=False, slots=True)
class WorldTrajectory:
    """A path in the world over time, on the rows of the nominal motion.

    Parameters
    ----------
    time : array, shape (n,)
        [s]
    x, y, z : array, shape (n,)
        [m]
    heading, pitch, roll : array, shape (n,)
        [rad]
    speed : array, shape (n,)
        Along the path, negative when driving backwards. [m/s]
    """

    time: FloatArray
    x: FloatArray
    y: FloatArray
    z: FloatArray
    heading: FloatArray
    pitch: FloatArray
    roll: FloatArray
    speed: FloatArray


def distance_driven(motion: EntityMotion) -> FloatArray:
    """Distance driven on the nominal path up to each row, shape (n,); being placed anew is no driving. [m]"""
    ahead = np.hypot(np.diff(motion.x), np.diff(motion.y))
    placed_anew = (motion.activity[1:] & Activity.TELEPORTED) != 0
    return np.concatenate(([0.0], np.cumsum(np.where(placed_anew, 0.0, ahead))))


def leaps(motion: EntityMotion) -> list[tuple[float, float]]:
    """Times [s] and lengths [m] of jumps that nobody asked for: a followed lane closes, roads don't meet.

    What a scenario places anew is none (`Activity.TELEPORTED`).
    """
    step = np.diff(motion.time)
    driven = np.maximum(np.abs(motion.speed[1:]), np.abs(motion.speed[:-1])) * step
    moved = np.hypot(np.diff(motion.x), np.diff(motion.y))
    active = (motion.activity & Activity.ACTIVE) != 0
    whole = active[1:] & active[:-1] & ((motion.activity[1:] & Activity.TELEPORTED) == 0)
    found = np.flatnonzero(whole & (moved > driven + _LEAP + _ASIDE * step))
    return [(float(motion.time[k + 1]), float(moved[k])) for k in found]


def displace(motion: EntityMotion, network: RoadNetwork, deviation: FloatArray) -> WorldTrajectory:
    """Shift a motion sideways in lane coordinates; headings and speeds follow from the shifted path.

    Parameters
    ----------
    motion : EntityMotion
    network : RoadNetwork
    deviation : array, shape (n,)
        Added to the nominal offset, positive to the left of the vehicle's travel; ignored where it is on no road. [m]
    """
    x, y, z, heading = motion.x.copy(), motion.y.copy(), motion.z.copy(), motion.heading
    moved = (motion.road >= 0) & (deviation != 0.0)
    for rows in true_blocks(moved):
        # a vehicle that meets its lane's traffic head-on has its left on the lane's right
        along_lane = np.where(np.cos(motion.heading_relative[rows]) >= 0.0, 1.0, -1.0)
        road, lane, s, nominal = motion.road[rows], motion.lane[rows], motion.s[rows], motion.offset[rows]
        poses = network.lane_points(road, lane, s, nominal, nominal + along_lane * deviation[rows])
        # the nominal pose is kept to the bit and only the difference added, so that a zero deviation changes nothing
        for axis, before, after in zip((x, y, z), *poses, strict=True):
            axis[rows] += after - before
    speed = motion.speed
    if moved.any():
        change, ratio = _turned_and_longer(motion, x, y)
        heading, speed = heading + change, speed * ratio
    return WorldTrajectory(motion.time, x, y, z, heading, motion.pitch, motion.roll, speed)


def _pieces(motion: EntityMotion) -> list[slice]:
    """Runs of rows between which the entity was not placed anew."""
    cut = np.flatnonzero((motion.activity & Activity.TELEPORTED) != 0)
    borders = sorted({0, *cut.tolist(), len(motion.time)})
    return [slice(a, b) for a, b in pairwise(borders)]


def _overlapping(piece: slice) -> Iterator[tuple[slice, slice, slice]]:
    """Rows of a piece in blocks: counted in the piece; with a row more on each side, for derivatives; without it."""
    for begin in range(piece.start, piece.stop, BLOCK):
        end = min(begin + BLOCK, piece.stop)
        first, last = max(begin - 1, piece.start), min(end + 1, piece.stop)
        yield slice(begin - piece.start, end - piece.start), slice(first, last), slice(begin - first, end - first)


def _turned_and_longer(motion: EntityMotion, x: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Direction of the shifted path against the nominal one's, held where the vehicle stands, and ratio of lengths.

    Nominal speed times that ratio stays right at a speed step. Shape (n,) each. [rad], [-]
    """
    change, ratio = np.zeros(len(x)), np.ones(len(x))
    for piece in _pieces(motion):
        if piece.stop - piece.start < 2:
            continue
        turn, moving = np.empty(piece.stop - piece.start), np.empty(piece.stop - piece.start, dtype=bool)
        for part, around, inside in _overlapping(piece):
            nominal = (np.gradient(motion.x[around]) + 1j * np.gradient(motion.y[around]))[inside]
            shifted = (np.gradient(x[around]) + 1j * np.gradient(y[around]))[inside]
            moving[part] = np.minimum(np.abs(nominal), np.abs(shifted)) > _STANDSTILL
            turn[part] = np.angle(shifted * np.conj(nominal))
            np.divide(
                np.hypot(shifted.real, shifted.imag),
                length := np.hypot(nominal.real, nominal.imag),
                out=ratio[piece][part],
                where=length > _STANDSTILL,
            )
        if not moving.any():
            continue
        last = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), -1))
        last[last < 0] = int(np.argmax(moving))
        change[piece] = turn[last]
    return change, ratio
