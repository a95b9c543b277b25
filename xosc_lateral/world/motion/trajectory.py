"""From nominal motion and sampled offsets to the path that is written.

The lateral deviation is one smooth function of the distance driven. Inside a road-following segment it runs through the
sampled offsets; between segments it leads over from the end of one to the start of the next. Of distance, not of time:
a car that stands must not slide sideways, and the path's heading and curvature stay continuous even where a maneuver
changes the speed at once. The shift is one across the lane; headings and speeds follow from the shifted path [1]_.

References
----------
.. [1] M. Werling, J. Ziegler, S. Kammel, S. Thrun, "Optimal trajectory generation for dynamic street scenarios
       in a Frenét frame", IEEE ICRA 2010.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from msgspec import Struct

from xosc_lateral.base.arrays import BoolArray, FloatArray, blocks, columns
from xosc_lateral.base.track import Track
from xosc_lateral.world.motion.nominal import POSE, Activity, EntityMotion
from xosc_lateral.world.road.network import RoadNetwork

_STANDSTILL = 1e-3
"""Displacement per step under which a direction of motion can't be read from it. [m]"""


def distance_driven(motion: EntityMotion) -> FloatArray:
    """Distance driven on the nominal path up to each row, shape (n,); being placed anew is no driving. [m]"""
    distance = np.empty(len(motion.x))
    distance[:1] = 0.0
    for rows in blocks(len(distance), 1):
        around = slice(rows.start - 1, rows.stop)
        ahead = np.hypot(np.diff(motion.x[around]), np.diff(motion.y[around]))
        placed_anew = (motion.activity[rows] & Activity.TELEPORTED) != 0
        steps = np.concatenate((distance[rows.start - 1 : rows.start], np.where(placed_anew, 0.0, ahead)))
        distance[rows] = np.cumsum(steps)[1:]
    return distance


def displace(motion: EntityMotion, network: RoadNetwork, deviation: FloatArray) -> Track:
    """The path to the left of a motion by a deviation [m], where it is on a road; headings and speeds follow from it.

    It has the columns of `POSE` alone: those of the place are the motion's.
    """
    n = len(motion.time)
    x, y, z = columns(n, _shifted(motion, network, deviation)) if n else (motion.x, motion.y, motion.z)
    heading, speed = motion.heading, motion.speed
    if any(_moves(motion, deviation, rows).any() for rows in blocks(n)):
        heading, speed = _turned_and_longer(motion, x, y)
    pose = {name: motion.columns[name] for name in POSE} | {"x": x, "y": y, "z": z, "heading": heading, "speed": speed}
    return Track(motion.name, motion.time, pose, motion.breaks)


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
            along_lane = motion.way(rows)
            road, lane, s, nominal = motion.road[rows], motion.lane[rows], motion.s[rows], motion.offset[rows]
            points = network.lane_points(road, lane, s, nominal, nominal + along_lane * deviation[rows])
            # the nominal pose is kept to the bit and only the difference added, so that none changes nothing
            for values, before, after in zip(shifted, *points, strict=True):
                values[moved] += after - before
        yield shifted


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
    heading, speed = np.empty(len(x)), np.empty(len(x))
    for piece in (slice(a, b) for a, b in pairwise([0, *motion.breaks.tolist(), len(x)])):
        if piece.stop - piece.start < 2:
            heading[piece] = motion.heading[piece] + 0.0
            speed[piece] = motion.speed[piece]
            continue
        held, waiting = 0.0, piece.start  # rows from `waiting` on stand at the piece's start: as where it moves first
        for rows, around, inside in _overlapping(piece):
            nominal = (np.gradient(motion.x[around]) + 1j * np.gradient(motion.y[around]))[inside]
            shifted = (np.gradient(x[around]) + 1j * np.gradient(y[around]))[inside]
            moving = np.minimum(np.abs(nominal), np.abs(shifted)) > _STANDSTILL
            turn = np.angle(shifted * np.conj(nominal))
            length, longer = (np.hypot(step.real, step.imag) for step in (nominal, shifted))
            driven = length > _STANDSTILL
            speed[rows] = motion.speed[rows] * np.where(driven, longer / np.where(driven, length, 1.0), 1.0)
            last = np.maximum.accumulate(np.where(moving, np.arange(len(moving)), -1))
            if waiting >= 0 and moving.any():
                held = float(turn[int(np.argmax(moving))])
                for earlier in blocks(rows.start, waiting):
                    heading[earlier] = motion.heading[earlier] + held
                waiting = -1
            heading[rows] = motion.heading[rows] + np.where(last < 0, held, turn[last])
            held = held if last[-1] < 0 else float(turn[last[-1]])
    return heading, speed


# ---- The lateral deviation from nominal motion as one smooth func ----
class NaturalSpline(Struct, frozen=True, eq=False):
    """Natural cubic spline: values and second derivatives (`bends`) at its knots.

    Our own dozen lines since scipy.interpolate alone takes a third of `convert`'s time.
    """

    knots: FloatArray
    values: FloatArray
    bends: FloatArray

    @classmethod
    def natural(cls, knots: FloatArray, values: FloatArray) -> NaturalSpline:
        """Through the points (knots, values), shape (n,) each, n >= 2, knots strictly increasing."""
        knots, values = np.array(knots, dtype=np.float64), np.array(values, dtype=np.float64)
        if knots.shape != values.shape or len(knots) < 2 or not (np.diff(knots) > 0.0).all():
            raise ValueError("a spline needs two or more points at strictly increasing distances")
        return cls(knots, values, _second_derivatives(knots, values))

    def __call__(self, at: FloatArray) -> FloatArray:
        """Values at these places, any shape. [unit of the values]"""
        k = np.clip(np.searchsorted(self.knots, at, side="right") - 1, 0, len(self.knots) - 2)
        width = self.knots[k + 1] - self.knots[k]
        b = (at - self.knots[k]) / width
        a = 1.0 - b
        cubic = ((a**3 - a) * self.bends[k] + (b**3 - b) * self.bends[k + 1]) * width**2 / 6.0
        return np.asarray(a * self.values[k] + b * self.values[k + 1] + cubic)

    def start(self) -> tuple[float, float, float]:
        """Value, slope and second derivative at the first knot."""
        width = self.knots[1] - self.knots[0]
        slope = (self.values[1] - self.values[0]) / width - width * (2.0 * self.bends[0] + self.bends[1]) / 6.0
        return float(self.values[0]), float(slope), float(self.bends[0])

    def end(self) -> tuple[float, float, float]:
        """Value, slope and second derivative at the last knot."""
        width = self.knots[-1] - self.knots[-2]
        slope = (self.values[-1] - self.values[-2]) / width + width * (self.bends[-2] + 2.0 * self.bends[-1]) / 6.0
        return float(self.values[-1]), float(slope), float(self.bends[-1])


def _second_derivatives(knots: FloatArray, values: FloatArray) -> FloatArray:
    """Solve the spline's tridiagonal system by elimination (Thomas); natural ends."""
    width = np.diff(knots)
    jump = 6.0 * np.diff(np.diff(values) / width)
    n = len(knots)
    bends = np.zeros(n)
    if n == 2:
        return bends
    below, diagonal, right = width.tolist(), (2.0 * (width[:-1] + width[1:])).tolist(), jump.tolist()
    for i in range(1, n - 2):
        factor = below[i] / diagonal[i - 1]
        diagonal[i] -= factor * below[i]
        right[i] -= factor * right[i - 1]
    last = 0.0
    for i in range(n - 3, -1, -1):
        last = (right[i] - (below[i + 1] * last if i < n - 3 else 0.0)) / diagonal[i]
        bends[i + 1] = last
    return bends


SETTLING_TIME = 3.0
"""Lateral speed and acceleration left over at a segment's border die out within this time at the border's speed. [s]"""


class SampledDeviation(Struct, frozen=True, eq=False):
    """Offsets sampled on one road-following segment."""

    distance: FloatArray  # driven at each sample, strictly increasing, shape (n,), n >= 2 [m]
    deviation: FloatArray  # sampled offset, positive left, shape (n,) [m]
    settling: tuple[float, float]
    """Distances before the first and after the last sample within which lateral movement may settle. [m]"""


class Deviation(Struct, frozen=True, eq=False):
    """Deviation from nominal motion, twice continuously differentiable in the distance driven."""

    splines: tuple[NaturalSpline, ...]  # one per sampled segment, in order of distance
    settling: tuple[tuple[float, float], ...]  # as in `SampledDeviation`

    def __call__(self, distance: FloatArray) -> FloatArray:
        """Evaluate at distances driven, shape (n,). [m]"""
        distance = np.asarray(distance, dtype=np.float64)
        if not self.splines:
            return np.zeros_like(distance)
        result = np.empty_like(distance)
        starts = np.array([spline.knots[0] for spline in self.splines])
        ends = np.array([spline.knots[-1] for spline in self.splines])
        after = np.searchsorted(starts, distance, side="right") - 1
        for k in range(int(after.min(initial=0)), int(after.max(initial=-1)) + 1):
            here = after == k
            if k >= 0:
                inside = here & (distance <= ends[k])
                result[inside] = self.splines[k](distance[inside])
                here &= distance > ends[k]
            if here.any():
                result[here] = self._lead_over(distance[here], k)
        return result

    def _lead_over(self, distance: FloatArray, k: int) -> FloatArray:
        """From the end of spline k (-1: none) to the start of spline k + 1 (if there is one)."""
        before = self.splines[k] if k >= 0 else None
        behind = self.splines[k + 1] if k + 1 < len(self.splines) else None
        here = before.end() if before else None
        there = behind.start() if behind else None
        gap = behind.knots[0] - before.knots[-1] if before and behind else np.inf
        if before and behind and gap < _CONTACT_TOLERANCE:
            return np.full_like(distance, 0.5 * (before.end()[0] + behind.start()[0]))
        if here is None or there is None:
            level = np.full_like(distance, (here or there)[0])  # type: ignore[index]
        else:
            share = smoother_step((distance - before.knots[-1]) / gap)  # type: ignore[union-attr]
            level = here[0] + (there[0] - here[0]) * share
        if before and here:
            reach = min(self.settling[k][1], gap)
            level = level + settle(distance - before.knots[-1], reach, here[1], here[2])
        if behind and there:
            reach = min(self.settling[k + 1][0], gap)
            level = level + settle(behind.knots[0] - distance, reach, -there[1], there[2])
        return np.asarray(level)


_CONTACT_TOLERANCE = 1e-6
"""Two segments less than this apart meet in a point (the entity was placed anew). [m]"""


def deviation_through(segments: Sequence[SampledDeviation]) -> Deviation:
    """Deviation that runs through the sampled offsets of all segments, which must not overlap."""
    return Deviation(
        splines=tuple(NaturalSpline.natural(part.distance, part.deviation) for part in segments),
        settling=tuple(part.settling for part in segments),
    )


def smoother_step(u: FloatArray) -> FloatArray:
    """0 to 1 with vanishing first and second derivatives at both ends."""
    u = np.clip(u, 0.0, 1.0)
    return np.asarray(u**3 * (10.0 - 15.0 * u + 6.0 * u**2))


def settle(
    distance: FloatArray, reach: float | FloatArray, slope: float | FloatArray, bend: float | FloatArray
) -> FloatArray:
    """Quintic Hermite function: value 0, slope and second derivative at 0 as given; all three 0 at `reach`."""
    if np.all(np.asarray(reach) <= 0.0):
        return np.zeros_like(distance)
    u = np.clip(distance / reach, 0.0, 1.0)
    by_slope = u - 6.0 * u**3 + 8.0 * u**4 - 3.0 * u**5
    by_bend = 0.5 * u**2 * (1.0 - u) ** 3
    return np.asarray(reach * slope * by_slope + reach**2 * bend * by_bend)
