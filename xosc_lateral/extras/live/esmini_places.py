"""Where esmini has its vehicles in their lanes, and whose place that is.

A driver's place is the centre of his home lane, plus the base, which the player's own lateral actions leave, plus his
own offset. The home lane changes with the road, with a lateral action or where it ends, not by drifting over a marking.
Who is not ours has no base: where he is in his lane, he deviates. What the player says of a place that it was told is
compared with it: it keeps it to the bit; where it doesn't, something moves the vehicle that is no lateral action of the
scenario, and it is left alone until that rests.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from xosc_lateral.extras.live.esmini_library import ObjectState
from xosc_lateral.extras.live.paths import STANDSTILL
from xosc_lateral.world.road.network import RoadNetwork

LANE_STEP = 0.5
"""By more than this the offset changes when another lane is under a vehicle; at joints of roads it does by less. [m]"""

MOVED, RESTING = 0.01, 0.2
"""A vehicle farther from where it was told to be is moved by somebody else [m], until it has kept still so long [s]."""

SAME_PLACE = 0.05
"""A maneuver that moves a vehicle further in its first step starts without the driver's offset, or elsewhere. [m]"""

KEPT_PLACE = 1e-6
"""So well does a vehicle keep its place in the lane that nobody moves. [m]"""


@dataclass(slots=True)
class Rest:
    """What is left of a driver's lateral speed, and of his offset where a trajectory starts without it."""

    gap: float  # From where the maneuver has put the vehicle, when it started. [m]
    rate: float  # Then, by the driver's own clock, as all that follows. [m/s]
    over: float  # It runs out over so long. [s]
    passed: float = 0.0  # [s]
    way: float = 0.0  # Beside the maneuver so far. [m]


class Lane(NamedTuple):
    """A vehicle's home lane, where it is."""

    place: tuple[int, int]  # Road and lane.
    is_lane: bool
    is_driving: bool
    left: float  # +1 where +t is to the left of where the vehicle drives, else -1.
    width: float  # [m]
    heading: float  # Of travel. [rad]


class ToldPlace(NamedTuple):
    """What the player was told of a vehicle's place."""

    road: int
    lane: int  # That the player has it on.
    t: float  # [m]
    offset_t: float  # From that lane's centre. [m]


@dataclass(slots=True)
class Vehicle:
    """What is known of one from step to step."""

    base: float | None = None  # [m]
    home: tuple[int, float, int] | None = None  # Road, where its lane section begins [m], lane.
    lane: Lane | None = None
    rest: Rest | None = None
    told_place: ToldPlace | None = None
    foreign: tuple[float, float] | None = None  # Left alone until [s]; offset along t when last seen [m].
    last: tuple[float, int, float] | None = None  # Time [s], road and s [m] a step ago.
    place: float | None = None  # Offset from the home lane's centre that it was given. [m]
    steered: bool = False
    rate: float = 0.0  # Of its driver. [m/s]


class Place(NamedTuple):
    """Where a vehicle is, by its home lane."""

    road: int  # -1: none that there is.
    lane: int
    centre: float  # Lateral coordinate of the home lane's centre. [m]
    left: float
    width: float
    heading: float
    offset: float  # From that centre, positive LEFT of travel. [m]
    base: float  # [m]
    is_free: bool  # A lane to drive in, and nobody but a driver moves it sideways.


class Ledger:
    """Who is where; `say` is told what a user has to know once: vehicle and kind, and a line."""

    def __init__(self, network: RoadNetwork, say: Callable[[tuple[str, str], str], None]) -> None:
        self.network, self._say = network, say
        self._roads = {name: index for index, name in enumerate(network.road_ids)}
        self.vehicles: dict[str, Vehicle] = {}

    def road_of(self, state: ObjectState) -> int:
        """Index of the road; -1: none that there is."""
        return self._roads.get(str(state.road), -1)

    def left_of(self, state: ObjectState) -> float:
        """+1 where +t is to the left of where a vehicle drives, on whichever lane it is, else -1."""
        road, network = self.road_of(state), self.network
        if road < 0:
            return 1.0
        left = float(network.travel_direction(road, state.lane))
        if state.lane == 0 or not network.has_lane_at(road, state.lane, state.s):
            return left
        ahead = network.pose_at(road, state.lane, state.s).heading + network.header_offset.heading
        return left if np.cos(state.h - ahead) >= 0.0 else -left

    def apart(self, told_place: ToldPlace, state: ObjectState) -> float:
        """How far a vehicle is from where the player was told to have it, in the road's course or its lane's. [m]"""
        if told_place.road != self.road_of(state):
            return (
                0.0 if state.lane == told_place.lane and abs(state.offset_t - told_place.offset_t) <= MOVED else np.inf
            )
        apart = abs(state.t - told_place.t)
        return float(min(apart, abs(state.offset_t - told_place.offset_t)) if state.lane == told_place.lane else apart)

    def dropped(self, known: Vehicle, state: ObjectState) -> float | None:
        """The driver's offset that a maneuver has dropped as it started; None: it has put the vehicle elsewhere. [m]"""
        if (told_place := known.told_place) is None or self.apart(told_place, state) <= SAME_PLACE:
            return None if told_place is None else 0.0
        offset = (known.place or 0.0) - (known.base or 0.0)
        is_near = self.apart(told_place._replace(t=told_place.t - self.left_of(state) * offset), state) < LANE_STEP
        return offset if is_near else None

    def room_to_middle(self, state: ObjectState) -> float:
        """How far a vehicle is from lane 0, on the side of the lane that it is on; below 0: it is across. [m]"""
        road, side = self.road_of(state), 1 if state.lane > 0 else -1
        if road < 0 or not self.network.has_lane_at(road, side, state.s):
            return float("inf")
        inner = self.network.lane_state_at(road, side, state.s)
        return float(side * (state.t - inner.centre_t) + 0.5 * inner.width)

    def place(self, name: str, state: ObjectState, now: float, *, in_action: bool, is_ours: bool, anew: bool) -> Place:
        """Where a vehicle is now [s]; `anew`: lane widths and headings are looked up again."""
        known, road = self.vehicles.setdefault(name, Vehicle()), self.road_of(state)
        if in_action:
            known.told_place = known.foreign = None
        is_moved = in_action or self._is_foreign(name, known, state, road, now)
        home = self._home(known, state, road, is_moved)
        if known.lane is None or anew or known.lane.place != (road, home):
            known.lane = self._lane(state, road, home)
        lane, centre = known.lane, state.t - state.offset_t
        if lane.is_lane and home != state.lane:
            home_centre, lane_centre = (
                self.network.lane_state_at(road, one, state.s).centre_t for one in (home, state.lane)
            )
            centre += home_centre - lane_centre
        offset = (state.t - centre) * lane.left
        if not is_ours:
            known.base = 0.0
        elif is_moved or known.base is None or known.place is None:
            known.base = offset - (known.rest.way if known.rest is not None else 0.0)
        elif abs(shift := offset - known.place) > LANE_STEP:
            known.base += shift  # another lane is under it: it stays where it is
        at_end = self._is_at_an_end(known, state, road, now) and not is_moved
        if at_end and is_ours:
            line = f"vehicle {name!r}: at the end of its road from {now:.2f} s on, where its speed still reads"
            self._say((name, "end"), f"{line} {state.speed:.1f} m/s; it is not steered there")
        is_across = abs(state.offset_t) > 0.5 * lane.width and self.room_to_middle(state) < 0.0  # as it is written
        is_free = lane.is_driving and not is_moved and not at_end and not is_across
        return Place(
            road if lane.is_lane else -1, home, centre, lane.left, lane.width, lane.heading, offset, known.base, is_free
        )

    def _home(self, known: Vehicle, state: ObjectState, road: int, is_moved: bool) -> int:
        """The home lane."""
        if road < 0:
            known.home = None
            return int(state.lane)
        section, home = float(self.network.section_at(road, state.s)[0]), int(state.lane)
        if known.home is not None and known.place is not None and known.steered and not is_moved:
            if known.home[:2] == (road, section):
                return known.home[2]
            before = state.t - self.left_of(state) * known.place  # where the centre of the lane that was home goes on
            home = self.network.lane_at(road, state.s, before).lane or home
        known.home = (road, section, home)
        return home

    def _lane(self, state: ObjectState, road: int, lane: int) -> Lane:
        network, where = self.network, (road, lane, state.s)
        if (
            road < 0
            or lane == 0
            or not network.has_lane_at(*where)
            or not network.has_lane_at(road, state.lane, state.s)
        ):
            return Lane((road, lane), False, False, self.left_of(state), 1.0, state.h)
        width = float(network.lane_width(*where))
        is_driving = bool(network.lane_index(*where)[0] >= 0) and width > 0.0
        heading = network.pose_at(*where).heading + network.header_offset.heading  # x and y are inertial
        return Lane((road, lane), True, is_driving, self.left_of(state), max(width, 1e-3), heading)

    def _is_foreign(self, name: str, known: Vehicle, state: ObjectState, road: int, now: float) -> bool:
        """Whether something unknown moves it sideways."""
        told_place, foreign = known.told_place, known.foreign
        known.told_place = known.foreign = None
        if told_place is not None and told_place.road == road:
            if self.apart(told_place, state) > MOVED:
                foreign = (now + RESTING, state.offset_t)
                line = f"vehicle {name!r}: moved sideways from {now:.2f} s on, by no lateral action of the scenario"
                self._say((name, "moved"), f"{line}; it is left alone until that rests")
        elif foreign is not None and abs(state.offset_t - foreign[1]) > KEPT_PLACE:
            foreign = (now + RESTING, state.offset_t)
        if foreign is None or now >= foreign[0]:
            return False
        known.foreign = (foreign[0], state.offset_t)
        return True

    def _is_at_an_end(self, known: Vehicle, state: ObjectState, road: int, now: float) -> bool:
        """Whether it has a speed and gets no further."""
        last, known.last = known.last, (now, road, state.s)
        stays = last is not None and last[0] < now and last[1:] == (road, state.s)
        return stays and abs(state.speed) > STANDSTILL
