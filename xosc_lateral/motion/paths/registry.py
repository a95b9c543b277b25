"""All trajectory shapes that can be played: what the file says -> a path laid out in the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf, nan
from typing import Any

from xosc_lateral.errors import PlaybackError, UnsupportedElementError
from xosc_lateral.motion.paths.base import Path
from xosc_lateral.motion.paths.clothoid import ClothoidPath, ClothoidPiece
from xosc_lateral.motion.paths.nurbs import Control, NurbsPath, clamped_knots
from xosc_lateral.motion.paths.polyline import Corner, PolylinePath, fill_times, has_gaps_in_time, merge_close
from xosc_lateral.motion.run import Run
from xosc_lateral.motion.state import EntityState
from xosc_lateral.road.positions import Pose
from xosc_lateral.scenario import Place, Unsupported
from xosc_lateral.scenario.position import Position, WorldPosition
from xosc_lateral.scenario.trajectory import Clothoid, ClothoidSpline, Nurbs, Polyline, Shape, Trajectory

MOST_TURNING = 1e4
"""Clothoids that turn by more are refused. [rad]"""

VERTEX_RADIUS = 0.1
"""Vertices of a polyline nearer than this count as one. [m]"""


@dataclass(frozen=True, slots=True)
class Layout:
    """What laying out a path may depend on, besides the world: who follows it, how, and how fast it comes. [m/s]"""

    run: Run
    place: Place
    follower: EntityState | None
    follow: bool
    speed: float


def _polyline(shape: Polyline, layout: Layout) -> Path:
    if not shape.vertices:
        raise _error("the polyline has no vertices", layout.place)
    corners = []
    for vertex in shape.vertices:
        pose = _pose(vertex.position, layout.run)
        headed = _gives_heading(vertex.position)
        on_road = not _gives_height(vertex.position)
        z, pitch, roll = (nan, nan, nan) if on_road else (pose.z, pose.pitch, pose.roll)
        time = nan if vertex.time is None else vertex.time
        corners.append(Corner(pose.x, pose.y, z, pose.heading if headed else nan, pitch, roll, time))
    _check_times([corner.time for corner in corners], "vertex", layout.place)
    if any(corner.z != corner.z for corner in corners):
        corners = [Corner(c.x, c.y, nan, c.heading, nan, nan, c.time) for c in corners]
    if has_gaps_in_time(corners):
        layout.run.note("vertices without a time get it by their distance from those that have one", layout.place)
        corners = fill_times(corners)
    merged = merge_close(corners, VERTEX_RADIUS)
    if len(merged) < len(corners):
        left_out = len(corners) - len(merged)
        layout.run.note(
            f"{left_out} vertices nearer than {VERTEX_RADIUS:g} m to the one before are left out", layout.place
        )
    return PolylinePath(merged, follow=layout.follow, initial_speed=layout.speed)


def _clothoid(shape: Clothoid, layout: Layout) -> Path:
    pose = _pose(shape.position, layout.run)
    end = shape.curvature + shape.curvature_prime * shape.length
    start_time = nan if shape.start_time is None else shape.start_time
    _check_turning(shape.curvature, end, shape.length, layout.place)
    piece = ClothoidPiece(pose.x, pose.y, pose.heading, shape.curvature, end, shape.length, start_time)
    return ClothoidPath([piece], nan if shape.stop_time is None else shape.stop_time)


def _clothoid_spline(shape: ClothoidSpline, layout: Layout) -> Path:
    if not shape.segments:
        raise _error("the clothoid spline has no segments", layout.place)
    pieces: list[ClothoidPiece] = []
    for segment in shape.segments:
        if segment.position_start is not None:
            pose = _pose(segment.position_start, layout.run)
            x, y, heading = pose.x, pose.y, pose.heading
        elif pieces:
            x, y, heading = pieces[-1].at(pieces[-1].length)
        elif layout.follower is not None:
            pose = layout.follower.plane
            x, y, heading = pose.x, pose.y, pose.heading
        else:
            raise _error("the clothoid spline has no start", layout.place)
        time = nan if segment.time_start is None else segment.time_start
        heading += segment.h_offset
        _check_turning(segment.curvature_start, segment.curvature_end, segment.length, layout.place)
        pieces.append(
            ClothoidPiece(x, y, heading, segment.curvature_start, segment.curvature_end, segment.length, time)
        )
    return ClothoidPath(pieces, nan if shape.time_end is None else shape.time_end)


def _check_turning(start: float, end: float, length: float, place: Place) -> None:
    """A curvature that makes an entity spin is a mistake in the file (and would take for ever to integrate)."""
    if not (length >= 0.0 and max(abs(start), abs(end)) * length <= MOST_TURNING):
        raise _error(
            f"a clothoid of {length:g} m with curvatures {start:g} to {end:g} 1/m: needs a length of at least 0 m and "
            f"less than {MOST_TURNING:g} rad of turning",
            place,
        )


def _check_times(times: Sequence[float], what: str, place: Place) -> None:
    """Times never run backwards."""
    last = -inf
    for k, time in enumerate(times):
        if time < last:
            raise _error(f"time {time:g} s of {what} {k + 1} is before that of an earlier one, {last:g} s", place)
        last = time if time == time else last


def _nurbs(shape: Nurbs, layout: Layout) -> Path:
    count = len(shape.control_points)
    knots = shape.knots or clamped_knots(count, shape.order)
    if count < max(shape.order, 2) or len(knots) != count + shape.order:
        raise _error(
            f"a NURBS curve of order {shape.order} with {count} control points and {len(shape.knots)} knots: "
            "needs at least as many control points as its order, and knots = control points + order",
            layout.place,
        )
    controls = []
    for point in shape.control_points:
        pose = _pose(point.position, layout.run)
        controls.append(Control(pose.x, pose.y, point.weight, nan if point.time is None else point.time))
    _check_times([control.time for control in controls], "control point", layout.place)
    return NurbsPath(controls, knots, shape.order)


SHAPES: tuple[tuple[type, Callable[[Any, Layout], Path]], ...] = (
    (Clothoid, _clothoid),
    (ClothoidSpline, _clothoid_spline),
    (Nurbs, _nurbs),
    (Polyline, _polyline),
)

_SHAPES = dict(SHAPES)


def path_of(
    trajectory: Trajectory,
    run: Run,
    *,
    follower: EntityState | None = None,
    follow: bool = False,
    speed: float = 0.0,
) -> Path:
    """A trajectory laid out in the world as it is now."""
    shape = trajectory.shape
    if isinstance(shape, Unsupported):
        place = shape.place
        raise UnsupportedElementError(
            shape.reason or f"a {shape.kind} can't be followed", path=place.path, line=place.line, element=place.element
        )
    return _SHAPES[type(shape)](shape, Layout(run, trajectory.place, follower, follow, speed))


def duration(shape: Shape) -> float:
    """Time from the first to the last time stamp; 0 where there are none. [s]"""
    if isinstance(shape, Polyline):
        ends = (shape.vertices[0].time, shape.vertices[-1].time) if shape.vertices else (None, None)
    elif isinstance(shape, Clothoid):
        ends = (shape.start_time, shape.stop_time)
    elif isinstance(shape, ClothoidSpline):
        ends = (shape.segments[0].time_start if shape.segments else None, shape.time_end)
    elif isinstance(shape, Nurbs):
        times = [point.time for point in shape.control_points]
        ends = (times[0], times[-1]) if times and None not in times else (None, None)
    else:
        return 0.0
    start, end = ends
    return 0.0 if start is None or end is None else end - start


def _pose(position: Position, run: Run) -> Pose:
    from xosc_lateral.motion.positions.resolve import resolve

    scout = EntityState(run.entities[0].entity, run.network)
    scout.put(resolve(position, run))
    return scout.plane


def _gives_heading(position: Position) -> bool:
    """Absolute or relative to road or entity: a heading that is written counts; else the path's own does."""
    if isinstance(position, WorldPosition):
        return position.h is not None
    orientation = getattr(position, "orientation", None)
    return orientation is not None and orientation.h is not None


def _gives_height(position: Position) -> bool:
    return isinstance(position, WorldPosition) and position.z is not None


def _error(what: str, place: Place) -> PlaybackError:
    return PlaybackError(what, path=place.path, line=place.line, element=place.element)
