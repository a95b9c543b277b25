"""All trajectory shapes that can be played: what the file says -> a path laid out in the world."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import hypot, inf, nan
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from xosc_lateral.base.errors import FormatError, PlaybackError, UnsupportedElementError
from xosc_lateral.world.player.paths.base import Path
from xosc_lateral.world.player.paths.curves import ClothoidPath, Control, NurbsPath, TimedClothoid, clamped_knots
from xosc_lateral.world.player.paths.polyline import Corner, PolylinePath, fill_times, has_gaps_in_time, merge_close
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.road.positions import Pose
from xosc_lateral.world.scenario import position as positions
from xosc_lateral.world.scenario.place import Place, Unsupported

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
