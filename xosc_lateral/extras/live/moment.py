"""One moment of every driver: what he sees, the road and the vehicles around, and where his vehicle goes from there.

Gaps and sides are those of `around`, as in `context`, there for one vehicle at many moments, here for many at one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.segment import LARGEST_HEADING, clock_rate, is_slow, way_of
from xosc_lateral.world.motion.driver_clock import leading_time
from xosc_lateral.world.motion.trajectory import settle, smoother_step
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.surroundings import around
from xosc_lateral.world.surroundings.context import STEERING_DURATION, lanes_beside, road_columns, spread_out
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


# ---- from a driver's curve to where his vehicle is: what leads over to his path, slow driving, moving aside ----
# A vehicle's path has no corner (`LARGEST_TURN_RATE`): where a maneuver has moved it, its path leads over from there to
# the driver's; below 40 km/h his movement has a slower clock (`base.segment`).
STANDSTILL = 0.1
"""Below this speed a path has no direction. [m/s]"""

SPEEDS_REMEMBERED = 5
"""Model steps of speed remembered: acceleration is over one second, as in a conversion. [-]"""

NEGLIGIBLE_REST = 1e-12
"""A lateral speed this small is none. [m/s]"""

LARGEST_SINE = float(np.sin(LARGEST_HEADING))
"""Lateral speed over speed, at most. [-]"""

CLOCK_TOLERANCE = 1e-9
"""Share of a model step that clocks may be off when steps of a simulation are added up. [-]"""

DRIVER = np.dtype(
    [("curve", float, 6), ("next", float, 6), ("ahead", bool), ("clock", float), ("own_rate", float), ("begun", bool),
     ("following", bool), ("place", float), ("rest", float), ("from", float), ("from_rate", float), ("share", float),
     ("over", float), ("aside", float), ("aside_rate", float), ("wanted", float), ("moved", bool),
     ("speeds", float, SPEEDS_REMEMBERED)]
)  # fmt: skip
"""A driver beside his random numbers.

His curve until his next model step, the one after it if that is `ahead`, how far on he is in it [-] and how fast he
moves sideways, by his own clock [m/s]; whether he has begun; whether the vehicle followed the road a step ago, and
where it was [m]; what leads over to his path: `rest` [m], from `from` [m] at `from_rate` [m/s], done to `share` [-] of
`over` [s]; how far he has moved aside, how fast, and how far he wants to; whether he has
ever driven; speeds of the last second.
"""


class Moves(NamedTuple):
    """Where drivers are, by the rows of the moment, shape (n,) each; where nobody of ours drives, as it was.

    Offset from the lane's centre, positive left [m], its rate [m/s], the heading relative to the lane, positive left
    [rad], and whether it is the driver's (else the simulation's, or there is none).
    """

    offset: FloatArray
    rate: FloatArray
    heading: FloatArray
    steered: BoolArray

    def by_name(self, names: Sequence[str]) -> dict[str, tuple[float, bool]]:
        """Offset [m], and whether it is the driver's, of each."""
        return dict(zip(names, zip(self.offset.tolist(), self.steered.tolist(), strict=True), strict=True))


def drive_on(
    state: NDArray[Any],
    step: float,
    passed: float | None,
    speed: FloatArray,
    offset: FloatArray,
    base: FloatArray,
    following: BoolArray,
) -> tuple[NDArray[Any], Moves]:
    """The drivers' states (`DRIVER`) and moves, shape (n,) each; a curve lasts a `step` of their own clocks. [s]

    After so much time [s], None at the simulation's first step; see `Moment` for speed [m/s], offset, base [m] and
    following.
    """
    is_first, passed = passed is None, passed or 0.0
    powers = np.clip(state["clock"], 0.0, 1.0)[:, None] ** np.arange(6)
    driver = (state["curve"] * powers).sum(axis=1)
    driver_rate = (state["curve"][:, 1:] * np.arange(1, 6) * powers[:, :-1]).sum(axis=1) / step
    pace = pace_of(speed, state["own_rate"])
    is_driven = following & state["begun"]
    taken_over = is_driven & ~state["following"]
    was_rate = np.where(passed > 0.0, (offset - state["place"]) / max(passed, 1e-9), 0.0)
    _move_aside(state, passed * pace)
    aside, aside_rate = state["aside"], state["aside_rate"]
    if is_first:  # who drives, began so; who is slow or stands stays where it is, and is led over as it drives off
        state["rest"][taken_over] = 0.0
        slow = taken_over & (pace < 1.0)
        _lead_over(state, slow, offset - base - driver - aside, np.zeros(len(state)), speed)
    elif taken_over.any():
        was_rate = np.where(np.abs(was_rate) < np.maximum(0.2 * np.abs(speed), 0.1), was_rate, 0.0)  # placed anew
        was_rate = np.where(state["place"] == 0.0, 0.0, was_rate)
        gap_rate = was_rate - (driver_rate + aside_rate) * pace
        gap = offset - base - driver - aside + (driver_rate + aside_rate) * pace * passed  # a step ago
        _lead_over(state, taken_over, gap, gap_rate, speed)
    own_rate = driver_rate + _settle(state, passed * pace) + aside_rate
    place = np.where(is_driven, base + driver + state["rest"] + aside, offset)
    rate = np.where(is_driven, own_rate * pace_of(speed, own_rate), was_rate * (passed > 0.0))
    moving = np.abs(speed) > STANDSTILL
    sine = np.divide(rate, speed, out=np.zeros(len(state)), where=moving)
    most = np.where(is_slow(speed), LARGEST_SINE, 1.0)
    # A car that stands is turned as it came to a stop: of its way in a second of the clock something is left.
    turned = np.where(speed < 0.0, -1.0, 1.0) * np.clip(own_rate / way_of(speed), -most, most)
    state["moved"] |= moving
    turned = np.where(state["moved"], turned, 0.0)  # and one that never moved is straight
    heading = np.arcsin(np.clip(np.where(is_driven, turned, sine), -1.0, 1.0))
    state["following"], state["place"], state["own_rate"] = is_driven, place, np.where(is_driven, own_rate, 0.0)
    return state, Moves(place, np.where(is_driven, rate, 0.0), np.where(is_driven, heading, 0.0), is_driven)


def pace_of(speed: FloatArray, own_rate: FloatArray) -> FloatArray:
    """Seconds of the drivers' clocks in one, shape as the speed [m/s] and their lateral speed by their clocks. [m/s]"""
    turning = LARGEST_SINE * np.abs(speed) / np.maximum(np.abs(own_rate), NEGLIGIBLE_REST)
    return np.asarray(np.where(is_slow(speed), np.minimum(clock_rate(speed), turning), 1.0))


def _move_aside(state: NDArray[Any], passed: FloatArray) -> None:
    """Two equal first-order lags towards what is wanted, solved exactly; drivers respond within `STEERING_DURATION`."""
    keep = np.exp(-passed / STEERING_DURATION)
    gap = state["aside"] - state["wanted"]
    drift = state["aside_rate"] + gap / STEERING_DURATION
    state["aside"] = state["wanted"] + (gap + drift * passed) * keep
    state["aside_rate"] = (drift - (gap + drift * passed) / STEERING_DURATION) * keep


def _lead_over(state: NDArray[Any], which: BoolArray, gap: FloatArray, rate: FloatArray, speed: FloatArray) -> None:
    """Begin to lead over from a gap [m] that changes at a rate [m/s], within what is no corner at this speed. [m/s]"""
    over = leading_time(gap, rate, speed)
    for name, values in (("from", gap), ("from_rate", rate), ("share", 0.0), ("over", over)):
        state[name] = np.where(which, values, state[name])


def left_of_gap(u: FloatArray, over: FloatArray, gap: FloatArray, rate: FloatArray) -> FloatArray:
    """What is left of a gap [m] at a share of the time that leading over takes [s], shape (n,). [m]"""
    return np.asarray(gap * (1.0 - smoother_step(u)) + settle(u * over, over, rate, 0.0))


def _settle(state: NDArray[Any], passed: FloatArray) -> FloatArray:
    """On with leading over; returns how fast what is left changes, shape (n,). [m/s]"""
    active = state["over"] > 0.0
    state["rest"] = np.where(active, state["rest"], 0.0)
    if not active.any():
        return np.zeros(len(state))
    over = np.where(active, state["over"], 1.0)
    share = state["share"] + passed / over
    done = active & (share >= 1.0)
    state["share"], state["over"] = np.where(active, share, 0.0), np.where(done, 0.0, state["over"])
    u = np.clip(share, 0.0, 1.0)
    by_level = -30.0 * u**2 * (1.0 - u) ** 2 / over
    by_slope = 1.0 - 18.0 * u**2 + 32.0 * u**3 - 15.0 * u**4
    rest = left_of_gap(u, over, state["from"], state["from_rate"])
    state["rest"] = np.where(active & ~done, rest, 0.0)
    return np.where(active & ~done, state["from"] * by_level + state["from_rate"] * by_slope, 0.0)
