"""One entity on its way: its path cut into pieces, and each of them as a trajectory that starts at its time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from lxml import etree
from msgspec import structs
from numpy.typing import NDArray

from xosc_lateral.formats.openscenario.write import build
from xosc_lateral.formats.openscenario.write.non_motion_actions import Pose
from xosc_lateral.formats.openscenario.write.path_pieces import (
    LEAST_SPACING,
    VERTEX_SPACING,
    PathPiece,
    cut_path,
    vertex_times,
)
from xosc_lateral.formats.openscenario.write.vertices import TimedVertices, Vertices
from xosc_lateral.motion.nominal import Activity, EntityMotion, NominalMotion
from xosc_lateral.motion.trajectory import WorldTrajectory
from xosc_lateral.scenario.enums import Priority

FloatArray = NDArray[np.float64]

MOTION_SINCE = (1, 4)
"""Version from which a vertex may say how fast the entity is there."""


CATCH_UP = 20.0
"""Over so many times as long as a heading is late it catches up before a path is over: 5 % faster than it turns. [-]"""


class Moving:
    """An entity with its path cut into pieces."""

    def __init__(self, entity: EntityMotion, path: WorldTrajectory, motion: NominalMotion) -> None:
        self.name, self.end = entity.name, motion.end_time
        active = (entity.activity & Activity.ACTIVE) != 0
        teleported = (entity.activity & Activity.TELEPORTED) != 0
        _check(entity, path, active)
        self.active_at_start = bool(active[0])
        pieces = cut_path(path.time, path.x, path.y, active, teleported)
        self.path, self.pieces = _stopping_in_time(path, pieces)

    @property
    def start(self) -> tuple[Pose, float] | None:
        """Pose and speed at time 0; None for an entity that is not there yet. A car that stands does so by speed 0."""
        if not self.active_at_start:
            return None
        drives = bool(self.pieces) and self.pieces[0].first == 0
        return self.pose(0), float(self.path.speed[0]) if drives else 0.0

    def pose(self, row: int) -> Pose:
        """Pose in one row."""
        path = self.path
        arrays = (path.x, path.y, path.z, _wrapped(path.heading), path.pitch, path.roll)
        x, y, z, h, p, r = (float(values[row]) for values in arrays)
        return x, y, z, h, p, r

    def pose_after(self, moment: float) -> Pose:
        """Pose in the row that the step beginning at `moment` leads to."""
        row = int(np.searchsorted(self.path.time, moment + 1e-9, side="right"))
        return self.pose(min(row, len(self.path.time) - 1))

    def poses_at(self, moments: FloatArray, rows: slice) -> list[FloatArray]:
        """x, y, z [m], heading, pitch, roll [rad] at any times, held before and after some rows of the path."""
        path = self.path
        arrays = (path.x[rows], path.y[rows], path.z[rows], np.unwrap(path.heading[rows]), path.pitch[rows])
        return [np.interp(moments, path.time[rows], values) for values in (*arrays, path.roll[rows])]

    def trigger_time(self, piece: PathPiece) -> float:
        """When a piece has to begin: being placed anew happens in the step before its first row."""
        return float(self.path.time[piece.first - 1 if piece.placed else piece.first])


def _stopping_in_time(path: WorldTrajectory, pieces: Sequence[PathPiece]) -> tuple[WorldTrajectory, list[PathPiece]]:
    """Sudden stops whose last step is too short for a vertex of its own: it would slow the one before.

    A car that runs at 20 m/s into the end of its road covers the last of it in a part of a step. It is there a step
    earlier, or the step begins farther back: what moves it less.
    """
    sudden = {piece for piece in pieces if piece.last - piece.first >= 2 and _is_sudden(path, piece)}
    early = {piece for piece in sudden if _way(path, piece.last) < 0.5 * VERTEX_SPACING}
    if not sudden:
        return path, list(pieces)
    rows = np.arange(len(path.time))
    rows[[piece.last - 1 for piece in early]] += 1
    arrays = {name: getattr(path, name)[rows] for name in ("x", "y", "z", "heading", "pitch", "roll")}
    for last in (piece.last for piece in sudden - early):
        share = (VERTEX_SPACING - _way(path, last)) / _way(path, last - 1)
        for name in ("x", "y", "z"):
            arrays[name][last - 1] += share * (arrays[name][last - 2] - arrays[name][last - 1])
    ends = [structs.replace(piece, last=piece.last - 1, stops=True) if piece in early else piece for piece in pieces]
    return replace(path, **arrays), ends


def _is_sudden(path: WorldTrajectory, piece: PathPiece) -> bool:
    final, before = _way(path, piece.last), _way(path, piece.last - 1)
    stops = piece.stops or (piece.last == len(path.time) - 1 and final < 0.5 * before)
    return stops and final < LEAST_SPACING < before


def _way(path: WorldTrajectory, row: int) -> float:
    """Of the step to a row. [m]"""
    return float(np.hypot(path.x[row] - path.x[row - 1], path.y[row] - path.y[row - 1]))


def _check(entity: EntityMotion, path: WorldTrajectory, active: NDArray[np.bool_]) -> None:
    arrays = (path.time, path.x, path.y, path.z, path.heading, path.pitch, path.roll)
    if any(len(values) != len(entity.time) for values in arrays):
        raise ValueError(f"trajectory of '{entity.name}' does not have the {len(entity.time)} rows of its motion")
    if any(not np.isfinite(values[active]).all() for values in arrays):
        raise ValueError(f"trajectory of '{entity.name}' is not finite")


def add_trajectories(maneuver: etree._Element, item: Moving, version: build.Version, vertices: Vertices) -> None:
    """Add an event for every piece of an entity, and one for every stop."""
    for number, piece in enumerate(item.pieces, start=1):
        rows = slice(piece.first, piece.last + 1)
        times = vertex_times(item.path.time[rows], item.path.x[rows], item.path.y[rows])
        name = f"{item.name} trajectory {number}"
        event = build.event(maneuver, name, Priority.OVERRIDE, version)
        if len(times) < 2:
            _add_hop(event, name, item, piece, version)
            continue
        if piece.placed:
            place = build.private_action(event, f"{name} place")
            build.world_position(build.sub(place, "TeleportAction"), item.pose(piece.first))
        _add_trajectory(build.private_action(event, name), name, item.path, piece, times, version, vertices)
        build.time_trigger(event, "StartTrigger", item.trigger_time(piece), version)
        if piece.stops:
            _add_stand(maneuver, item, piece, number, version)


def _add_stand(maneuver: etree._Element, item: Moving, piece: PathPiece, number: int, version: build.Version) -> None:
    """An event that stops it where a piece ends."""
    name = f"{item.name} stand {number}"
    stand = build.event(maneuver, name, Priority.OVERRIDE, version)
    build.speed_step(build.private_action(stand, name), 0.0)
    build.time_trigger(stand, "StartTrigger", float(item.path.time[piece.last]), version)


def _add_hop(event: etree._Element, name: str, item: Moving, piece: PathPiece, version: build.Version) -> None:
    """A piece too short for two vertices: the entity is put where it ends."""
    place = build.private_action(event, f"{name} place")
    build.world_position(build.sub(place, "TeleportAction"), item.pose(piece.last))
    speed = 0.0 if piece.stops else float(item.path.speed[piece.last])
    build.speed_step(build.private_action(event, f"{name} speed"), speed)
    start = item.trigger_time(piece) if piece.placed else float(item.path.time[piece.last])
    build.time_trigger(event, "StartTrigger", start, version)


def _add_trajectory(
    owner: etree._Element,
    name: str,
    path: WorldTrajectory,
    piece: PathPiece,
    times: FloatArray,
    version: build.Version,
    vertices: Vertices,
) -> None:
    rows = slice(piece.first, piece.last + 1)
    time = path.time[rows]
    arrays = (path.x, path.y, path.z, np.unwrap(path.heading[rows]), path.pitch, path.roll)
    columns = [np.interp(times, time, values if len(values) == len(time) else values[rows]) for values in arrays]
    columns[3] = np.interp(_heading_times(times), time, np.unwrap(path.heading[rows]))
    speed = path.speed[rows]
    motion = None
    if version >= MOTION_SINCE:
        motion = [np.interp(times, time, values) for values in (speed, np.gradient(speed, time))]
    add_vertices(owner, name, vertices, version, times, columns, motion)


def _heading_times(times: FloatArray) -> FloatArray:
    """When the entity has the headings that the vertices get. [s]

    The reference player has a vertex's heading in the middle of the gap after it: half a gap late. Where gaps are
    shorter than most it would catch up with the path, and turn sharply: so it is kept as late there. Towards the end it
    catches up slowly, for there the path is over at once.
    """
    gaps = np.diff(times)
    usual = 0.5 * float(np.median(gaps))
    middle = times + np.minimum(0.5 * np.append(gaps, 0.0), usual)
    late = usual * np.minimum((times[-1] - middle) / (CATCH_UP * usual), 1.0)
    return np.asarray(np.minimum(middle - late, times[-1]))


def add_vertices(
    owner: etree._Element,
    name: str,
    vertices: Vertices,
    version: build.Version,
    times: FloatArray,
    columns: Sequence[FloatArray],
    motion: Sequence[FloatArray] | None = None,
) -> None:
    """Add a FollowTrajectoryAction along a polyline.

    Parameters
    ----------
    owner : element
        A PrivateAction.
    name : str
        Of the trajectory.
    vertices : Vertices
        Of the document: takes those of this trajectory.
    version : Version
    times : array, shape (n,)
        Of its vertices. [s]
    columns : six arrays, shape (n,)
        x, y, z [m], heading, pitch, roll [rad].
    motion : two arrays, shape (n,), optional
        Speed [m/s] and acceleration [m/s2] along the path; from version 1.4 on.
    """
    follow = build.sub(build.sub(owner, "RoutingAction"), "FollowTrajectoryAction")
    holder = follow if version < (1, 1) else build.sub(follow, "TrajectoryRef")
    trajectory = build.sub(holder, "Trajectory", name=name, closed="false")
    x, y, z, h, p, r = columns
    polyline = build.sub(build.sub(trajectory, "Shape"), "Polyline")
    vertices.add(polyline, TimedVertices(times, (x, y, z, _wrapped(h), p, r), motion))
    timing = build.sub(follow, "TimeReference")
    build.sub(timing, "Timing", domainAbsoluteRelative="absolute", scale="1", offset="0")
    build.sub(follow, "TrajectoryFollowingMode", followingMode="position")


def _wrapped(angle: FloatArray) -> FloatArray:
    """Into (-pi, pi]."""
    return np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
