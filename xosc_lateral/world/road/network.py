"""The road network: (road, lane, s, offset) <-> (x, y, z, heading), and where lanes lead.

Signs. `offset` is positive to the LEFT of travel everywhere; `t` is positive to the left of the road's reference line
(ASAM OpenDRIVE 1.8, 2023); `offset_t` counts along +t from the lane centre (OpenSCENARIO ``LanePosition/@offset``).
They are converted here and nowhere else. In every call `road` is the int32 INDEX of a road in `RoadNetwork.road_ids`.

Batch calls take scalars or arrays that broadcast, and answer with arrays. Names that end in ``_at`` take and give plain
floats and are made for stepping one vehicle at a time: a few microseconds each, without numpy.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from xosc_lateral.base.arrays import FloatArray, Int32Array
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.world.road.index import SurfaceIndex
from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.links import Chooser, Links, advance, gone_on, straightest
from xosc_lateral.world.road.piecewise import IndexLike
from xosc_lateral.world.road.positions import (
    Advance,
    LaneCoordinates,
    LaneInfo,
    LaneLink,
    LanePositions,
    LaneState,
    Pose,
    Poses,
    RoadMark,
    RoadPath,
    RouteStep,
)
from xosc_lateral.world.road.road import Junction, Road, find_lane, lane_at, lane_pose, surface_pose
from xosc_lateral.world.road.routes import path_between, route
from xosc_lateral.world.road.surface import HeaderOffset
from xosc_lateral.world.road.tables import NetworkTables


@dataclass(frozen=True, eq=False)
class RoadNetwork:
    """Roads, their lanes and their links, as read from one OpenDRIVE file.

    Arguments of a batch broadcast; what it answers has the shape of the arguments.
    """

    roads: tuple[Road, ...]
    junctions: tuple[Junction, ...] = ()
    path: str = ""  # the file
    notes: tuple[str, ...] = ()  # what was repaired, ignored or degenerate on reading: never silent
    geo_reference: str | None = None  # projection of inertial x, y (PROJ string)
    sha256: str = ""  # of the bytes that were parsed; empty: not read from a file
    # from the coordinates of the file, which all answers are in, to inertial ones
    header_offset: HeaderOffset = field(default_factory=HeaderOffset)
    road_ids: tuple[str, ...] = field(init=False)  # ``road/@id`` in file order
    _indices: dict[str, int] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "road_ids", tuple(road.id for road in self.roads))
        object.__setattr__(self, "_indices", {road.id: i for i, road in enumerate(self.roads)})

    @cached_property
    def _tables(self) -> NetworkTables:
        return NetworkTables(self.roads, self.path)

    @cached_property
    def _index(self) -> SurfaceIndex:
        return SurfaceIndex(self._tables)

    @cached_property
    def _links(self) -> Links:
        return Links(self.roads, self.junctions)

    # ---- names and signs ---------------------------------------------------------------------------------------------
    def index_of(self, road_id: str) -> int:
        """Index of a road by its OpenDRIVE id; raises `PlaybackError` naming the id."""
        try:
            return self._indices[road_id]
        except KeyError:
            there = ", ".join(self.road_ids[:8]) + (", ..." if len(self.road_ids) > 8 else "")
            raise PlaybackError(f"there is no road '{road_id}' (roads: {there})", path=self.path) from None

    def travel_direction(self, road: int, lane: int) -> int:
        """+1: the lane is driven along s, -1: against s. Lane id and ``road/@rule`` (RHT, LHT) decide."""
        return self.roads[road].directions.get(lane, 1)

    def travel_directions(self, road: ArrayLike, lane: ArrayLike) -> Int32Array:
        """`travel_direction` for arrays. [-]"""
        return self._tables.travel_directions(road, lane)

    def offset_to_t(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike) -> FloatArray:
        """Offset to the left of travel -> t from the reference line. [m]"""
        profile = self._tables.lane_profile(road, lane, s)
        return np.asarray(profile.centre + profile.direction * np.asarray(offset, dtype=np.float64))

    def t_to_offset(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, t: ArrayLike) -> FloatArray:
        """Inverse of `offset_to_t`. [m]"""
        profile = self._tables.lane_profile(road, lane, s)
        return np.asarray(profile.direction * (np.asarray(t, dtype=np.float64) - profile.centre))

    def offset_from_offset_t(self, road: int, lane: int, offset_t: float) -> float:
        """OpenSCENARIO's LanePosition offset (along +t) -> offset (left of travel); its own inverse. [m]"""
        return self.travel_direction(road, lane) * offset_t

    # ---- batch: road and lane to world -------------------------------------------------------------------------------
    def lane_to_world(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike = 0.0) -> Poses:
        """World poses; heading, pitch and roll are those of driving along the lane (slope of the lane centre included).

        `s` outside the road is clamped to its ends. Raises `PlaybackError` for a lane that is not there, naming it.
        """
        return self._tables.lane_to_world(road, lane, s, offset)

    def lane_points(
        self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, *offsets: ArrayLike
    ) -> list[tuple[FloatArray, ...]]:
        """x, y, z as of `lane_to_world`, for each of several offsets at the same `s`. [m]"""
        return self._tables.lane_points(road, lane, s, *offsets)

    def road_to_world(self, road: ArrayLike, s: ArrayLike, t: ArrayLike = 0.0) -> Poses:
        """World poses; heading along the reference line (+s)."""
        return self._tables.road_to_world(road, s, t)

    # ---- batch: world to lane ----------------------------------------------------------------------------------------
    def world_to_lane(
        self,
        x: ArrayLike,
        y: ArrayLike,
        z: ArrayLike | None = None,
        heading: ArrayLike | None = None,
        *,
        lane_types: Collection[str] | None = DRIVING,
    ) -> LanePositions:
        """Nearest lane of the given types (None: any) under each point.

        `z` distinguishes roads on top of each other; `heading` prefers lanes driven that way. Everything is found,
        however far off: look at `distance`.
        """
        return self._index.world_to_lane(x, y, z, heading, lane_types=lane_types)

    def path_to_lane(
        self, x: ArrayLike, y: ArrayLike, road: ArrayLike, s: ArrayLike, *, lane_types: Collection[str] | None = DRIVING
    ) -> LanePositions:
        """Like `world_to_lane`, on known roads and from a guess of `s` per point (a written path, say): cheap."""
        return self._index.path_to_lane(x, y, road, s, lane_types=lane_types)

    # ---- batch: what a lane is like ----------------------------------------------------------------------------------
    def lane_centre_t(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """T of the lane centre. [m]"""
        return self._tables.lane_profile(road, lane, s).centre

    def lane_width(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Width of the lane. [m]"""
        return self._tables.lane_profile(road, lane, s).width

    def curvature(self, road: ArrayLike, s: ArrayLike) -> FloatArray:
        """Curvature of the reference line along +s, positive in left turns. [1/m]"""
        return self._tables.curvature(road, s)

    def lane_curvature(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike = 0.0) -> FloatArray:
        """Curvature of the driven path parallel to the reference line, positive turning left in TRAVEL. [1/m]"""
        return self._tables.lane_curvature(road, lane, s, offset)

    def lane_index(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> tuple[Int32Array, Int32Array]:
        """Index among the driving lanes of its direction (0 = rightmost in travel direction), and their count.

        Index -1 for a lane that is no driving lane.
        """
        return self._tables.lane_index(road, lane, s)

    def crossfall(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Cross slope seen in travel direction, positive when the road falls to the RIGHT. [%]"""
        return self._tables.lean(road, lane, s)[0]

    def grade(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Slope along travel, positive uphill. [%]"""
        return self._tables.lean(road, lane, s)[1]

    def speed_limit(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Speed limit of the lane, else of the road; inf where none is given. [m/s]"""
        return self._tables.speed_limit(road, lane, s)

    # ---- one place at a time, fast -----------------------------------------------------------------------------------
    def pose_at(self, road: int, lane: int, s: float, offset: float = 0.0) -> Pose:
        """`lane_to_world` of one place. [m], [rad]"""
        return lane_pose(self.roads[road], lane, s, offset)

    def road_pose_at(self, road: int, s: float, t: float = 0.0) -> Pose:
        """`road_to_world` of one place. [m], [rad]"""
        return surface_pose(self.roads[road], s, t)

    def curvature_at(self, road: int, s: float) -> float:
        """`curvature` of one place. [1/m]"""
        return self.roads[road].curvature_at(s)

    def lane_state_at(self, road: int, lane: int, s: float) -> LaneState:
        """Centre t, its slope along s, and width of a lane; raises `PlaybackError` for a lane that is not there.

        [m], [-], [m]
        """
        road_ = self.roads[road]
        info = road_.section_at(s).by_id.get(lane)
        return (info or find_lane(road_, lane, s)).state_at(s)

    def lanes_at(self, road: int, s: float) -> tuple[LaneInfo, ...]:
        """All lanes of the cross-section but the centre lane 0, from left to right looking along s. `s` in [m]."""
        states = ((lane, lane.state_at(s)) for lane in self.roads[road].section_at(s).lanes)
        return tuple(LaneInfo(lane.id, lane.type, at.centre_t, at.width, lane.direction) for lane, at in states)

    def has_lane_at(self, road: int, lane: int, s: float) -> bool:
        """Whether the lane exists there. `s` in [m]."""
        return lane in self.roads[road].section_at(s).by_id

    def lane_at(
        self, road: int, s: float, t: float, *, lane_types: Collection[str] | None = DRIVING
    ) -> LaneCoordinates:
        """The lane of these types that holds `t`, else the nearest one; lane 0 if the road has none of them there.

        `s`, `t` in [m].
        """
        return lane_at(self.roads[road], road, s, t, lane_types)

    def section_numbers(self, road: Int32Array, s: FloatArray) -> IndexLike:
        """Numbers of lane sections, counted over all roads; road and s [m] of the same shape (n,)."""
        return self._tables.section_of(road, s)

    def section_at(self, road: int, s: float) -> tuple[float, float]:
        """Start and end s of the lane section. [m]"""
        section = self.roads[road].section_at(s)
        return section.start, section.end

    def world_to_lane_at(
        self,
        x: float,
        y: float,
        z: float | None = None,
        heading: float | None = None,
        *,
        near: tuple[int, float] | None = None,
        lane_types: Collection[str] | None = DRIVING,
    ) -> LaneCoordinates:
        """`world_to_lane` of one point [m], [rad].

        `near` = (road, s) where it was a moment ago makes it cheap, and distinguishes roads that lie on each other.
        """
        located = self._index.world_to_lane_at(x, y, z, heading, near=near, lane_types=lane_types)
        if near is None or near[0] < 0:
            return located
        return gone_on(self._links, located, near, (x, y), lane_types=lane_types)

    # ---- where lanes lead --------------------------------------------------------------------------------------------
    def next_lanes(self, road: int, lane: int, direction: int) -> tuple[LaneLink, ...]:
        """Lanes that follow when leaving the road at its end (direction +1) or at its start (-1).

        `lane` is its id in the road's last (first) section. Several at a junction, none where the lane ends.
        """
        return self._links.next_lanes(road, lane, direction)

    def advance(
        self,
        road: int,
        lane: int,
        s: float,
        distance: float,
        *,
        choose: Chooser | None = None,
        direction: int | None = None,
    ) -> Advance:
        """Move along s by `distance` [m] (negative: backwards) over sections, roads and junctions, by lane links.

        `direction` of positive distance: +1 along s, -1 against; default the lane's travel direction. `choose` picks
        one of several links; default the straightest. Ends at the lane's end, saying what remains.
        """
        return advance(self._links, road, lane, s, distance, choose=choose, direction=direction)

    def straightest(self, options: Sequence[LaneLink]) -> LaneLink:
        """The link whose road turns least from entry to exit; of equals the first."""
        return straightest(self.roads, options)

    def path_between(
        self, start: tuple[int, float], end: tuple[int, float], *, direction: int = 1, limit: float = float("inf")
    ) -> RoadPath | None:
        """Shortest way along the reference lines of linked roads between two (road, s).

        Its length is positive when it leaves `start` in `direction` (+1 along s, -1 against s), negative when it leaves
        the other way. None: no path within `limit` metres.
        """
        return path_between(self._links, start, end, direction=direction, limit=limit)

    def route(
        self,
        start: tuple[int, int, float],
        end: tuple[int, int, float],
        *,
        via: Sequence[tuple[int, int, float]] = (),
        ways: Sequence[int] | None = None,
    ) -> tuple[RouteStep, ...] | None:
        """Shortest drivable way over roads and junctions between two (road, lane, s).

        Every stop is left in the direction `ways` (+1 along s, -1 against s), or in its lane's travel direction; where
        the lane itself leads on, no lanes are changed. None: there is none.
        """
        return route(self._links, start, end, via=via, ways=ways)

    # ---- to be seen --------------------------------------------------------------------------------------------------
    def road_marks(self, road: int) -> tuple[RoadMark, ...]:
        """Markings at the outer edges of all lanes of a road, lane 0 included, by section from left to right."""
        every = (
            lane
            for section in self.roads[road].sections
            for lane in sorted((*section.lanes, section.centre), key=lambda lane: -lane.id)
        )
        return tuple(mark for lane in every for mark in lane.marks if mark.type != "none")


__all__ = ["DRIVING", "Chooser", "RoadNetwork"]
