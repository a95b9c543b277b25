"""The road network: (road, lane, s, offset) <-> (x, y, z, heading), and where lanes lead.

Signs. `offset` is positive to the LEFT of travel everywhere; `t` is positive to the left of the road's reference line
(ASAM OpenDRIVE 1.8, 2023); `offset_t` counts along +t from the lane centre (OpenSCENARIO ``LanePosition/@offset``).
They are converted here and nowhere else. In every call `road` is the int32 INDEX of a road in `RoadNetwork.road_ids`.

Batch calls take scalars or arrays that broadcast, and answer with arrays. Names that end in ``_at`` take and give plain
floats and are made for stepping one vehicle at a time: a few microseconds each, without numpy.
"""

from __future__ import annotations

from collections.abc import Collection
from math import hypot

import numpy as np
from numpy.typing import ArrayLike

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.base.note import Note
from xosc_lateral.world.road.index import LANE_TOLERANCE, SAME_LEVEL_HEIGHT, SurfaceIndex, refuse_nan
from xosc_lateral.world.road.lanes import DRIVING
from xosc_lateral.world.road.piecewise import HeaderOffset
from xosc_lateral.world.road.positions import LaneCoordinates, LaneInfo, LaneState, Pose, RoadMark
from xosc_lateral.world.road.road import Junction, Road, find_lane, lane_at, lane_pose, project_at, surface_pose
from xosc_lateral.world.road.routes import Routes


class RoadNetwork(SurfaceIndex, Routes):
    """Roads, lanes and links of one OpenDRIVE file; arguments of a batch broadcast, answers have their shape."""

    def __init__(
        self,
        roads: tuple[Road, ...],
        *,
        junctions: tuple[Junction, ...] = (),
        path: str = "",
        notes: tuple[Note, ...] = (),
        geo_reference: str | None = None,
        sha256: str = "",
        header_offset: HeaderOffset | None = None,
    ) -> None:
        SurfaceIndex.__init__(self, roads, path)
        Routes.__init__(self, roads, junctions)
        # Attributes stay below 30: from there on CPython calls methods at half the speed.
        self.road_ids = tuple(road.id for road in roads)
        """``road/@id`` in file order."""
        self.notes = notes
        """What was repaired, ignored or degenerate on reading: never silent."""
        self.geo_reference = geo_reference
        """Projection of inertial x, y (PROJ string)."""
        self.sha256 = sha256
        """Of the bytes that were parsed; empty: not read from a file."""
        self.header_offset = header_offset or HeaderOffset()
        """From the coordinates of the file, which all answers are in, to inertial ones."""

    # ---- names and signs ---------------------------------------------------------------------------------------------
    def index_of(self, road_id: str) -> int:
        """Index of a road by its OpenDRIVE id; raises `PlaybackError` naming the id."""
        try:
            return self._index[road_id]
        except KeyError:
            there = ", ".join(self.road_ids[:8]) + (", ..." if len(self.road_ids) > 8 else "")
            raise PlaybackError(f"there is no road '{road_id}' (roads: {there})", path=self.path) from None

    def travel_direction(self, road: int, lane: int) -> int:
        """+1: the lane is driven along s, -1: against s. Lane id and ``road/@rule`` (RHT, LHT) decide."""
        return self.roads[road].directions.get(lane, 1)

    def offset_to_t(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike) -> FloatArray:
        """Offset to the left of travel -> t from the reference line. [m]"""
        profile = self.lane_profile(road, lane, s)
        return np.asarray(profile.centre + profile.direction * np.asarray(offset, dtype=np.float64))

    def offset_from_offset_t(self, road: int, lane: int, offset_t: float) -> float:
        """OpenSCENARIO's LanePosition offset (along +t) -> offset (left of travel); its own inverse. [m]"""
        return self.travel_direction(road, lane) * offset_t

    # ---- batch: what a lane is like ----------------------------------------------------------------------------------
    def lane_centre_t(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """T of the lane centre. [m]"""
        return self.lane_profile(road, lane, s).centre

    def lane_width(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Width of the lane. [m]"""
        return self.lane_profile(road, lane, s).width

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
        """Centre t [m], its slope along s [-] and width of a lane [m]; `PlaybackError` for a lane that is not there."""
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
        self,
        road: int,
        s: float,
        t: float,
        *,
        lane_types: Collection[str] | None = DRIVING,
        prefer: int | None = None,
        direction: int = 0,
    ) -> LaneCoordinates:
        """The lane of these types that holds `t`, else the nearest; at the edge of two the lane `prefer`. [m]

        With a `direction`, one that is driven along (+1) or against (-1) s; lane 0 if the road has none there.
        """
        return lane_at(self.roads[road], road, s, t, lane_types, prefer=prefer, direction=direction)

    def section_at(self, road: int, s: float) -> tuple[float, float]:
        """Start and end s of the lane section. [m]"""
        section = self.roads[road].section_at(s)
        return section.start, section.end

    def world_to_lane_at(
        self,
        x: float,
        y: float,
        z: float | None = None,
        *,
        near: tuple[int, float] | None = None,
        lane_types: Collection[str] | None = DRIVING,
    ) -> LaneCoordinates:
        """`world_to_lane` of one point [m], [rad].

        `near` = (road, s) where it was a moment ago makes it cheap, and distinguishes roads that lie on each other.
        """
        if near is None or near[0] < 0:
            return self._nearest_lane(x, y, z, lane_types)
        before, s = near
        here = self._lane_of(before, s, x, y, lane_types)
        if here.distance <= LANE_TOLERANCE:
            return here
        located = self._nearest_lane(x, y, z, lane_types)
        if located.road == before or located.distance > LANE_TOLERANCE:
            return located
        # At the entry of a junction its roads lie on each other, and a point that is between two vertices of a path has
        # no other sign of where it goes: to the road that its lane leads on to, of several the least bent there, else
        # where it was found. So the reference player has it.
        options = [link for way in (1, -1) for link in self.next_lanes(before, here.lane, way)]
        options.sort(key=lambda link: abs(self.curvature_at(link.road, link.s)))
        onward = (self._lane_of(link.road, link.s, x, y, lane_types) for link in options)
        return next((place for place in onward if place.distance <= LANE_TOLERANCE), located)

    def _nearest_lane(self, x: float, y: float, z: float | None, lane_types: Collection[str] | None) -> LaneCoordinates:
        """As `SurfaceIndex` has it for many points; in plain floats it takes a tenth of the time."""
        at_x, at_y = refuse_nan([np.array([x]), np.array([y])])
        near = self._candidates(at_x, at_y, None if lane_types is None else frozenset(lane_types))

        def rank(place: LaneCoordinates) -> tuple[float, float, int]:
            height = 0.0 if z is None else self.roads[place.road].surface.at(place.s, place.t)[0]
            above = 0.0 if z is None else max(abs(z - height) - SAME_LEVEL_HEIGHT, 0.0)
            return round(place.distance + above, 9), round(abs(place.offset), 9), place.road

        candidates = zip(near.road.tolist(), near.s.tolist(), strict=True)
        return min((self._lane_of(road, s, x, y, lane_types) for road, s in candidates), key=rank)

    def _lane_of(
        self, road: int, guess: float, x: float, y: float, lane_types: Collection[str] | None
    ) -> LaneCoordinates:
        """The lane of a road that is nearest to a point, from a guess of s; ends of the road are edges, too. [m]"""
        s, t, ahead = project_at(self.roads[road], x, y, guess)
        place = lane_at(self.roads[road], road, s, t, lane_types)
        return place._replace(distance=hypot(place.distance, ahead))

    # ---- to be seen --------------------------------------------------------------------------------------------------
    def road_marks(self, road: int) -> tuple[RoadMark, ...]:
        """Markings at the outer edges of all lanes of a road, lane 0 included, by section from left to right."""
        every = (
            lane
            for section in self.roads[road].sections
            for lane in sorted((*section.lanes, section.centre), key=lambda lane: -lane.id)
        )
        return tuple(mark for lane in every for mark in lane.marks if mark.type != "none")
