"""An entity's nominal way over the roads, also beyond the run's end; and where no path leads on.

A path whose places are found from where it begins goes straight on at junctions, keeps its direction along s, and ends
with the road. So it ends before a junction where the way turns, a joint with a road of the opposite s, and where the
lane ends; behind, the next one begins.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.world.motion.nominal import EntityMotion
from xosc_lateral.world.motion.trajectory import distance_driven
from xosc_lateral.world.road.network import RoadNetwork

SPACING = 5.0
"""Between places beyond the run's end. [m]"""
LANE_ENDS = "the lane ends"
LEAP = 0.8
"""Sideways between two places: no lateral action is as fast, but who follows a lane that ends. [m]"""
CLEARANCE = 10.0
"""A path begins so far behind the begin of its road. [m]"""


class RoadPlace(NamedTuple):
    """A place beside a road's reference line."""

    road: str
    s: float  # [m]
    t: float  # [m]


class Break(NamedTuple):
    """Where no path leads on."""

    distance: float  # along the way [m]
    place: RoadPlace
    behind: float  # where the next one begins [m]; infinite: nowhere
    lanes: tuple[RoadPlace, ...]  # there, in each lane
    side: float  # there: +1 along s, -1 against it
    why: str


class Way(NamedTuple):
    """Places along the way, shape (n,) each, and where no path leads on."""

    distance: FloatArray  # from the run's begin [m]
    road: IntArray
    lane: IntArray
    s: FloatArray  # [m]
    side: FloatArray  # +1: it is driven along s, -1: against it
    offset: FloatArray  # the nominal one, positive to the left of the lane's travel [m]
    breaks: tuple[Break, ...]

    def points(self, network: RoadNetwork, at: FloatArray, aside: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Places in the plane at distances along the way, and ways from there aside to the left, shape (2, n). [m]"""
        k = np.clip(np.searchsorted(self.distance, at, side="right") - 1, 0, len(self.distance) - 2)
        room, ahead = self.distance[k + 1] - self.distance[k], at - self.distance[k]
        is_one_road = (self.road[k] == self.road[k + 1]) & (room > 0.0)
        step = np.where(is_one_road, (self.s[k + 1] - self.s[k]) / np.where(room > 0.0, room, 1.0), self.side[k])
        road, lane, offset = self.road[k], self.lane[k], self.offset[k]
        left = self.side[k] * network.travel_directions(road, lane)
        points = network.lane_points(road, lane, self.s[k] + step * ahead, offset, offset + left * aside)
        nominal, there = (np.stack(point[:2]) for point in points)
        return nominal, there - nominal

    def along(self, at: FloatArray) -> FloatArray:
        """Ways along the roads' reference lines, on which bends are longer or shorter, at distances along it. [m]"""
        steps = np.where(np.diff(self.road) == 0, np.abs(np.diff(self.s)), np.diff(self.distance))
        return np.asarray(np.interp(at, self.distance, np.concatenate((self.distance[:1], steps)).cumsum()))

    def side_at(self, distance: float) -> float:
        """+1: along s, -1: against it."""
        return float(self.side[max(int(np.searchsorted(self.distance, distance, side="right")) - 1, 0)])

    def span_at(self, distance: float) -> tuple[float, float]:
        """Distances between which it runs the same way along s as there; open where it does to its begin or end."""
        row = max(int(np.searchsorted(self.distance, distance, side="right")) - 1, 0)
        turns = np.flatnonzero(np.diff(self.side) != 0)
        before, behind = turns[turns < row], turns[turns >= row]
        first = float(self.distance[before[-1] + 1]) if len(before) else 0.0
        return first, float(self.distance[behind[0]]) if len(behind) else np.inf

    def next_break(self, distance: float) -> Break | None:
        """The first one ahead."""
        return next((one for one in self.breaks if one.distance > distance), None)


def way_of(motion: EntityMotion, network: RoadNetwork, length: float, *, has_route: bool) -> Way:
    """The way of an entity over a length [m]; where it `has_route`, junctions beyond the run's end are not known."""
    rows = np.flatnonzero(motion.road >= 0)
    rows = rows[:: max(1, round(0.1 / (motion.time[1] - motion.time[0])))]
    entered = np.flatnonzero(np.diff(motion.road) != 0)  # both rows of each joint
    rows = np.unique(np.concatenate((rows, entered, entered + 1)))
    rows = rows[motion.road[rows] >= 0]
    ways = network.travel_directions(motion.road[rows], motion.lane[rows]) * motion.way(rows)
    driven, anew = distance_driven(motion)[rows], np.isin(rows, motion.breaks)
    driven_rows = list(zip(driven, motion.road[rows], motion.lane[rows], motion.s[rows], ways, strict=True))
    offset = motion.offset[rows]
    beyond, ends = _onward(network, driven_rows[-1], length, has_route) if driven_rows else ([], False)
    distance, road, lane, s, side = np.array([*driven_rows, *beyond], dtype=np.float64).reshape(-1, 5).T
    offset = np.append(offset, np.full(len(beyond), offset[-1] if len(offset) else 0.0))
    way = Way(distance, road.astype(np.int64), lane.astype(np.int64), s, side, offset, ())
    return way._replace(breaks=tuple(_breaks(way, network, np.append(anew, np.zeros(len(beyond), bool)), ends)))


Row = tuple[float, int, int, float, int]
"""Distance, road, lane, s, and the way along s."""


def _onward(network: RoadNetwork, last: Row, length: float, has_route: bool) -> tuple[list[Row], bool]:
    """Places beyond the last one, straight on; whether the lane ends there, or what comes is not known."""
    distance, road, lane, s, way = float(last[0]), int(last[1]), int(last[2]), float(last[3]), int(last[4])
    rows: list[Row] = []
    while distance < length and lane:
        moved = network.advance(road, lane, s, SPACING, direction=way)
        unknown = has_route and moved.road != road and len(network.next_lanes(road, lane, way)) > 1
        if not unknown:
            road, lane, s, way = moved[:4]
            distance += SPACING - moved.remaining
            rows.append((distance, road, lane, s, way))
        if unknown or moved.remaining > 0.0:
            return rows, True
    return rows, False


def _breaks(way: Way, network: RoadNetwork, anew: BoolArray, ends: bool) -> list[Break]:
    breaks: list[Break] = []
    again = 0
    t = network.offset_to_t(way.road, way.lane, way.s, way.offset)
    enters, leaps = np.diff(way.road) != 0, np.abs(np.diff(t)) > LEAP
    for k in np.flatnonzero(enters | leaps).tolist():
        if k < again or anew[k + 1]:
            continue
        why = _why(way, network, k) if enters[k] else LANE_ENDS
        if why:
            breaks.append(_break(way, network, k, why))
            again = int(np.searchsorted(way.distance, breaks[-1].behind))
    if ends and len(way.distance):
        breaks.append(_break(way, network, len(way.road) - 1, LANE_ENDS))
    return breaks


def _why(way: Way, network: RoadNetwork, k: int) -> str:
    """Why no path leads from one place to the next, on another road; empty: one does."""
    here, there, side = int(way.road[k]), int(way.road[k + 1]), int(way.side[k])
    if side != way.side[k + 1]:
        return "s runs the other way"
    options = network.next_lanes(here, int(way.lane[k]), side)
    if not options:
        return LANE_ENDS
    return "the way turns" if len(options) > 1 and network.straightest(options).road != there else ""


def _break(way: Way, network: RoadNetwork, k: int, why: str) -> Break:
    """Behind place k; the next path begins on the first road that is no junction's."""
    t = network.lane_centre_t(way.road[k], way.lane[k], way.s[k])
    place = RoadPlace(network.road_ids[way.road[k]], float(way.s[k]), float(t))
    distance = float(way.distance[k])
    entered = k + 1
    for j in range(k + 1, len(way.road)):
        if way.road[j] != way.road[entered]:
            entered = j
        road = int(way.road[j])
        if network.roads[road].junction is None and way.distance[j] >= way.distance[entered] + CLEARANCE:
            lanes = (
                RoadPlace(network.road_ids[road], float(way.s[j]), lane.centre_t)
                for lane in network.lanes_at(road, float(way.s[j]))
                if lane.type == "driving"
            )
            return Break(distance, place, float(way.distance[j]), tuple(lanes), float(way.side[j]), why)
    return Break(distance, place, np.inf, (), 0.0, why)
