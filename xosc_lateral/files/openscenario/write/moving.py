"""One entity on its way: its path cut into pieces, and each of them as a trajectory that starts at its time."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from lxml import etree
from msgspec import structs

from xosc_lateral.base.arrays import FloatArray, blocks, columns
from xosc_lateral.base.track import Track
from xosc_lateral.files.openscenario.write import build
from xosc_lateral.files.openscenario.write.build import ColumnsOf, Pose, TimedVertices
from xosc_lateral.files.openscenario.write.draft import Draft
from xosc_lateral.world.motion.nominal import POSE, Activity, EntityMotion, NominalMotion
from xosc_lateral.world.motion.path_pieces import (
    LEAST_SPACING,
    VERTEX_SPACING,
    RowStretch,
    cut_path,
    vertex_times,
)
from xosc_lateral.world.scenario.enums import Priority

MOTION_SINCE = (1, 4)
"""Version from which a vertex may say how fast the entity is there."""

CATCH_UP_RATIO = 20.0
"""Over so many times as long as a heading is late it catches up before a path is over: 5 % faster than it turns. [-]"""


class Moving:
    """An entity with its path cut into pieces."""

    def __init__(self, entity: EntityMotion, path: Track, motion: NominalMotion) -> None:
        self.name, self.end = entity.name, motion.end_time
        _check(entity, path)
        self.active_at_start = bool(entity.activity[0] & Activity.ACTIVE)
        self.path, self.pieces = _stopping_in_time(path, cut_path(path.time, path.x, path.y, entity.activity))

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
        heading = wrapped(path.heading[row])
        x, y, z, h, p, r = map(float, (path.x[row], path.y[row], path.z[row], heading, path.pitch[row], path.roll[row]))
        return x, y, z, h, p, r

    def pose_after(self, moment: float) -> Pose:
        """Pose in the row that the step beginning at `moment` leads to."""
        row = int(np.searchsorted(self.path.time, moment + 1e-9, side="right"))
        return self.pose(min(row, len(self.path.time) - 1))

    def poses_at(self, moments: FloatArray, rows: slice) -> list[FloatArray]:
        """x, y, z [m], heading, pitch, roll [rad] at any times, held before and after some rows of the path."""
        path = self.path
        arrays = (path.x[rows], path.y[rows], path.z[rows], _unwrapped(path.heading[rows]), path.pitch[rows])
        return [np.interp(moments, path.time[rows], values) for values in (*arrays, path.roll[rows])]

    def trigger_time(self, piece: RowStretch) -> float:
        """When a piece has to begin: being placed anew happens in the step before its first row."""
        return float(self.path.time[piece.first - 1 if piece.placed else piece.first])


def moving_entities(draft: Draft, trajectories: Mapping[str, Track]) -> dict[str, Moving]:
    """Entities that follow trajectories, in the order of the run; mirrored where the scenario is left-handed."""
    paths = {}
    for entity in draft.motion.entities:
        if entity.name in trajectories:
            path = trajectories[entity.name]
            path = _mirrored(path) if draft.scenario.header.is_left_handed else path
            paths[entity.name] = Moving(entity, path, draft.motion)
    return paths


def _mirrored(path: Track) -> Track:
    """In the left-handed coordinates of a scenario written for CARLA."""
    n, turned = len(path.time), (path.y, path.heading, path.pitch)
    y, heading, pitch = columns(n, ([-values[rows] for values in turned] for rows in blocks(n)))
    return path.having(y=y, heading=heading, pitch=pitch)


def _stopping_in_time(path: Track, pieces: Sequence[RowStretch]) -> tuple[Track, list[RowStretch]]:
    """Sudden stops whose last step is too short for a vertex of its own: it would slow the one before.

    A car that runs at 20 m/s into the end of its road covers the last of it in a part of a step. It is there a step
    earlier, or the step begins farther back: what moves it less.
    """
    sudden = {piece for piece in pieces if piece.last - piece.first >= 2 and _is_sudden(path, piece)}
    early = {piece for piece in sudden if _way(path, piece.last) < 0.5 * VERTEX_SPACING}
    if not sudden:
        return path, list(pieces)
    names, n = ("x", "y", "z", "heading", "pitch", "roll"), len(path.time)
    arrays = dict(
        zip(names, columns(n, ([path.columns[name][r].copy() for name in names] for r in blocks(n))), strict=True)
    )
    for row in (piece.last - 1 for piece in early):
        for name in names:
            if arrays[name].flags.writeable:  # else all are the same
                arrays[name][row] = path.columns[name][row + 1]
    for last in (piece.last for piece in sudden - early):
        share = (VERTEX_SPACING - _way(path, last)) / _way(path, last - 1)
        for name in ("x", "y", "z"):
            if arrays[name].flags.writeable:
                arrays[name][last - 1] += share * (arrays[name][last - 2] - arrays[name][last - 1])
    ends = [structs.replace(piece, last=piece.last - 1, stops=True) if piece in early else piece for piece in pieces]
    return path.having(**arrays), ends


def _is_sudden(path: Track, piece: RowStretch) -> bool:
    final, before = _way(path, piece.last), _way(path, piece.last - 1)
    stops = piece.stops or (piece.last == len(path.time) - 1 and final < 0.5 * before)
    return stops and final < LEAST_SPACING < before


def _way(path: Track, row: int) -> float:
    """Of the step to a row. [m]"""
    return float(np.hypot(path.x[row] - path.x[row - 1], path.y[row] - path.y[row - 1]))


def _check(entity: EntityMotion, path: Track) -> None:
    arrays = [path.columns[name] for name in POSE]
    if len(path) != len(entity):
        raise ValueError(f"trajectory of '{entity.name}' does not have the {len(entity.time)} rows of its motion")
    for rows in blocks(len(entity.time)):
        away = (entity.activity[rows] & Activity.ACTIVE) == 0
        if any(not (np.isfinite(values[rows]) | away).all() for values in arrays):
            raise ValueError(f"trajectory of '{entity.name}' is not finite")


def add_trajectories(act: etree._Element, name: str, item: Moving, draft: Draft) -> None:
    """Add a maneuver of that name with an event for every piece of an entity, and one for every stop."""
    maneuver = build.maneuver(act, name, item.name)
    for number, piece in enumerate(item.pieces, start=1):
        rows = slice(piece.first, piece.last + 1)
        times = vertex_times(item.path.time[rows], item.path.x[rows], item.path.y[rows])
        name = f"{item.name} trajectory {number}"
        event = build.event(maneuver, name, Priority.OVERRIDE, draft.version)
        if len(times) < 2:
            _add_hop(event, name, item, piece, draft)
            continue
        if piece.placed:
            place = build.private_action(event, f"{name} place")
            build.world_position(build.sub(place, "TeleportAction"), item.pose(piece.first))
        vertices = TimedVertices(len(times), _columns_of(item.path, rows, times, draft.version))
        add_vertices(build.private_action(event, name), name, draft, vertices)
        build.time_trigger(event, "StartTrigger", item.trigger_time(piece), draft.version)
        if piece.stops:
            name = f"{item.name} stand {number}"
            stand = build.event(maneuver, name, Priority.OVERRIDE, draft.version)
            build.speed_step(build.private_action(stand, name), 0.0)
            build.time_trigger(stand, "StartTrigger", float(item.path.time[piece.last]), draft.version)


def _add_hop(event: etree._Element, name: str, item: Moving, piece: RowStretch, draft: Draft) -> None:
    """A piece too short for two vertices: the entity is put where it ends."""
    place = build.private_action(event, f"{name} place")
    build.world_position(build.sub(place, "TeleportAction"), item.pose(piece.last))
    speed = 0.0 if piece.stops else float(item.path.speed[piece.last])
    build.speed_step(build.private_action(event, f"{name} speed"), speed)
    start = item.trigger_time(piece) if piece.placed else float(item.path.time[piece.last])
    build.time_trigger(event, "StartTrigger", start, draft.version)


def _columns_of(path: Track, rows: slice, times: FloatArray, version: build.Version) -> ColumnsOf:
    """Columns of the vertices at some times, which have the headings of a little later."""
    time, speed, heading = path.time[rows], path.speed[rows], _unwrapped(path.heading[rows])
    arrays = [values[rows] for values in (path.x, path.y, path.z, path.pitch, path.roll)]
    later = _heading_times(times)

    def columns_of(part: slice) -> list[FloatArray]:
        around = _around(time, times[part])
        x, y, z, p, r = (np.interp(times[part], time[around], values[around]) for values in arrays)
        turned = _around(time, later[part])
        h = np.interp(later[part], time[turned], heading[turned])
        columns = [times[part], x, y, z, wrapped(h), p, r]
        if version >= MOTION_SINCE:
            rates = _rate(speed, time, around)
            columns += [np.interp(times[part], time[around], values) for values in (speed[around], rates)]
        return columns

    return columns_of


def _around(time: FloatArray, moments: FloatArray) -> slice:
    """Rows between which all moments lie."""
    first, last = np.searchsorted(time, (moments.min(), moments.max()), side="right")
    return slice(max(int(first) - 1, 0), int(last) + 1)


def _rate(values: FloatArray, time: FloatArray, rows: slice) -> FloatArray:
    """Of change per second on some rows: as `np.gradient` has it, to the bit, over all of them."""
    first, last = max(rows.start - 1, 0), min(rows.stop + 1, len(time))
    while last - first < len(time) and np.ptp(np.diff(time[first:last])) == 0.0:
        # steps that are all the same have a formula of their own, which is not that of the whole run
        first, last = max(2 * first - last, 0), min(2 * last - first, len(time))
    return np.asarray(np.gradient(values[first:last], time[first:last])[rows.start - first :][: len(time[rows])])


def _unwrapped(heading: FloatArray) -> FloatArray:
    """`np.unwrap`, to the bit, in blocks of rows."""
    n = len(heading)

    def steps(rows: slice) -> FloatArray:
        return np.diff(heading[rows.start - 1 : rows.stop])

    if not any((np.abs(steps(rows)) >= np.pi).any() for rows in blocks(n, 1)):
        return heading

    def unwrapped() -> Iterator[list[FloatArray]]:
        yield [heading[:1]]
        turned = np.zeros(1)
        for rows in blocks(n, 1):
            step = steps(rows)
            turn = np.mod(step + np.pi, 2.0 * np.pi) - np.pi
            turn = np.where((turn == -np.pi) & (step > 0.0), np.pi, turn) - step
            turned = np.cumsum(np.append(turned[-1:], np.where(np.abs(step) < np.pi, 0.0, turn)))
            yield [heading[rows] + turned[1:]]

    return columns(n, unwrapped())[0]


def _heading_times(times: FloatArray) -> FloatArray:
    """When the entity has the headings that the vertices get. [s]

    The reference player has a vertex's heading in the middle of the gap after it: half a gap late. Where gaps are
    shorter than most it would catch up with the path, and turn sharply: so it is kept as late there. Towards the end it
    catches up slowly, for there the path is over at once.
    """
    gaps = np.diff(times)
    around = (len(gaps) - 1) // 2, len(gaps) // 2
    usual = 0.5 * float(np.partition(gaps, around)[[*around]].mean())  # median; numpy's would load `numpy.ma`
    middle = times + np.minimum(0.5 * np.append(gaps, 0.0), usual)
    late = usual * np.minimum((times[-1] - middle) / (CATCH_UP_RATIO * usual), 1.0)
    return np.asarray(np.minimum(middle - late, times[-1]))


def add_vertices(owner: etree._Element, name: str, draft: Draft, vertices: TimedVertices) -> None:
    """Add a FollowTrajectoryAction along a polyline to a PrivateAction."""
    follow = build.sub(owner, "RoutingAction/FollowTrajectoryAction")
    holder = follow if draft.version < (1, 1) else build.sub(follow, "TrajectoryRef")
    trajectory = build.sub(holder, "Trajectory", name=name, closed="false")
    draft.vertices.add(build.sub(trajectory, "Shape/Polyline"), vertices)
    build.sub(follow, "TimeReference/Timing", domainAbsoluteRelative="absolute", scale="1", offset="0")
    build.sub(follow, "TrajectoryFollowingMode", followingMode="position")


def wrapped(angle: Any) -> Any:
    """Into (-pi, pi]."""
    return np.pi - np.mod(np.pi - angle, 2.0 * np.pi)
