"""All trajectory shapes that can be played: what the file says -> a path laid out in the world.

References
----------
.. [1] L. Piegl, W. Tiller, "The NURBS Book", 2nd ed., 1997, eq. 4.1.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import hypot, inf, nan, pi
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import FormatError, PlaybackError, UnsupportedElementError
from xosc_lateral.base.lazy import interpolate
from xosc_lateral.world.player.paths.base import Path, PathPoint
from xosc_lateral.world.player.paths.polyline import Corner, PolylinePath, fill_times, has_gaps_in_time, merge_close
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.geometry import Spiral
from xosc_lateral.world.road.positions import Pose, wrap
from xosc_lateral.world.scenario import position as positions
from xosc_lateral.world.scenario.place import Place, Unsupported

# ---- NURBS curves: a polyline through a point per metre of their control polygon ----
SAMPLE_LENGTH = 1.0
"""Length of the control polygon per sample. [m]"""

MOST_SAMPLES = 20_000
"""Longer curves are sampled more coarsely. [-]"""

_TANGENT_STEP = 0.001
"""Step in the curve's parameter that its direction is taken over. [-]"""


class Control(Struct, frozen=True):
    """A control point: [m], [-], [s]; NaN in `time`: none."""

    x: float
    y: float
    weight: float = 1.0
    time: float = nan


class NurbsPath(Path):
    """A NURBS curve of an order (degree + 1), with as many knots as control points and order together."""

    def __init__(self, controls: Sequence[Control], knots: Sequence[float], order: int) -> None:
        self.controls = tuple(controls)
        self._knots, self._degree = np.asarray(knots, dtype=np.float64), order - 1
        weighed = np.array([(c.weight * c.x, c.weight * c.y, c.weight) for c in self.controls])
        self._curve = interpolate.BSpline(self._knots, weighed, self._degree)
        self._parameters, self._line = self._sample()
        super().__init__(self._line.lengths, self._line.times)

    def at(self, s: float) -> PathPoint:
        """The point of the curve itself at the parameter that belongs to a length."""
        i, u = self.piece(s)
        following = min(i + 1, len(self._parameters) - 1)
        parameter = self._parameters[i] + u * (self._parameters[following] - self._parameters[i])
        ((x, y),) = self.points(np.array([parameter])).tolist()
        heading = self._line.at(s).heading
        return PathPoint(x, y, nan, heading, nan, nan, heading)

    def points(self, parameters: FloatArray) -> FloatArray:
        """x and y at parameters of shape (n,), shape (n, 2). [m]"""
        curve = self._curve(self._inside(parameters))
        return np.asarray(curve[:, :2] / curve[:, 2:])

    def _inside(self, parameters: FloatArray) -> FloatArray:
        """Within the knots between which shares sum to 1 (an unclamped curve begins after its first knot)."""
        first, last = self._knots[self._degree], self._knots[len(self.controls)]
        return np.clip(parameters, first, max(first, last - EPSILON))

    def _sample(self) -> tuple[FloatArray, PolylinePath]:
        polygon = sum(hypot(b.x - a.x, b.y - a.y) for a, b in itertools.pairwise(self.controls))
        steps = min(int(1 + polygon / SAMPLE_LENGTH), MOST_SAMPLES)
        step = float(self._knots[-1]) / steps
        parameters = np.arange(steps + 1, dtype=np.float64) * step
        places = self.points(parameters)
        headings, times = self._headings(parameters, places, step), self._times(parameters, step)
        rows = zip(places.tolist(), headings, times, strict=True)
        corners = [Corner(x, y, heading=wrap(heading), time=time) for (x, y), heading, time in rows]
        return parameters, PolylinePath(corners, follow=True)

    def _headings(self, parameters: FloatArray, places: FloatArray, step: float) -> list[float]:
        """Directions towards a point just ahead, at the end from one just behind; a sample on where these coincide."""
        ahead = np.where(np.arange(len(parameters)) < len(parameters) - 1, 1.0, -1.0)
        way = ahead[:, None] * (self.points(parameters + ahead * min(_TANGENT_STEP, step)) - places)
        longer = ahead[:, None] * (self.points(parameters + ahead * step) - places)
        way = (
            np.where(np.hypot(way[:, :1], way[:, 1:]) < EPSILON, longer, way) + 0.0
        )  # no minus zero: it has a direction
        return [float(angle) for angle in np.arctan2(way[:, 1], way[:, 0])]

    def _times(self, parameters: FloatArray, step: float) -> list[float]:
        """Times of the samples: those of the control points where each weighs most, evenly in between."""
        delta = min(_TANGENT_STEP, step)
        beside = np.r_[parameters[:-1] + delta, parameters[-1] - delta]
        shares = interpolate.BSpline.design_matrix(self._inside(beside), self._knots, self._degree).tocsc()
        shares.data = shares.data.round(12)  # of two samples as good as each other the first
        peaks = parameters[np.asarray(shares.argmax(axis=0)).ravel()].tolist()
        times, k = [], 0
        for parameter in parameters.tolist():
            while k < len(peaks) - 2 and parameter >= peaks[k + 1]:
                k += 1
            span = peaks[k + 1] - peaks[k]
            share = (parameter - peaks[k]) / span if span > 0.0 else 1.0
            a, b = self.controls[k].time, self.controls[k + 1].time
            times.append(a + share * (b - a))
        return times


def clamped_knots(count: int, order: int) -> tuple[float, ...]:
    """Even knots from 0 to 1 that make the curve begin and end in its first and last control point."""
    inner = max(count + 1 - order, 1)
    return tuple(min(max((i + 1 - order) / inner, 0.0), 1.0) for i in range(count + order))


# ---- clothoids and clothoid splines: curvature changes evenly with length on each piece ----
@dataclass(frozen=True, slots=True)
class TimedClothoid:
    """One clothoid: where it starts [m], [rad], curvatures at both ends [1/m], length [m], start time [s]."""

    x: float
    y: float
    heading: float
    curvature: float
    end_curvature: float
    length: float
    start_time: float = nan
    _spiral: Spiral | None = field(init=False, repr=False, compare=False)
    """As on a road; None: no length."""

    def __post_init__(self) -> None:
        """Lay it out."""
        layout = (self.x, self.y, self.heading, self.length, self.curvature, self.end_curvature)
        object.__setattr__(self, "_spiral", Spiral.of(*layout) if self.length > 0.0 else None)

    def at(self, s: float) -> tuple[float, float, float]:
        """x, y, heading at a length. [m], [rad]"""
        x, y, heading = (self.x, self.y, self.heading) if self._spiral is None else self._spiral.at(s)
        return x, y, heading % (2.0 * pi)


class ClothoidPath(Path):
    """Clothoid pieces one after another. `pieces`: at least one; `end_time`: [s]; NaN without times."""

    def __init__(self, pieces: Sequence[TimedClothoid], end_time: float = nan) -> None:
        lengths = itertools.accumulate((piece.length for piece in pieces), initial=0.0)
        super().__init__(tuple(lengths), (*(piece.start_time for piece in pieces), end_time))
        self.pieces = tuple(pieces)
        self.spans = tuple(piece.length for piece in pieces)

    def at(self, s: float) -> PathPoint:
        """The point at a length; beyond the ends, the ends."""
        left = min(max(s, 0.0), self.length)
        for piece in self.pieces:
            if left <= piece.length or piece is self.pieces[-1]:
                x, y, heading = piece.at(min(left, piece.length))
                return PathPoint(x, y, nan, wrap(heading), nan, nan, wrap(heading))
            left -= piece.length
        raise AssertionError("a clothoid path has pieces")


# ---- from what the file says ----
MOST_TURNING = 1e4
"""Clothoids that turn by more are refused. [rad]"""

VERTEX_RADIUS = 0.1
"""Vertices of a polyline nearer than this count as one. [m]"""


class Layout(Struct, frozen=True):
    """What laying out a path depends on: who follows it, how, how fast [m/s], whether it goes on at its start."""

    simulation: Simulation
    locate: Callable[[Sequence[positions.Position], Simulation], list[Pose]]
    place: Place
    follower: EntityState | None
    follow: bool
    closes: bool

    def pose_of(self, position: positions.Position) -> Pose:
        """World pose of a position now. [m], [rad]"""
        return self.locate([position], self.simulation)[0]

    def note(self, what: str) -> None:
        """Say that the trajectory is not followed as written."""
        self.simulation.note(what, self.place)

    def error(self, what: str) -> FormatError:
        """That it can't be followed."""
        return self.place.error(what, PlaybackError)


def _polyline(shape: positions.Polyline, layout: Layout) -> Path:
    if not shape.vertices:
        raise layout.error("the polyline has no vertices")
    poses = layout.locate([vertex.position for vertex in shape.vertices], layout.simulation)
    corners = [_corner(vertex, pose) for vertex, pose in zip(shape.vertices, poses, strict=True)]
    _check_times([corner.time for corner in corners], "vertex", layout)
    if has_gaps_in_time(corners):
        layout.note("vertices without a time get it by their distance from those that have one")
        corners = fill_times(corners)
    first, last = corners[0], corners[-1]
    if layout.closes and hypot(last.x - first.x, last.y - first.y) > VERTEX_RADIUS:
        corners.append(replace(first, time=nan))
    merged = merge_close(corners, VERTEX_RADIUS)
    if len(merged) < len(corners):
        left_out = len(corners) - len(merged)
        layout.note(f"{left_out} vertices nearer than {VERTEX_RADIUS:g} m to the one before are left out")
    speed = 0.0 if layout.follower is None else layout.follower.speed
    return PolylinePath(merged, follow=layout.follow, initial_speed=speed)


def _corner(vertex: positions.Vertex, pose: Pose) -> Corner:
    """A vertex where it is now; its height counts where the file gives one, and then its pitch and roll do."""
    position = vertex.position
    orientation = position if isinstance(position, positions.WorldPosition) else getattr(position, "orientation", None)
    heading, pitch, roll = (
        nan if getattr(orientation, angle[0], None) is None else getattr(pose, angle)
        for angle in ("heading", "pitch", "roll")
    )  # absolute or relative, where one is written; else the path's own
    if not _gives_height(position):
        pitch, roll = nan, nan
    elif roll != roll:
        roll = pose.roll
    z, is_fixed = (pose.z if _gives_height(position) else nan), positions.reference_of(position) is None
    return Corner(pose.x, pose.y, z, heading, pitch, roll, _or_nan(vertex.time), pose.z, is_fixed)


def _clothoid(shape: positions.Clothoid, layout: Layout) -> Path:
    end = shape.curvature + shape.curvature_prime * shape.length
    where, when = shape.position, shape.start_time
    piece = positions.ClothoidSplineSegment(shape.curvature, end, shape.length, time_start=when, position_start=where)
    return _clothoid_spline(positions.ClothoidSpline((piece,), shape.stop_time), layout)


def _clothoid_spline(shape: positions.ClothoidSpline, layout: Layout) -> Path:
    if not shape.segments:
        raise layout.error("the clothoid spline has no segments")
    pieces: list[TimedClothoid] = []
    for segment in shape.segments:
        x, y, heading = _start_of(segment, pieces, layout)
        begin, end, length = segment.curvature_start, segment.curvature_end, segment.length
        # one that makes an entity spin is a mistake in the file (and would take for ever to integrate)
        if not (length >= 0.0 and max(abs(begin), abs(end)) * length <= MOST_TURNING):
            raise layout.error(
                f"a clothoid of {length:g} m with curvatures {begin:g} to {end:g} 1/m: needs a length of at least 0 m "
                f"and less than {MOST_TURNING:g} rad of turning"
            )
        pieces.append(TimedClothoid(x, y, heading, begin, end, length, _or_nan(segment.time_start)))
    return ClothoidPath(pieces, _or_nan(shape.time_end))


def _start_of(
    segment: positions.ClothoidSplineSegment, pieces: Sequence[TimedClothoid], layout: Layout
) -> tuple[float, float, float]:
    """Its own position, the end of the piece before, or where the follower is. [m], [m], [rad]"""
    if segment.position_start is not None:
        pose = layout.pose_of(segment.position_start)
        x, y, heading = pose.x, pose.y, pose.heading
    elif pieces:
        x, y, heading = pieces[-1].at(pieces[-1].length)
    elif layout.follower is not None:
        pose = layout.follower.plane
        x, y, heading = pose.x, pose.y, pose.heading
    else:
        raise layout.error("the clothoid spline has no start")
    return x, y, heading + segment.h_offset


def _check_times(times: Sequence[float], what: str, layout: Layout) -> None:
    """Times never run backwards."""
    last = -inf
    for k, time in enumerate(times):
        if time < last:
            raise layout.error(f"time {time:g} s of {what} {k + 1} is before that of an earlier one, {last:g} s")
        last = time if time == time else last


def _nurbs(shape: positions.Nurbs, layout: Layout) -> Path:
    count = len(shape.control_points)
    knots = shape.knots or clamped_knots(count, shape.order)
    if count < max(shape.order, 2) or len(knots) != count + shape.order:
        raise layout.error(
            f"a NURBS curve of order {shape.order} with {count} control points and {len(shape.knots)} knots: "
            "needs at least as many control points as its order, and knots = control points + order"
        )
    controls = []
    for point in shape.control_points:
        pose = layout.pose_of(point.position)
        controls.append(Control(pose.x, pose.y, point.weight, _or_nan(point.time)))
    _check_times([control.time for control in controls], "control point", layout)
    return NurbsPath(controls, knots, shape.order)


SHAPES: dict[type, Callable[[Any, Layout], Path]] = {
    positions.Clothoid: _clothoid,
    positions.ClothoidSpline: _clothoid_spline,
    positions.Nurbs: _nurbs,
    positions.Polyline: _polyline,
}


def path_of(
    trajectory: positions.Trajectory,
    simulation: Simulation,
    poses_of: Callable[[Sequence[positions.Position], Simulation], list[Pose]],
    *,
    follower: EntityState | None = None,
    follow: bool = False,
    is_timed: bool = False,
) -> Path:
    """A trajectory laid out in the world as it is now; `poses_of` tells where positions are.

    A closed one ends where it starts, unless it is followed by its times (`is_timed`), which say nothing of that piece.
    """
    shape = trajectory.shape
    if isinstance(shape, Unsupported):
        raise shape.place.error(shape.reason or f"a {shape.kind} can't be followed", UnsupportedElementError)
    closes = trajectory.closed and not is_timed
    layout = Layout(simulation, poses_of, trajectory.place, follower, follow, closes)
    path = SHAPES[type(shape)](shape, layout)
    start, end = path.at(0.0), path.at(path.length)
    if closes and (gap := hypot(end.x - start.x, end.y - start.y)) > VERTEX_RADIUS:
        layout.note(f"trajectory '{trajectory.name}' is closed, but ends {gap:.2f} m from its start: it ends there")
    return path


def duration(shape: positions.Shape) -> float:
    """Time from the first to the last time stamp; 0 where there are none. [s]"""
    times: list[float | None] = []
    if isinstance(shape, positions.Polyline):
        times = [vertex.time for vertex in shape.vertices]
    elif isinstance(shape, positions.Clothoid):
        times = [shape.start_time, shape.stop_time]
    elif isinstance(shape, positions.ClothoidSpline):
        times = [*(segment.time_start for segment in shape.segments), shape.time_end]
    elif isinstance(shape, positions.Nurbs) and all(point.time is not None for point in shape.control_points):
        times = [point.time for point in shape.control_points]
    start, end = (times[0], times[-1]) if times else (None, None)
    return 0.0 if start is None or end is None else end - start


def _gives_height(position: positions.Position) -> bool:
    if isinstance(position, positions.WorldPosition):
        return position.z is not None
    return getattr(position, "dz", None) is not None


def _or_nan(value: float | None) -> float:
    return nan if value is None else value
