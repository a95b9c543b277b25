"""The road network: (road, lane, s, offset) <-> (x, y, z, heading), and where lanes lead.

Signs. `offset` is positive to the LEFT of travel everywhere; `t` is positive to the left of the road's reference line
(OpenDRIVE); `offset_t` counts along +t from the lane centre (OpenSCENARIO ``LanePosition/@offset``). They are converted
here and nowhere else. In every call `road` is the int32 INDEX of a road in `RoadNetwork.road_ids`.

Batch calls take scalars or arrays that broadcast, and answer with arrays. Names that end in ``_at`` take and give plain
floats and are made for stepping one vehicle at a time: a few microseconds each, without numpy.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from xosc_lateral.road.positions import (
    Advance,
    FloatArray,
    IntArray,
    LaneInfo,
    LaneLink,
    LanePosition,
    LanePositions,
    LaneState,
    Pose,
    Poses,
    RoadMark,
    RouteStep,
)

# Lane types that vehicles follow (and that world positions snap to).
DRIVING: frozenset[str] = frozenset(
    {
        "driving",
        "entry",
        "exit",
        "onRamp",
        "offRamp",
        "connectingRamp",
        "slipLane",
        "bidirectional",
        "bus",
        "taxi",
        "HOV",
    }
)

Chooser = Callable[[Sequence[LaneLink]], LaneLink]


@dataclass(frozen=True, eq=False)
class RoadNetwork:
    """Roads, their lanes and their links, as read from one OpenDRIVE file.

    Attributes
    ----------
    roads : tuple of Road
    road_ids : tuple of str
        ``road/@id`` in file order.
    path : str
        The file.
    notes : tuple of str
        What was repaired, ignored or degenerate on reading: never silent.
    """

    # ---- names and signs ---------------------------------------------------------------------------------------------
    def index_of(self, road_id: str) -> int:
        """Index of a road by its OpenDRIVE id; raises `PlaybackError` naming the id."""
        raise NotImplementedError

    def travel_direction(self, road: int, lane: int) -> int:
        """+1: the lane is driven along s, -1: against s. Lane id and ``road/@rule`` (RHT, LHT) decide."""
        raise NotImplementedError

    def travel_directions(self, road: ArrayLike, lane: ArrayLike) -> IntArray:
        """`travel_direction` for arrays."""
        raise NotImplementedError

    def offset_to_t(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike) -> FloatArray:
        """Offset to the left of travel -> t from the reference line. [m]"""
        raise NotImplementedError

    def t_to_offset(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, t: ArrayLike) -> FloatArray:
        """Inverse of `offset_to_t`."""
        raise NotImplementedError

    def offset_from_offset_t(self, road: int, lane: int, offset_t: float) -> float:
        """OpenSCENARIO's LanePosition offset (along +t) -> offset (left of travel); its own inverse."""
        raise NotImplementedError

    # ---- batch: road and lane to world -------------------------------------------------------------------------------
    def lane_to_world(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike = 0.0) -> Poses:
        """World poses; heading, pitch and roll are those of driving along the lane (slope of the lane centre included).

        `s` outside the road is clamped to its ends. Raises `PlaybackError` for a lane that is not there, naming it.
        """
        raise NotImplementedError

    def road_to_world(self, road: ArrayLike, s: ArrayLike, t: ArrayLike = 0.0) -> Poses:
        """World poses; heading along the reference line (+s)."""
        raise NotImplementedError

    # ---- batch: world to lane ----------------------------------------------------------------------------------------
    def world_to_lane(
        self,
        x: ArrayLike,
        y: ArrayLike,
        z: ArrayLike | None = None,
        heading: ArrayLike | None = None,
        *,
        near: Sequence[int] | None = None,
        lane_types: Collection[str] | None = DRIVING,
    ) -> LanePositions:
        """Nearest lane of the given types (None: any) under each point.

        `z` tells roads on top of each other apart; `heading` prefers lanes driven that way; `near` limits the search to
        those roads. Everything is found, however far off: look at `distance`.
        """
        raise NotImplementedError

    def path_to_lane(
        self,
        x: ArrayLike,
        y: ArrayLike,
        road: ArrayLike,
        s: ArrayLike,
        *,
        lane_types: Collection[str] | None = DRIVING,
    ) -> LanePositions:
        """Like `world_to_lane`, on known roads and from a guess of `s` per point (a written path, say): cheap."""
        raise NotImplementedError

    # ---- batch: what a lane is like ----------------------------------------------------------------------------------
    def lane_centre_t(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """T of the lane centre. [m]"""
        raise NotImplementedError

    def lane_width(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Width of the lane. [m]"""
        raise NotImplementedError

    def lane_edges_t(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """T of the lane's edges to the left and to the right of TRAVEL. [m]"""
        raise NotImplementedError

    def curvature(self, road: ArrayLike, s: ArrayLike) -> FloatArray:
        """Curvature of the reference line along +s, positive in left turns. [1/m]"""
        raise NotImplementedError

    def lane_curvature(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike, offset: ArrayLike = 0.0) -> FloatArray:
        """Curvature of the driven path parallel to the reference line, positive turning left in TRAVEL. [1/m]"""
        raise NotImplementedError

    def lane_index(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> tuple[IntArray, IntArray]:
        """Index among the driving lanes of its direction (0 = rightmost in travel direction), and their count.

        Index -1 for a lane that is no driving lane.
        """
        raise NotImplementedError

    def crossfall(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Cross slope seen in travel direction, positive when the road falls to the RIGHT. [%]"""
        raise NotImplementedError

    def grade(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Slope along travel, positive uphill. [%]"""
        raise NotImplementedError

    def speed_limit(self, road: ArrayLike, lane: ArrayLike, s: ArrayLike) -> FloatArray:
        """Speed limit of the lane, else of the road; inf where none is given. [m/s]"""
        raise NotImplementedError

    # ---- one place at a time, fast -----------------------------------------------------------------------------------
    def pose_at(self, road: int, lane: int, s: float, offset: float = 0.0) -> Pose:
        """`lane_to_world` of one place."""
        raise NotImplementedError

    def road_pose_at(self, road: int, s: float, t: float = 0.0) -> Pose:
        """`road_to_world` of one place."""
        raise NotImplementedError

    def curvature_at(self, road: int, s: float) -> float:
        """`curvature` of one place. [1/m]"""
        raise NotImplementedError

    def lane_state_at(self, road: int, lane: int, s: float) -> LaneState:
        """Centre t, its slope along s, and width of a lane; raises `PlaybackError` for a lane that is not there."""
        raise NotImplementedError

    def lanes_at(self, road: int, s: float) -> tuple[LaneInfo, ...]:
        """All lanes of the cross-section but the centre lane 0, from left to right looking along s."""
        raise NotImplementedError

    def has_lane_at(self, road: int, lane: int, s: float) -> bool:
        """Whether the lane exists there."""
        raise NotImplementedError

    def lane_type_at(self, road: int, lane: int, s: float) -> str:
        """The lane's type in the words of OpenDRIVE; raises `PlaybackError` for a lane that is not there."""
        raise NotImplementedError

    def lane_at(self, road: int, s: float, t: float, *, lane_types: Collection[str] | None = DRIVING) -> LanePosition:
        """The lane of these types that holds `t`, else the nearest one; lane 0 if the road has none of them there."""
        raise NotImplementedError

    def section_at(self, road: int, s: float) -> tuple[float, float]:
        """Start and end s of the lane section. [m]"""
        raise NotImplementedError

    def world_to_lane_at(
        self,
        x: float,
        y: float,
        z: float | None = None,
        heading: float | None = None,
        *,
        near: tuple[int, float] | None = None,
        lane_types: Collection[str] | None = DRIVING,
    ) -> LanePosition:
        """`world_to_lane` of one point; `near` = (road, s) where it was a moment ago makes it cheap."""
        raise NotImplementedError

    # ---- where lanes lead --------------------------------------------------------------------------------------------
    def next_lanes(self, road: int, lane: int, direction: int) -> tuple[LaneLink, ...]:
        """Lanes that follow when leaving the road at its end (direction +1) or at its start (-1).

        `lane` is its id in the road's last (first) section. Several at a junction, none where the lane ends.
        """
        raise NotImplementedError

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
        """Move along s by `distance` [m] (negative: backwards), following lane links over sections, roads and junctions.

        `direction` of positive distance: +1 along s, -1 against; default the lane's travel direction. `choose` picks
        one of several links; default the straightest. Ends at the lane's end, saying what remains.
        """
        raise NotImplementedError

    def straightest(self, options: Sequence[LaneLink]) -> LaneLink:
        """The link whose road turns least from entry to exit; of equals the first."""
        raise NotImplementedError

    def path_distance(
        self,
        start: tuple[int, float],
        end: tuple[int, float],
        *,
        direction: int = 1,
        limit: float = float("inf"),
    ) -> float | None:
        """Shortest signed distance along the reference lines of linked roads between two (road, s).

        Positive when the path leaves `start` in `direction` (+1 along s, -1 against s), negative when it leaves the other
        way. None: no path within `limit` metres.
        """
        raise NotImplementedError

    def route(
        self, start: tuple[int, int, float], end: tuple[int, int, float], *, via: Sequence[tuple[int, int, float]] = ()
    ) -> tuple[RouteStep, ...] | None:
        """Shortest drivable way over roads and junctions between two (road, lane, s), in the lanes' travel directions.

        None: there is none.
        """
        raise NotImplementedError

    # ---- to be seen --------------------------------------------------------------------------------------------------
    def road_marks(self, road: int) -> tuple[RoadMark, ...]:
        """Markings at the outer edges of all lanes, lane 0 included, of one road."""
        raise NotImplementedError

    def mark_line(self, road: int, mark: RoadMark, *, step: float = 2.0) -> tuple[FloatArray, FloatArray]:
        """Polyline x, y of a marking, for plots. [m]"""
        raise NotImplementedError


__all__ = ["DRIVING", "Chooser", "RoadNetwork"]
