"""Where esmini has its vehicles in their lanes, and whose place that is.

A driver's place is the centre of his home lane, plus the base, which the player's own lateral actions leave, plus his
own offset. The home lane changes with the road, with a lateral action or where it ends, not by drifting over a marking.
Who is not ours has no base: where he is in his lane, he deviates. What the player says of a place that it was told is
compared with it: it keeps it to the bit; where it doesn't, something moves the vehicle that is no lateral action of the
scenario, and it is left alone until that rests.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.extras.live.moment import STANDSTILL
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


NO_ROAD_YET = -2
"""In place of a road: nothing is known yet."""

KNOWN_VEHICLE = np.dtype(
    [("base", float), ("place", float), ("steered", bool), ("rate", float),
     ("home_road", np.int64), ("home_from", float), ("home_to", float), ("home", np.int64),
     ("lane_road", np.int64), ("lane", np.int64), ("is_lane", bool), ("is_driving", bool), ("left", float),
     ("width", float), ("heading", float),
     ("told", bool), ("told_road", np.int64), ("told_lane", np.int64), ("told_t", float), ("told_offset", float),
     ("foreign_until", float), ("foreign_offset", float),
     ("last_time", float), ("last_road", np.int64), ("last_s", float)]
)  # fmt: skip
"""What is known of a vehicle from step to step.

The base [m], the offset from the home lane's centre that it was given [m] (NaN: none yet), whether its driver has it,
and how fast he moves sideways [m/s]; its home: road, from where to where the lane section goes [m], lane; of that lane,
when it was looked up last: whether it is one and for driving, +1 where +t is to the left of where the vehicle drives,
width [m], heading of travel [rad]; what the player was told: road, the lane that the player has it on, t, and offset
from that lane's centre [m]; until when it is left alone [s], and its offset along t when last seen [m]; where it was a
step ago: time [s], road, s [m].
"""


def _new_vehicle() -> NDArray[Any]:
    """Of whom nothing is known yet, shape (1,)."""
    row = np.zeros(1, dtype=KNOWN_VEHICLE)
    row[["base", "place", "home_road", "lane_road", "foreign_until", "last_time"]] = (
        np.nan, np.nan, NO_ROAD_YET, NO_ROAD_YET, -np.inf, np.inf,
    )  # fmt: skip
    return row


class LivePlaces(NamedTuple):
    """Where vehicles are, by their home lanes, shape (n,) each."""

    road: IntArray  # -1: none that there is.
    lane: IntArray
    centre: FloatArray  # Lateral coordinate of the home lane's centre. [m]
    left: FloatArray
    width: FloatArray
    heading: FloatArray
    offset: FloatArray  # From that centre, positive LEFT of travel. [m]
    base: FloatArray  # [m]
    is_free: BoolArray  # A lane to drive in, and nobody but a driver moves it sideways.


class Ledger:
    """Who is where; `say` is told what a user has to know once: vehicle and kind, and a line.

    States are rows of the player's (`esmini_library.OBJECT_STATE`); `known` has a row for each of `names`.
    """

    def __init__(self, network: RoadNetwork, say: Callable[[tuple[str, str], str], None]) -> None:
        self.network, self._say = network, say
        numbers = {int(name): index for index, name in enumerate(network.road_ids) if name.isdecimal()}
        self._numbers = np.array(sorted(numbers), dtype=np.int64)
        self._indices = np.array([numbers[number] for number in sorted(numbers)], dtype=np.int64)
        self.names: tuple[str, ...] = ()
        self.known = np.zeros(0, dtype=KNOWN_VEHICLE)
        self.rests: dict[str, Rest] = {}

    def expect(self, names: tuple[str, ...]) -> None:
        """These vehicles are there: who is gone is forgotten, and begins anew where he is added again."""
        if names != self.names:
            before = {name: row for row, name in enumerate(self.names)}
            old = [before.get(name, len(self.names)) for name in names]
            self.names, self.known = names, np.concatenate([self.known, _new_vehicle()])[old]
            self.rests = {name: rest for name, rest in self.rests.items() if name in set(names)}

    # ---- lanes, of many places ---------------------------------------------------------------------------------------
    def roads_of(self, states: NDArray[Any]) -> IntArray:
        """Index of the road of each, shape (n,); -1: none that there is."""
        if not len(self._numbers):
            return np.full(len(states), -1)
        wanted = states["road"].astype(np.int64)
        at = np.minimum(np.searchsorted(self._numbers, wanted), len(self._numbers) - 1)
        return np.where(self._numbers[at] == wanted, self._indices[at], -1)

    def _has_lane(self, road: IntArray, lane: NDArray[np.integer], s: FloatArray) -> BoolArray:
        """Whether there is such a lane, shape (n,)."""
        places = zip(road.tolist(), lane.tolist(), s.tolist(), strict=True)
        return np.array(
            [index >= 0 and one != 0 and self.network.has_lane_at(index, one, at) for index, one, at in places],
            dtype=bool,
        )

    def _headings(self, road: IntArray, lane: NDArray[np.integer], s: FloatArray) -> FloatArray:
        """Of travel along lanes, in inertial coordinates as the player's. [rad]"""
        return self.network.lane_to_world(road, lane, s).heading + self.network.header_offset.heading

    def left_of(
        self, states: NDArray[Any], on_lane: BoolArray | None = None, heading: FloatArray | None = None
    ) -> FloatArray:
        """+1 where +t is to the left of where a vehicle drives, on whichever lane it is, else -1; shape (n,).

        `on_lane`, `heading` [rad]: whether there is that lane, and where it leads, where that is known already.
        """
        road, lane, left = self.roads_of(states), states["lane"], np.ones(len(states))
        on = road >= 0
        left[on] = self.network.travel_directions(road[on], lane[on])
        there = np.flatnonzero(self._has_lane(road, lane, states["s"]) if on_lane is None else on_lane)
        if len(there):
            ahead = self._headings(road[there], lane[there], states["s"][there]) if heading is None else heading[there]
            left[there] *= np.where(np.cos(states["h"][there] - ahead) >= 0.0, 1.0, -1.0)
        return left

    def room_to_middle(self, states: NDArray[Any]) -> FloatArray:
        """How far vehicles are from lane 0, on the side of the lane that each is on; below 0: it is across. [m]"""
        side, room, road = np.where(states["lane"] > 0, 1, -1), np.full(len(states), np.inf), self.roads_of(states)
        there = np.flatnonzero(self._has_lane(road, side, states["s"]))
        if len(there):
            inner = self.network.lane_profile(road[there], side[there], states["s"][there])
            room[there] = side[there] * (states["t"][there] - inner.centre) + 0.5 * inner.width
        return room

    # ---- what the player was told ------------------------------------------------------------------------------------
    def tell(self, rows: IntArray, states: NDArray[Any], t: FloatArray) -> None:
        """Note what the player is told: t of these vehicles. [m]"""
        self.known["told"][rows] = True
        values_told = {"told_road": self.roads_of(states), "told_lane": states["lane"], "told_t": t,
                "told_offset": states["offset_t"] + t - states["t"]}  # fmt: skip
        for name, values in values_told.items():
            self.known[name][rows] = values

    def dropped(self, row: int, states: NDArray[Any]) -> float | None:
        """The driver's offset that a maneuver has dropped as it started; None: it has put the vehicle elsewhere. [m]

        `states`: of this vehicle, shape (1,).
        """
        known = self.known[row : row + 1]
        if not known["told"][0]:
            return None
        if self._apart(known, states)[0] <= SAME_PLACE:
            return 0.0
        offset = float(np.nan_to_num(known["place"])[0] - np.nan_to_num(known["base"])[0])
        aside = known.copy()
        aside["told_t"] -= self.left_of(states) * offset
        return offset if self._apart(aside, states)[0] < LANE_STEP else None

    def _apart(self, known: NDArray[Any], states: NDArray[Any]) -> FloatArray:
        """How far vehicles are from where the player was told to have them, in the road's course or the lane's. [m]"""
        along_road = np.abs(states["t"] - known["told_t"])
        in_lane = np.abs(states["offset_t"] - known["told_offset"])
        same_lane = states["lane"] == known["told_lane"]
        on_another = np.where(same_lane & (in_lane <= MOVED), 0.0, np.inf)
        apart = np.where(same_lane, np.minimum(along_road, in_lane), along_road)
        return np.where(known["told_road"] == self.roads_of(states), apart, on_another)

    # ---- where everybody is ------------------------------------------------------------------------------------------
    def places(
        self, rows: IntArray, states: NDArray[Any], now: float, *, in_action: BoolArray, is_ours: BoolArray, anew: bool
    ) -> LivePlaces:
        """Where vehicles are now [s], `rows` of those that are known; `anew`: lanes are looked up again."""
        known, road = self.known[rows], self.roads_of(states)
        names = [self.names[row] for row in rows.tolist()]
        known["told"] &= ~in_action
        known["foreign_until"][in_action] = -np.inf
        is_moved = in_action | self._foreign(names, known, states, road, now)
        home = self._homes(known, states, road, is_moved)
        changed = (known["lane_road"] != road) | (known["lane"] != home)
        self._look_up(known, states, road, home, np.flatnonzero(changed | anew))
        centre = states["t"] - states["offset_t"]
        other = np.flatnonzero(known["is_lane"] & (home != states["lane"]))
        if len(other):
            lanes = (home[other], states["lane"][other])
            ours, under = (self.network.lane_centre_t(road[other], lane, states["s"][other]) for lane in lanes)
            centre[other] += ours - under
        offset = (states["t"] - centre) * known["left"]
        shift = np.nan_to_num(offset - known["place"])
        ways = {name: rest.way for name, rest in self.rests.items() if rest.way}
        begins = is_moved | np.isnan(known["base"]) | np.isnan(known["place"])
        way = np.array([ways.get(name, 0.0) for name in names]) if ways else 0.0
        # another lane is under it: it stays where it is
        kept = known["base"] + np.where(np.abs(shift) > LANE_STEP, shift, 0.0)
        known["base"] = np.where(is_ours, np.where(begins, offset - way, kept), 0.0)
        stays = (known["last_time"] < now) & (known["last_road"] == road) & (known["last_s"] == states["s"])
        at_end = stays & (np.abs(states["speed"]) > STANDSTILL) & ~is_moved
        known["last_time"], known["last_road"], known["last_s"] = now, road, states["s"]
        for k in np.flatnonzero(at_end & is_ours).tolist():
            line = f"vehicle {names[k]!r}: at the end of its road from {now:.2f} s on, where its speed still reads"
            self._say((names[k], "end"), f"{line} {states['speed'][k]:.1f} m/s; it is not steered there")
        is_across = np.abs(states["offset_t"]) > 0.5 * known["width"]
        if is_across.any():  # as it is written
            is_across[is_across] = self.room_to_middle(states[is_across]) < 0.0
        self.known[rows] = known
        return LivePlaces(
            np.where(known["is_lane"], road, -1), home, centre, known["left"], known["width"], known["heading"], offset,
            known["base"], known["is_driving"] & ~is_moved & ~at_end & ~is_across,
        )  # fmt: skip

    def _homes(self, known: NDArray[Any], states: NDArray[Any], road: IntArray, is_moved: BoolArray) -> IntArray:
        """The home lanes."""
        s, lane, was = states["s"], states["lane"].astype(np.int64), known["home_road"].copy()
        leads_on = (was >= 0) & ~np.isnan(known["place"]) & known["steered"] & ~is_moved
        inside = (was == road) & (known["home_from"] <= s) & (s < known["home_to"])
        home = np.where(leads_on & inside, known["home"], lane)
        for k in np.flatnonzero((road >= 0) & ~inside).tolist():
            begin, end = self.network.section_at(int(road[k]), float(s[k]))
            if leads_on[k] and was[k] == road[k] and known["home_from"][k] == begin:
                home[k] = known["home"][k]
            elif leads_on[k]:  # where the centre of the lane that was home goes on
                before = states["t"][k] - self.left_of(states[k : k + 1])[0] * known["place"][k]
                home[k] = self.network.lane_at(int(road[k]), float(s[k]), float(before)).lane or lane[k]
            known["home_from"][k], known["home_to"][k] = begin, end
        known["home_road"], known["home"] = np.where(road >= 0, road, NO_ROAD_YET), home
        return home

    def _look_up(
        self, known: NDArray[Any], states: NDArray[Any], road: IntArray, home: IntArray, rows: IntArray
    ) -> None:
        """Lanes of some rows."""
        if not len(rows):
            return
        states, road, home = states[rows], road[rows], home[rows]
        on_lane = self._has_lane(road, states["lane"], states["s"])
        is_lane, other = on_lane.copy(), home != states["lane"]
        is_lane[other] &= self._has_lane(road[other], home[other], states["s"][other])
        width, is_driving, heading = np.ones(len(rows)), np.zeros(len(rows), dtype=np.bool_), states["h"].copy()
        if len(on := np.flatnonzero(is_lane)):
            where = (road[on], home[on], states["s"][on])
            width[on], is_driving[on] = self.network.lane_width(*where), self.network.lane_index(*where)[0] >= 0
            heading[on] = self._headings(*where)
        looked_up = {"lane_road": road, "lane": home, "is_lane": is_lane, "is_driving": is_driving & (width > 0.0),
                 "left": self.left_of(states, on_lane, None if other.any() else heading),
                 "width": np.maximum(width, 1e-3), "heading": heading}  # fmt: skip
        for name, values in looked_up.items():
            known[name][rows] = values

    def _foreign(
        self, names: Sequence[str], known: NDArray[Any], states: NDArray[Any], road: IntArray, now: float
    ) -> BoolArray:
        """Whom something unknown moves sideways."""
        compared, offset = known["told"] & (known["told_road"] == road), states["offset_t"]
        begins = compared & (self._apart(known, states) > MOVED)
        goes_on = ~compared & np.isfinite(known["foreign_until"])
        goes_on &= np.abs(offset - known["foreign_offset"]) > KEPT_PLACE
        until = np.where(begins | goes_on, now + RESTING, known["foreign_until"])
        is_foreign = until > now
        known["told"], known["foreign_until"] = False, np.where(is_foreign, until, -np.inf)
        known["foreign_offset"] = offset
        for k in np.flatnonzero(begins).tolist():
            line = f"vehicle {names[k]!r}: moved sideways from {now:.2f} s on, by no lateral action of the scenario"
            self._say((names[k], "moved"), f"{line}; it is left alone until that rests")
        return np.asarray(is_foreign)
