"""Offsets of one stretch of road-following as a few ramps between lane offsets."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.motion.nominal import EntityMotion
from xosc_lateral.road import RoadNetwork

FloatArray = NDArray[np.float64]

SETTLING_TIME = 2.0
"""From the nominal offset at a stretch's start to the sampled one: 0.3 m take 0.45 m/s2 at most. [s]"""
TOLERANCE = 0.01
"""How far straight ramps between two targets may be from the sampled offset. [m]"""
LEAST_STEP = 0.2
"""Time between two targets: the step of the sampled offsets. [s]"""
LEAST_CHANGE = 1e-3
"""A smaller change of the target is left to the next one. [m]"""
FLIP_MARGIN = 0.3
"""Before and after a flip of +t in which nothing is commanded: the run may be a little early or late there. [s]"""


@dataclass(frozen=True, eq=False, slots=True)
class OffsetChain:
    """Offsets of one entity on one stretch of road-following.

    Parameters
    ----------
    entity : str
    time : array, shape (n,)
        Increasing. [s]
    offset_t : array, shape (n,)
        From the lane centre along +t, as ``AbsoluteTargetLaneOffset`` has it, the nominal offset included. [m]
    start_t : float
        Where the entity is when the chain begins, along +t: the first ramp leads from there. [m]
    flips : tuple of float
        Times from which +t is on the vehicle's other side: it comes to a road that runs the other way. [s]
    """

    entity: str
    time: FloatArray
    offset_t: FloatArray
    start_t: float = 0.0
    flips: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Ramp:
    """One lane offset action: from `origin` to `target` between two times. [s], [m]"""

    start: float
    end: float
    origin: float
    target: float
    settles: bool


def offset_chain(
    motion: EntityMotion, network: RoadNetwork, deviation: FloatArray, first: int, last: int
) -> OffsetChain:
    """Chain for rows first..last (both included) of a motion with a deviation positive to the left of travel. [m]"""
    rows = slice(first, last + 1)
    along_lane = np.where(np.cos(motion.heading_relative[rows]) >= 0.0, 1.0, -1.0)
    offset = motion.offset[rows] + along_lane * deviation[rows]
    direction = network.travel_directions(motion.road[rows], motion.lane[rows])
    flips = motion.time[rows][1:][np.diff(direction) != 0]
    start_t = float(direction[0] * motion.offset[first])
    return OffsetChain(motion.name, motion.time[rows], direction * offset, start_t, tuple(flips.tolist()))


def ramps(chain: OffsetChain) -> list[Ramp]:
    """As few ramps as the tolerance allows: one to settle at the start, then straight ones.

    Around a flip of +t nothing is commanded: a target set on one side of it would be followed on the other.
    """
    found: list[Ramp] = []
    borders = [float(chain.time[0]), *chain.flips, float(chain.time[-1]) + FLIP_MARGIN]
    for number, (begin, end) in enumerate(pairwise(borders)):
        first = begin if number == 0 else begin + FLIP_MARGIN
        settled = first + (LEAST_STEP if found else SETTLING_TIME)
        rows = np.flatnonzero((chain.time >= settled - 1e-9) & (chain.time <= end - FLIP_MARGIN + 1e-9))
        if len(rows) == 0:
            continue
        time, offset = chain.time[rows], chain.offset_t[rows]
        origin = float(np.interp(first, chain.time, chain.offset_t)) if found else chain.start_t * (-1) ** number
        found.append(Ramp(first, float(time[0]), origin, float(offset[0]), settles=not found))
        found.extend(_straight_ramps(time, offset))
    return found


def _straight_ramps(time: FloatArray, offset: FloatArray) -> list[Ramp]:
    found: list[Ramp] = []
    start, last = 0, float(offset[0])
    while start < len(time) - 1:
        end = _farthest(time, offset, start)
        # A ramp to where it is already would only cost an event, but for the last one.
        if abs(float(offset[end]) - last) >= LEAST_CHANGE or end == len(time) - 1:
            found.append(Ramp(float(time[start]), float(time[end]), last, float(offset[end]), settles=False))
            last = float(offset[end])
        start = end
    return found


def _farthest(time: FloatArray, offset: FloatArray, start: int) -> int:
    """Last row that a straight ramp from `start` reaches within the tolerance; at least one step away.

    Cone of slopes that pass every row between within the tolerance: the ramp may end where its slope is inside.
    """
    ahead = time[start + 1 :] - time[start]
    change = offset[start + 1 :] - offset[start]
    lower = np.maximum.accumulate((change - TOLERANCE) / ahead)
    upper = np.minimum.accumulate((change + TOLERANCE) / ahead)
    slope = change / ahead
    # Past the first row at which the cone is empty it stays empty.
    inside = np.flatnonzero((slope >= lower) & (slope <= upper) & (lower <= upper))
    at_least = min(int(np.searchsorted(ahead, LEAST_STEP - 1e-9)), len(ahead) - 1)
    return start + 1 + max(int(inside[-1]) if len(inside) else 0, at_least)
