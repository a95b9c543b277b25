"""All trajectory shapes that can be played: what the file says -> a path laid out in the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, nan
from typing import Any

from msgspec import Struct

from xosc_lateral.errors import PlaybackError, UnsupportedElementError
from xosc_lateral.playback.paths.base import Path
from xosc_lateral.playback.paths.clothoid import ClothoidPath, TimedClothoid
from xosc_lateral.playback.paths.nurbs import Control, NurbsPath, clamped_knots
from xosc_lateral.playback.paths.polyline import Corner, PolylinePath, fill_times, has_gaps_in_time, merge_close
from xosc_lateral.playback.positions.on_road import reference_of
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.road import Pose
from xosc_lateral.scenario import Place, Unsupported
from xosc_lateral.scenario.position import (
    Clothoid,
    ClothoidSpline,
    ClothoidSplineSegment,
    Nurbs,
    Polyline,
    Position,
    Shape,
    Trajectory,
    Vertex,
    WorldPosition,
)

MOST_TURNING = 1e4
"""Clothoids that turn by more are refused. [rad]"""

VERTEX_RADIUS = 0.1
"""Vertices of a polyline nearer than this count as one. [m]"""


class Layout(Struct, frozen=True):
    """What laying out a path may depend on, besides the world: who follows it, how, and how fast it comes. [m/s]"""

    simulation: Simulation
    pose_of: Callable[[Position, Simulation], Pose]
    place: Place
    follower: EntityState | None
    follow: bool
    speed: float


def _polyline(shape: Polyline, layout: Layout) -> Path:
    if not shape.vertices:
        raise _error("the polyline has no vertices", layout.place)
    corners = [_corner(vertex, layout) for vertex in shape.vertices]
    _check_times([corner.time for corner in corners], "vertex", layout.place)
    if has_gaps_in_time(corners):
        layout.simulation.note(
            "vertices without a time get it by their distance from those that have one", layout.place
        )
        corners = fill_times(corners)
    merged = merge_close(corners, VERTEX_RADIUS)
    if len(merged) < len(corners):
        left_out = len(corners) - len(merged)
        layout.simulation.note(
            f"{left_out} vertices nearer than {VERTEX_RADIUS:g} m to the one before are left out", layout.place
        )
    return PolylinePath(merged, follow=layout.follow, initial_speed=layout.speed)


def _corner(vertex: Vertex, layout: Layout) -> Corner:
    """A vertex where it is now; its height counts where the file gives one, and then its pitch and roll do."""
    position = vertex.position
    pose = layout.pose_of(position, layout.simulation)
    heading, pitch, roll = (
        own if given is not None else nan
        for own, given in zip((pose.heading, pose.pitch, pose.roll), _given_angles(position), strict=True)
    )
    if not _gives_height(position):
        pitch, roll = nan, nan
    elif roll != roll:
        roll = pose.roll
    z, time = (pose.z if _gives_height(position) else nan), (nan if vertex.time is None else vertex.time)
    return Corner(pose.x, pose.y, z, heading, pitch, roll, time, pose.z, reference_of(position) is None)


def _clothoid(shape: Clothoid, layout: Layout) -> Path:
    pose = layout.pose_of(shape.position, layout.simulation)
    end = shape.curvature + shape.curvature_prime * shape.length
    start_time = nan if shape.start_time is None else shape.start_time
    _check_turning(shape.curvature, end, shape.length, layout.place)
    piece = TimedClothoid(pose.x, pose.y, pose.heading, shape.curvature, end, shape.length, start_time)
    return ClothoidPath([piece], nan if shape.stop_time is None else shape.stop_time)


def _clothoid_spline(shape: ClothoidSpline, layout: Layout) -> Path:
    if not shape.segments:
        raise _error("the clothoid spline has no segments", layout.place)
    pieces: list[TimedClothoid] = []
    for segment in shape.segments:
        x, y, heading = _start_of(segment, pieces, layout)
        time = nan if segment.time_start is None else segment.time_start
        _check_turning(segment.curvature_start, segment.curvature_end, segment.length, layout.place)
        pieces.append(
            TimedClothoid(x, y, heading, segment.curvature_start, segment.curvature_end, segment.length, time)
        )
    return ClothoidPath(pieces, nan if shape.time_end is None else shape.time_end)


def _start_of(
    segment: ClothoidSplineSegment, pieces: Sequence[TimedClothoid], layout: Layout
) -> tuple[float, float, float]:
    """Its own position, the end of the piece before, or where the follower is. [m], [m], [rad]"""
    if segment.position_start is not None:
        pose = layout.pose_of(segment.position_start, layout.simulation)
        x, y, heading = pose.x, pose.y, pose.heading
    elif pieces:
        x, y, heading = pieces[-1].at(pieces[-1].length)
    elif layout.follower is not None:
        pose = layout.follower.plane
        x, y, heading = pose.x, pose.y, pose.heading
    else:
        raise _error("the clothoid spline has no start", layout.place)
    return x, y, heading + segment.h_offset


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
        pose = layout.pose_of(point.position, layout.simulation)
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
    simulation: Simulation,
    pose_of: Callable[[Position, Simulation], Pose],
    *,
    follower: EntityState | None = None,
    follow: bool = False,
    speed: float = 0.0,
) -> Path:
    """A trajectory laid out in the world as it is now; `pose_of` tells where a position is."""
    shape = trajectory.shape
    if isinstance(shape, Unsupported):
        place = shape.place
        raise UnsupportedElementError(
            shape.reason or f"a {shape.kind} can't be followed", path=place.path, line=place.line, element=place.element
        )
    return _SHAPES[type(shape)](shape, Layout(simulation, pose_of, trajectory.place, follower, follow, speed))


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


def _given_angles(position: Position) -> tuple[float | None, float | None, float | None]:
    """Heading, pitch and roll as written, absolute or relative; None: the path's own."""
    given = position if isinstance(position, WorldPosition) else getattr(position, "orientation", None)
    return (None, None, None) if given is None else (given.h, given.p, given.r)


def _gives_height(position: Position) -> bool:
    if isinstance(position, WorldPosition):
        return position.z is not None
    return getattr(position, "dz", None) is not None


def _error(what: str, place: Place) -> PlaybackError:
    return PlaybackError(what, path=place.path, line=place.line, element=place.element)
