"""Rows of a run: written down cheaply in every frame, worked out into poses all at once in the end."""

from __future__ import annotations

from array import array
from math import pi

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.errors import PlaybackError
from xosc_lateral.mask import true_blocks
from xosc_lateral.motion.nominal import Activity, EntityMotion, FloatArray, IntArray
from xosc_lateral.playback.state import NOWHERE, EntityState
from xosc_lateral.road import RoadNetwork
from xosc_lateral.road.tables import turned_in_surface

NO_LANE = "none"
"""Lane type of what is beside the road, though the road describes it."""

_UNKNOWN = -2
"""Road of a row whose world pose is known, but whose road coordinates nobody has asked for yet."""


FARTHEST = 1e8
"""No entity is further from the origin: UTM coordinates stay below 1e7. [m]"""

FASTEST = 1000.0
"""No entity is faster. [m/s]"""

FARTHEST_IN_A_FRAME = 1000.0
"""No entity gets further within a frame, unless it is placed anew. [m]"""


_TELEPORTED, _ROAD_END = int(Activity.TELEPORTED), int(Activity.ROAD_END)  # plain: flags take ten times as long


class Rows:
    """Rows of one entity."""

    def __init__(self, state: EntityState) -> None:
        self.state = state
        self._road = array("i")
        self._lane = array("i")
        self._s = array("d")
        self._offset_t = array("d")
        self._relative_heading = array("d")
        self._speed = array("d")
        self._activity = array("B")
        self._free_rows = array("q")
        self._free = array("d")

    def write(self, time: float) -> None:
        """Write down where the entity is now; raises `PlaybackError` where no entity can be. [s]"""
        state = self.state
        free = state._free_pose
        x, y = (state.s, state.offset_t) if free is None else (free.x, free.y)
        speed = 0.0 if state.activity & _TELEPORTED else state.speed  # that of a leap is none
        if state.active and not (abs(x) <= FARTHEST and abs(y) <= FARTHEST and abs(speed) <= FASTEST):
            words = ("s", "offset") if free is None else ("x", "y")
            raise self._implausible(time, f"{words[0]} = {x:g} m, {words[1]} = {y:g} m, speed = {state.speed:g} m/s")
        if free is not None:
            self._free_rows.append(len(self._road))
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
        state, n = self.state, len(s)
        self._s.frombytes(s.tobytes())
        for column, value in (
            (self._road, state.road),
            (self._lane, state.lane),
            (self._offset_t, state.offset_t),
            (self._relative_heading, state.relative_heading),
            (self._speed, state.speed),
            (self._activity, state.activity),
        ):
            column.frombytes(np.full(n, value, dtype=column.typecode).tobytes())

    def _implausible(self, time: float, what: str) -> PlaybackError:
        place = self.state.entity.place
        return PlaybackError(
            f"'{self.state.name}' leaves every plausible bound at {time:.2f} s ({what}; limits {FARTHEST:g} m and "
            f"{FASTEST:g} m/s): the scenario can't be played",
            path=place.path,
            line=place.line,
            element=place.element,
        )

    def _check_jumps(self, time: FloatArray, pose: FloatArray, activity: NDArray[np.uint8]) -> None:
        """Nobody moves this far in a frame without being placed anew."""
        moved = np.hypot(np.diff(pose[:, 0]), np.diff(pose[:, 1]))
        there = (activity[1:] & activity[:-1] & np.uint8(Activity.ACTIVE)) != 0
        far = there & ((activity[1:] & np.uint8(Activity.TELEPORTED)) == 0) & (moved > FARTHEST_IN_A_FRAME)
        if far.any():
            k = int(np.flatnonzero(far)[0]) + 1
            raise self._implausible(float(time[k]), f"{moved[k - 1]:g} m in one frame")

    def motion(self, network: RoadNetwork, time: FloatArray) -> EntityMotion:
        """All rows, with world poses and directions of travel."""
        # The rows themselves, not copies: nobody writes on.
        road: IntArray = np.frombuffer(self._road, dtype=np.int32)
        lane: IntArray = np.frombuffer(self._lane, dtype=np.int32)
        s, offset, along, speed = (
            np.frombuffer(column, dtype=np.float64)
            for column in (self._s, self._offset_t, self._relative_heading, self._speed)
        )
        activity = np.frombuffer(self._activity, dtype=np.uint8)
        free_rows = np.frombuffer(self._free_rows, dtype=np.int64)
        free = np.frombuffer(self._free, dtype=np.float64).reshape(-1, 6)

        direction = np.ones(len(road))
        looked_up = free_rows[road[free_rows] == _UNKNOWN]
        known = road >= 0
        if known.any():
            direction[known] = network.travel_directions(road[known], lane[known])
        offset *= direction
        if len(looked_up):
            _look_up(network, looked_up, free[road[free_rows] == _UNKNOWN], road, lane, s, offset, direction)
        to_lane = along - np.where(direction > 0, 0.0, pi)
        on_road = road >= 0
        pose = _poses(network, road, lane, s, offset, to_lane)
        _lay_over(pose, free_rows, free)
        to_lane[looked_up] = pose[looked_up, 3] - _lane_heading(network, road, lane, s, offset, looked_up)
        self._check_jumps(time, pose, activity)
        beside = _beside_road(network, road, lane, s, offset, pose, on_road)
        activity[beside & (activity & np.uint8(Activity.ACTIVE) > 0)] |= np.uint8(Activity.OFF_ROAD)
        road[~on_road], lane[~on_road], s[~on_road], offset[~on_road] = NOWHERE, 0, 0.0, 0.0
        return EntityMotion(
            entity=self.state.entity,
            time=time,
            x=pose[:, 0],
            y=pose[:, 1],
            z=pose[:, 2],
            heading=np.mod(pose[:, 3], 2.0 * pi, out=pose[:, 3]),
            pitch=pose[:, 4],
            roll=pose[:, 5],
            speed=speed,
            road=road,
            lane=lane,
            s=s,
            offset=offset,
            heading_relative=(to_lane + pi) % (2.0 * pi) - pi,
            activity=activity,
        )


def _poses(
    network: RoadNetwork, road: IntArray, lane: IntArray, s: FloatArray, offset: FloatArray, to_lane: FloatArray
) -> FloatArray:
    """World poses of the rows that are on a road, shape (n, 6), turned by `to_lane` [rad] against their lanes."""
    on_road = road >= 0
    pose = np.zeros((len(road), 6), order="F")  # each column is then an array of its own
    for rows in true_blocks(on_road):
        pose[rows] = np.column_stack(network.lane_to_world(road[rows], lane[rows], s[rows], offset[rows]))
    _turn(pose, to_lane, on_road)

    return pose


def _look_up(
    network: RoadNetwork,
    rows: NDArray[np.int64],
    free: FloatArray,
    road: IntArray,
    lane: IntArray,
    s: FloatArray,
    offset: FloatArray,
    direction: FloatArray,
) -> None:
    """Road coordinates of rows that only have a world pose."""
    if not network.road_ids:
        road[rows] = NOWHERE
        return
    z = free[:, 2]
    found = network.world_to_lane(free[:, 0], free[:, 1], None if np.isnan(z).any() else z)
    road[rows], lane[rows], s[rows], offset[rows] = found.road, found.lane, found.s, found.offset
    direction[rows] = network.travel_directions(found.road, found.lane)


def _turn(pose: FloatArray, angle: FloatArray, rows: NDArray[np.bool_]) -> None:
    """Turn poses about the normal of the surface that they stand on."""
    turned = rows & (angle != 0.0)
    sloped = turned & ((pose[:, 4] != 0.0) | (pose[:, 5] != 0.0))
    flat = turned & ~sloped
    pose[flat, 3] += angle[flat]
    if sloped.any():
        turn, pose[sloped, 4], pose[sloped, 5] = turned_in_surface(angle[sloped], pose[sloped, 4], pose[sloped, 5])
        pose[sloped, 3] += turn


def _lay_over(pose: FloatArray, rows: NDArray[np.int64], free: FloatArray) -> None:
    """World poses where they were given; what was left to the road stays."""
    if len(rows):
        pose[rows] = np.where(np.isnan(free), pose[rows], free)


def _lane_heading(
    network: RoadNetwork,
    road: IntArray,
    lane: IntArray,
    s: FloatArray,
    offset: FloatArray,
    rows: NDArray[np.int64],
) -> FloatArray:
    if not len(rows) or not network.road_ids:
        return np.zeros(len(rows))
    return network.lane_to_world(road[rows], lane[rows], s[rows], offset[rows]).heading


def _beside_road(
    network: RoadNetwork,
    road: IntArray,
    lane: IntArray,
    s: FloatArray,
    offset: FloatArray,
    pose: FloatArray,
    on_road: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Rows whose reference point is on no lane of any kind."""
    beside = ~on_road
    if not on_road.any():
        return beside
    suspects = _suspects(network, road, lane, s, offset, on_road)
    if len(suspects):
        types = {lane.type for r in network.roads for section in r.sections for lane in section.lanes} - {NO_LANE}
        found = network.world_to_lane(pose[suspects, 0], pose[suspects, 1], lane_types=types)
        beside[suspects] = ~(found.distance <= _TOUCH)
    return beside


def _suspects(
    network: RoadNetwork, road: IntArray, lane: IntArray, s: FloatArray, offset: FloatArray, on_road: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Rows that lie beyond their own lane."""
    suspects = [np.empty(0, dtype=np.int64)]
    for rows in true_blocks(on_road):
        half = 0.5 * network.lane_width(road[rows], lane[rows], s[rows])
        suspects.append(rows[np.abs(offset[rows]) > half + _TOUCH])
    return np.concatenate(suspects)


_TOUCH = 1e-3
"""So near to a lane, a point counts as on it. [m]"""
