"""Rows of a run: written down cheaply in every frame, worked out into poses all at once in the end."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from math import pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BLOCK, BoolArray, FloatArray, Int32Array, IntArray, columns
from xosc_lateral.base.errors import FormatError, PlaybackError
from xosc_lateral.world.motion.nominal import MOTION, Activity, EntityMotion
from xosc_lateral.world.player.state import NO_ROAD, EntityState
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.road.tables import turned_in_surface

NO_LANE = "none"
"""Lane type of what is beside the road, though the road describes it."""

_UNKNOWN = -2
"""Road of a row whose world pose is known, but whose road coordinates nobody has asked for yet."""


MAXIMUM_COORDINATE = 1e8
"""No entity is further from the origin: UTM coordinates stay below 1e7. [m]"""

MAXIMUM_SPEED = 1000.0
"""No entity is faster. [m/s]"""

FARTHEST_IN_A_FRAME = 1000.0
"""No entity gets further within a frame, unless it is placed anew. [m]"""


_TELEPORTED, _ROAD_END = int(Activity.TELEPORTED), int(Activity.ROAD_END)  # plain: flags take ten times as long


class Rows:
    """Rows of one entity: in arrays as they come, and put away as bytes, column after column, every so many frames."""

    def __init__(self, state: EntityState) -> None:
        self.state = state
        self._s = array("d")
        self._offset_t = array("d")
        self._relative_heading = array("d")
        self._speed = array("d")
        self._road = array("i")
        self._lane = array("i")
        self._activity = array("B")
        self._columns: tuple[array[Any], ...] = (
            self._s, self._offset_t, self._relative_heading, self._speed, self._road, self._lane, self._activity
        )  # fmt: skip
        self._put_away: list[NDArray[np.uint8]] = []
        self._rows_put_away = 0
        self._free_rows = array("q")
        self._free = array("d")
        self._free_put_away: list[tuple[IntArray, FloatArray]] = []
        self._knows_height = True
        """Of all rows whose road nobody has asked for."""

    def write(self, time: float) -> None:
        """Write down where the entity is now; raises `PlaybackError` where no entity can be. [s]"""
        state = self.state
        free = state.free_pose
        x, y = (state.s, state.offset_t) if free is None else (free.x, free.y)
        speed = 0.0 if state.activity & _TELEPORTED else state.speed  # that of a leap is none
        if state.active and not (
            abs(x) <= MAXIMUM_COORDINATE and abs(y) <= MAXIMUM_COORDINATE and abs(speed) <= MAXIMUM_SPEED
        ):
            words = ("s", "offset") if free is None else ("x", "y")
            raise self._implausible(time, f"{words[0]} = {x:g} m, {words[1]} = {y:g} m, speed = {state.speed:g} m/s")
        if free is not None:
            self._free_rows.append(self._rows_put_away + len(self._road))
            self._free.extend(free)
        self._road.append(state.road if state._located else _UNKNOWN)
        self._lane.append(state.lane)
        self._s.append(state.s)
        self._offset_t.append(state.offset_t)
        self._relative_heading.append(state.relative_heading)
        self._speed.append(state.speed)
        self._activity.append(state.activity | _ROAD_END if state.at_road_end else state.activity)

    def follow(self, s: FloatArray) -> None:
        """Write down rows along a lane that differ in s alone, shape (n,). [m]"""
        state = self.state
        self._s.frombytes(s.tobytes())
        same = state.offset_t, state.relative_heading, state.speed, state.road, state.lane, state.activity
        for column, value in zip(self._columns[1:], same, strict=True):
            column.frombytes(np.full(len(s), value, dtype=column.typecode).tobytes())

    def _implausible(self, time: float, what: str) -> FormatError:
        limits = f"limits {MAXIMUM_COORDINATE:g} m and {MAXIMUM_SPEED:g} m/s"
        where = f"'{self.state.name}' leaves every plausible bound at {time:.2f} s ({what}; {limits})"
        return self.state.entity.place.error(f"{where}: the scenario can't be played", PlaybackError)

    def put_away(self) -> None:
        """Make place for rows to come."""
        if not self._road:
            return
        if self._free_rows:
            rows, free = np.array(self._free_rows), np.array(self._free).reshape(-1, 6)
            unknown = np.array(self._road)[rows - self._rows_put_away] == _UNKNOWN
            self._knows_height &= not np.isnan(free[unknown, 2]).any()
            self._free_put_away.append((rows, free))
        self._rows_put_away += len(self._road)
        self._put_away.append(np.frombuffer(b"".join(self._columns), dtype=np.uint8))
        for column in (*self._columns, self._free_rows, self._free):
            del column[:]

    def motion(self, network: RoadNetwork, time: FloatArray) -> EntityMotion:
        """All rows, with world poses and directions of travel; what was written down is gone."""
        self.put_away()
        worked_out = columns(len(time), self._worked_out(network, time))
        return EntityMotion.of(self.state.entity, time, **dict(zip(MOTION, worked_out, strict=True)))

    def _worked_out(self, network: RoadNetwork, time: FloatArray) -> Iterator[tuple[NDArray[Any], ...]]:
        """The columns of `MOTION`, in blocks of rows."""
        begin, before = 0, tuple[NDArray[Any], ...]()
        for s, offset, along, speed, road, lane, activity in self._blocks():
            n, where = len(s), _Where(road, lane, s, offset)
            free_rows, free = self._free_within(begin, begin + n)
            direction = np.ones(n)
            unknown = road[free_rows] == _UNKNOWN
            looked_up = free_rows[unknown]
            known = road >= 0
            if known.any():
                direction[known] = network.travel_directions(road[known], lane[known])
            offset *= direction
            if len(looked_up) and network.road_ids:
                height = free[unknown, 2] if self._knows_height else None
                x, y, lane_types = free[unknown, 0], free[unknown, 1], self.state.lane_types
                located = network.world_to_lane(x, y, height, lane_types=lane_types)
                road[looked_up], lane[looked_up] = located.road, located.lane
                s[looked_up], offset[looked_up] = located.s, located.offset
                direction[looked_up] = network.travel_directions(located.road, located.lane)
            elif len(looked_up):
                road[looked_up] = NO_ROAD
            to_lane = along - np.where(direction > 0, 0.0, pi)
            on_road = road >= 0
            pose = _poses(network, where, to_lane)
            pose[free_rows] = np.where(np.isnan(free), pose[free_rows], free)  # what was left to the road stays
            to_lane[looked_up] = pose[looked_up, 3]
            if len(looked_up) and network.road_ids:
                to_lane[looked_up] -= network.lane_to_world(*where.at(looked_up)).heading
            checked = (time[begin : begin + n], pose[:, 0], pose[:, 1], activity)
            self._check_jumps(*(np.concatenate(two) for two in zip(before, checked, strict=True)) if begin else checked)
            before = tuple(values[-1:].copy() for values in checked)
            beside = _beside_road(network, where, pose)
            activity[beside & (activity & np.uint8(Activity.ACTIVE) > 0)] |= np.uint8(Activity.OFF_ROAD)
            road[~on_road], lane[~on_road], s[~on_road], offset[~on_road] = NO_ROAD, 0, 0.0, 0.0
            heading = np.mod(pose[:, 3], 2.0 * pi, out=pose[:, 3])
            relative = (to_lane + pi) % (2.0 * pi) - pi
            yield (*pose[:, :3].T, heading, *pose[:, 4:].T, speed, road, lane, s, offset, relative, activity)
            begin += n
        self._free_put_away.clear()

    def _blocks(self) -> Iterator[list[NDArray[Any]]]:
        """What was put away, as arrays of its columns, shape (rows,) each."""
        together: list[list[NDArray[Any]]] = []
        kinds = [np.dtype(column.typecode) for column in self._columns]
        size = sum(kind.itemsize for kind in kinds)
        while self._put_away:  # gone as they are taken: both forms of all rows would be a third more
            data = self._put_away.pop(0)
            rows = len(data) // size
            ends = np.cumsum([rows * kind.itemsize for kind in kinds])
            parts = np.split(data, ends[:-1])
            together.append([part.view(kind) for part, kind in zip(parts, kinds, strict=True)])
            if not self._put_away or sum(len(part[0]) for part in together) >= BLOCK:
                yield [np.concatenate(column) for column in zip(*together, strict=True)]
                together = []

    def _free_within(self, begin: int, end: int) -> tuple[IntArray, FloatArray]:
        """World poses that were given, shape (n, 6), and their rows, counted from `begin`, before `end`."""
        parts = [(rows, free) for rows, free in self._free_put_away if rows[0] < end and rows[-1] >= begin]
        if not parts:
            return np.empty(0, dtype=np.int64), np.empty((0, 6))
        rows, free = (np.concatenate(column) for column in zip(*parts, strict=True))
        inside = (rows >= begin) & (rows < end)
        return rows[inside] - begin, free[inside]

    def _check_jumps(self, time: FloatArray, x: FloatArray, y: FloatArray, activity: NDArray[np.uint8]) -> None:
        """Nobody moves this far in a frame without being placed anew."""
        moved = np.hypot(np.diff(x), np.diff(y))
        there = (activity[1:] & activity[:-1] & np.uint8(Activity.ACTIVE)) != 0
        far = there & ((activity[1:] & np.uint8(Activity.TELEPORTED)) == 0) & (moved > FARTHEST_IN_A_FRAME)
        if far.any():
            k = int(np.flatnonzero(far)[0]) + 1
            raise self._implausible(float(time[k]), f"{moved[k - 1]:g} m in one frame")


class _Where(NamedTuple):
    """Road coordinates of rows."""

    road: Int32Array
    lane: Int32Array
    s: FloatArray
    offset: FloatArray

    def at(self, rows: IntArray) -> tuple[Int32Array, Int32Array, FloatArray, FloatArray]:
        """Those of some rows."""
        return self.road[rows], self.lane[rows], self.s[rows], self.offset[rows]


def _poses(network: RoadNetwork, where: _Where, to_lane: FloatArray) -> FloatArray:
    """World poses of the rows that are on a road, shape (n, 6), turned by `to_lane` [rad] against their lanes."""
    on_road = where.road >= 0
    pose = np.zeros((len(on_road), 6), order="F")  # each column is then an array of its own
    rows = np.flatnonzero(on_road)
    if len(rows):
        pose[rows] = np.column_stack(network.lane_to_world(*where.at(rows)))
    turned = on_road & (to_lane != 0.0)
    sloped = turned & ((pose[:, 4] != 0.0) | (pose[:, 5] != 0.0))
    flat = turned & ~sloped
    pose[flat, 3] += to_lane[flat]
    if sloped.any():
        turn, pose[sloped, 4], pose[sloped, 5] = turned_in_surface(to_lane[sloped], pose[sloped, 4], pose[sloped, 5])
        pose[sloped, 3] += turn
    return pose


def _beside_road(network: RoadNetwork, where: _Where, pose: FloatArray) -> BoolArray:
    """Rows whose reference point is on no lane of any kind."""
    beside = where.road < 0
    rows = np.flatnonzero(~beside)
    if not len(rows):
        return beside
    road, lane, s, offset = where.at(rows)
    suspects = rows[np.abs(offset) > 0.5 * network.lane_width(road, lane, s) + _LANE_TOLERANCE]  # beyond their own lane
    if len(suspects):
        types = {lane.type for r in network.roads for section in r.sections for lane in section.lanes} - {NO_LANE}
        located = network.world_to_lane(pose[suspects, 0], pose[suspects, 1], lane_types=types)
        beside[suspects] = ~(located.distance <= _LANE_TOLERANCE)
    return beside


_LANE_TOLERANCE = 1e-3
"""So near to a lane, a point counts as on it. [m]"""
