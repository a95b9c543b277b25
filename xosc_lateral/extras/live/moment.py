"""What every driver sees at one moment: the road, and the vehicles around from where they are.

Gaps and sides are those of `around`, as in `context`, there for one vehicle at many moments, here for many at one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.surroundings import around
from xosc_lateral.world.surroundings.context import lanes_beside, road_columns, spread_out
from xosc_lateral.world.surroundings.give_way import FADE_DISTANCE, REACH_MARGIN, BodyFrame, Response, moved_aside


class Roads(Protocol):
    """The roads of a simulation: as an OpenDRIVE file or the simulation itself has them."""

    def columns(self, road: IntArray, lane: IntArray, s: FloatArray) -> dict[str, FloatArray]:
        """Context columns of places on lanes, shape (n,) each, as `surroundings.context.road_columns` has them."""

    def section(self, road: int, lane: int, s: float) -> float:
        """Where the lane section begins that a place is in: places of one section share a path. [m]"""

    def path(self, road: int, lane: int, s: float) -> list[around.LaneStretch]:
        """Lane sections within reach along the lane, both ways."""

    def across(
        self, road: IntArray, lane: IntArray, s: FloatArray, offset: FloatArray
    ) -> tuple[FloatArray, NDArray[np.integer]]:
        """Lateral coordinate t on the road of places so far from their lanes' centres [m], and +1 where the lane is
        driven along s, -1 against it, shape (n,) each.
        """

    def centre(self, road: int, lane: int, s: FloatArray) -> FloatArray:
        """The same of one lane's centre, shape (n,). [m]"""


@dataclass(frozen=True, slots=True)
class OpenDriveRoads:
    """Those of an OpenDRIVE file; roads by their index in the network."""

    network: RoadNetwork

    def columns(self, road: IntArray, lane: IntArray, s: FloatArray) -> dict[str, FloatArray]:
        """See `Roads`."""
        return road_columns(self.network, road, lane, s, np.zeros(len(s)), np.ones(len(s)))

    def section(self, road: int, lane: int, s: float) -> float:
        """See `Roads`."""
        return self.network.section_at(road, s)[0]

    def path(self, road: int, lane: int, s: float) -> list[around.LaneStretch]:
        """See `Roads`."""
        return around.lane_path(self.network, road, lane, s, self.network.travel_direction(road, lane))

    def across(
        self, road: IntArray, lane: IntArray, s: FloatArray, offset: FloatArray
    ) -> tuple[FloatArray, NDArray[np.integer]]:
        """See `Roads`."""
        profile = self.network.lane_profile(road, lane, s)
        return profile.centre + profile.direction * offset, profile.direction

    def centre(self, road: int, lane: int, s: FloatArray) -> FloatArray:
        """See `Roads`."""
        return self.network.lane_centre_t(road, lane, s)


@dataclass(frozen=True, eq=False, slots=True)
class Places:
    """Where vehicles are at one moment, shape (n,) each."""

    x: FloatArray
    y: FloatArray
    heading: FloatArray
    """Reference point [m] and the lane's direction of travel there. [rad]"""
    road: IntArray
    lane: IntArray
    """Index of the road, -1 for none; lane id."""
    s: FloatArray
    """Along the road. [m]"""
    length: FloatArray
    width: FloatArray
    center_x: FloatArray
    """Of the bounding box, and how far its middle is ahead of the reference point. [m]"""
    unit: IntArray | None = None
    """The same for a vehicle and what it pulls: they don't see each other."""

    def apart(self, vehicle: IntArray, other: IntArray) -> BoolArray:
        """Pairs that are no vehicle and its own trailer."""
        if self.unit is None:
            return np.ones(len(vehicle), dtype=np.bool_)
        return np.asarray(self.unit[vehicle] != self.unit[other])


def look_around(roads: Roads, places: Places, offset: FloatArray, is_truck: BoolArray) -> dict[str, FloatArray]:
    """Context columns of the road and of the vehicles around, shape (n,) each; NaN off the road.

    A conversion knows what comes, and has the road's columns as means over the way around; here they are as they are.
    """
    n = len(places.x)
    there = (places.road >= 0) & (places.lane != 0)
    on = np.flatnonzero(there)
    where = (places.road[on], places.lane[on], places.s[on])
    road = {name: spread_out(values, there) for name, values in roads.columns(*where).items()}
    direction, t = np.ones(n, dtype=np.int64), np.full(n, np.nan)
    t[on], direction[on] = roads.across(*where, offset[on])
    width = np.maximum(np.fmax(road["lane_width"], places.width), 0.1)
    nearby, (u, i, j, paths) = around.NearestVehicles.with_no_one(n), _along_paths(roads, places, on)
    seen = around.OtherVehicles(np.full(len(i), np.nan), np.full(len(i), np.nan), np.zeros(len(i), dtype=np.bool_))
    for path, part in paths:
        in_view = around.see_along(
            path, u[i[part]], offset[i[part]], places.road, places.s, t, direction, roads.centre, j[part]
        )
        for values, theirs in zip(seen, in_view, strict=True):
            values[part] = theirs
    gap = around.free_space(seen, *(around.Extent(places.length[k], places.center_x[k]) for k in (i, j)))
    k = np.flatnonzero(gap <= around.SIGHT_DISTANCE)  # most are not: in a straight line one looks further
    seen = around.OtherVehicles(seen.ahead[k], seen.left[k], seen.oncoming[k])
    nearby.add(i[k], seen, gap[k], width[i[k]], places.width[j[k]], is_truck[j[k]])
    lanes = {side: is_there.astype(np.float64) for side, is_there in lanes_beside(road).items()}
    return road | nearby.columns(lanes, always_fade=True)


def _along_paths(
    roads: Roads, places: Places, on: IntArray
) -> tuple[FloatArray, IntArray, IntArray, list[tuple[list[around.LaneStretch], slice]]]:
    """Where everybody is along the own lane path [m], pairs of one and another in sight, and of every lane path which
    pairs look along it.
    """
    u, group = np.zeros(len(places.x)), np.full(len(places.x), -1)
    origins: dict[tuple[int, int, float], tuple[int, float, list[around.LaneStretch]]] = {}
    where = (column[on].tolist() for column in (places.road, places.lane, places.s))
    for k, road, lane, s in zip(on.tolist(), *where, strict=True):
        key = (road, lane, roads.section(road, lane, s))
        if key not in origins:
            origins[key] = (len(origins), s, roads.path(road, lane, s))
        group[k], start, path = origins[key]
        u[k] = path[0].sign * (s - start)
    a, b = around.pairs_now(np.where(group >= 0, places.x, np.nan), places.y, around.IN_SIGHT)
    apart = places.apart(a, b)
    a, b = a[apart], b[apart]
    vehicle, other = np.concatenate([a, b]), np.concatenate([b, a])
    order = np.argsort(group[vehicle], kind="stable")
    vehicle, other = vehicle[order], other[order]
    ends = np.searchsorted(group[vehicle], np.arange(len(origins) + 1))
    parts = zip(ends[:-1].tolist(), ends[1:].tolist(), origins.values(), strict=True)
    return u, vehicle, other, [(path, slice(first, end)) for first, end, (_, _, path) in parts if first < end]


def give_way_now(
    places: Places,
    lateral: FloatArray,
    deviation: FloatArray,
    can_move: BoolArray,
    response: Response,
    *,
    left_hand: bool,
) -> FloatArray:
    """How far each moves aside from those beside it, as `give_way` says, at once: positive left, shape (n,). [m]

    `lateral` and `deviation` from the lane's centre, as it is and without what one has moved aside, 0 in a maneuver
    [m]; `can_move`: there is a driver, who follows the road; shape (n,) each.
    """
    n = len(places.x)
    cos, sin = np.cos(places.heading), np.sin(places.heading)
    x, y = (axis + places.center_x * part for axis, part in ((places.x, cos), (places.y, sin)))
    a, b = around.pairs_now(x, y, FADE_DISTANCE + float(places.length.max(initial=0.0)) + REACH_MARGIN)
    apart = places.apart(a, b)
    a, b = a[apart], b[apart]
    vehicle, other = np.concatenate([a, b]), np.concatenate([b, a])
    vehicle, other = vehicle[can_move[vehicle]], other[can_move[vehicle]]
    x, y = x + lateral * sin, y - lateral * cos  # on the lane's centre line, from which a deviation counts
    columns = (x, y, places.heading, deviation, can_move, places.length, places.width)
    first, second = (BodyFrame._make(column[one] for column in columns) for one in (vehicle, other))
    aside = moved_aside(first, second, Response._make(column[vehicle] for column in response), left_hand)
    left, right = np.zeros((2, n))
    np.maximum.at(right, vehicle, np.maximum(0.0 - aside, 0.0))
    np.maximum.at(left, vehicle, np.maximum(aside, 0.0))
    return left - right
