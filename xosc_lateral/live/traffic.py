"""Drivers of the vehicles of a running simulation: told once per step what it knows, they say where they are.

A driver goes on at the model's step (5 Hz), on what he sees at that moment; in between he follows the curve of
`driver.upsampling`. What he sees he responds to a little later than in a conversion, which knows what comes
(`OffsetStream.preview`). Where a maneuver has moved a vehicle, its path leads over from there to the driver's.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.driver.group import OffsetGroup
from xosc_lateral.driver.plausibility import first_implausible, implausible
from xosc_lateral.driver.profile import Basis, DriverProfile, sampling_hash
from xosc_lateral.enrich.result import Neighbours
from xosc_lateral.enrich.seen import mirrored_context, sides_known
from xosc_lateral.errors import SimulationError
from xosc_lateral.live.surroundings import Places, Roads, give_way_now, look_around
from xosc_lateral.motion.context import STEERING
from xosc_lateral.motion.deviation import SETTLING_TIME, settle
from xosc_lateral.motion.segments import MINIMUM_SPEED

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

FORMAT = "xosc-lateral live traffic"

TURN = 0.03
"""Change of heading per time that nobody takes for a kink: 0.3 mrad in a step of 0.01 s. [rad/s]"""

LEADING_OVER = 0.5
"""Part of `TURN` that leading over to the driver's path may take; the driver's own movement has the rest. [-]"""

_PEAK = 10.0 / np.sqrt(3.0)
"""Largest second derivative of the smooth step from 0 to 1 in unit time (of 10 u^3 - 15 u^4 + 6 u^5, by hand). [-]"""

_STANDSTILL = 0.1
"""Below this speed a path has no direction. [m/s]"""

_SPEEDS = 6
"""Model steps of speed remembered: acceleration is over one second, as in a conversion. [-]"""

_NOTHING = 1e-12
"""A remainder this small is none. [m]"""

_DRIVER = np.dtype(
    [("curve", float, 6), ("begun", bool), ("following", bool), ("place", float), ("own", float),
     ("rest", float), ("from", float), ("from_rate", float), ("share", float), ("over", float), ("slip", float),
     ("aside", float), ("aside_rate", float), ("wanted", float), ("speeds", float, _SPEEDS), ("width", float)]
)  # fmt: skip
"""A driver beside his random numbers.

His curve until the next model step and whether it has begun; whether the vehicle followed the road a step ago, where it
was, and the driver's own offset there [m]; what leads over to his path: `rest` [m], from `from` [m] at `from_rate`
[m/s], done to `share` [-] of `over` [s], plus what slow driving left out (`slip` [m]); how far he has moved aside, how
fast, and how far he wants to; speeds of the last second; width of the lane as he has it [m].
"""


@dataclass(frozen=True, eq=False)
class Moment:
    """What a simulation knows at one moment: a row per vehicle, shape (n,) each.

    Parameters
    ----------
    names : tuple of str
        Each once.
    speed : array
        Along the road. [m/s]
    lane_width : array
        [m]
    offset : array
        Where the vehicle is now, from the lane's centre, positive LEFT of travel. [m]
    following : array of bool
        It follows the road: no maneuver moves it sideways, and its lateral place is its driver's.
    driven : array of bool
        It has a driver of ours; the vehicle under test has none, and is seen by the others.
    is_truck : array of bool
    base : array, optional
        Nominal offset that the driver's is added to (what a lane offset action left); 0 without. [m]
    context : mapping of str to array
        Further context columns, or ones that replace what places say; NaN: there is none.
    places : Places, optional
        For the vehicles around. Without, nobody knows of anybody but by `context`.
    """

    names: tuple[str, ...]
    speed: FloatArray
    lane_width: FloatArray
    offset: FloatArray
    following: BoolArray
    driven: BoolArray
    is_truck: BoolArray
    base: FloatArray | None = None
    context: Mapping[str, FloatArray] = field(default_factory=dict)
    places: Places | None = None

    @cached_property
    def nominal(self) -> FloatArray:
        """`base`, or zeros. [m]"""
        return np.zeros(len(self.names)) if self.base is None else self.base


class Moves(NamedTuple):
    """Where drivers are, by the rows of the moment, shape (n,) each; where nobody of ours drives, as it was.

    Offset from the lane's centre, positive left [m], its rate [m/s], the heading relative to the lane, positive left
    [rad], and whether it is the driver's (else the simulation's, or there is none).
    """

    offset: FloatArray
    rate: FloatArray
    heading: FloatArray
    steered: BoolArray


class Traffic:
    """The drivers of many vehicles.

    Parameters
    ----------
    profile : DriverProfile
        Who drives.
    profiles : mapping of str to DriverProfile, optional
        By vehicle, where it is another.
    seed : int
        A vehicle's random numbers follow from it and the vehicle's name, as in a conversion: same seed, same drivers.
    roads : Roads, optional
        Of the simulation; without, `Moment.places` serve for giving way alone.
    neighbours : Neighbours
        See `enrich.enrich`.
    left_hand : bool
        One keeps left here.

    Examples
    --------
    >>> traffic = Traffic(profile, seed=1)
    >>> moves = traffic.step(time, moment)
    """

    def __init__(
        self,
        profile: DriverProfile,
        *,
        profiles: Mapping[str, DriverProfile] | None = None,
        seed: int = 0,
        roads: Roads | None = None,
        neighbours: Neighbours = Neighbours.BORROW,
        left_hand: bool = False,
    ) -> None:
        self.seed = seed
        self._roads, self._neighbours, self._left_hand = roads, neighbours, left_hand
        self._profiles: dict[str, DriverProfile] = {"": profile, **(profiles or {})}
        self._step = profile.model.step
        for one in self._profiles.values():
            if one.model.step != self._step:
                raise ValueError(f"{one.name} has steps of {one.model.step} s, {profile.name} of {self._step} s")
        self._groups: dict[str, tuple[OffsetGroup, list[str]]] = {}
        self._names: list[str] = []
        self._index: dict[str, int] = {}
        self._state = np.zeros(0, dtype=_DRIVER)
        self._time: float | None = None
        self._knots = 0
        self._columns: tuple[str, ...] | None = None

    def __len__(self) -> int:
        return len(self._names)

    def step(self, time: float, moment: Moment) -> Moves:
        """Where everybody is at `time`.

        Parameters
        ----------
        time : float
            Of the simulation, not earlier than the last one. [s]
        moment : Moment
            What is known: how the last step of the simulation has left everybody.

        Raises
        ------
        SimulationError
            If a number is NaN or none that a road has, time runs backwards, or a context column is missing that was
            there. Nothing has changed then: the next good moment goes on.
        """
        _check(time, self._time, moment)
        context = self._context(moment) if self.is_due(time) else None
        there = np.flatnonzero(moment.driven)
        who = self._present([moment.names[k] for k in there])
        passed = 0.0 if self._time is None else time - self._time
        is_first, self._time = self._time is None, time
        if context is not None:
            self._advance(time, moment, context, there, who)
        moves = Moves(moment.offset.copy(), np.zeros(len(moment.names)), np.zeros(len(moment.names)),
                      np.zeros(len(moment.names), dtype=np.bool_))  # fmt: skip
        if len(there):
            rows = (moment.speed[there], moment.offset[there], moment.nominal[there], moment.following[there])
            found = self._drive(self._state[who], time, passed, *rows, is_first=is_first)
            self._state[who] = found[0]
            for values, own in zip(moves, found[1], strict=True):
                values[there] = own
        return moves

    # ---- who is there ------------------------------------------------------------------------------------------------
    def _present(self, names: list[str]) -> NDArray[np.int64]:
        """Drivers of these vehicles, shape (n,): those of others have gone, new ones have come."""
        if names != self._names:
            gone = self._index.keys() - set(names)
            if gone:
                self._keep(gone)
            new = [name for name in names if name not in self._index]
            self._names += new
            self._index.update({name: k for k, name in enumerate(self._names)})
            self._state = np.concatenate([self._state, np.zeros(len(new), dtype=_DRIVER)])
        return np.array([self._index[name] for name in names], dtype=np.int64)

    def _keep(self, gone: set[str]) -> None:
        self._state = self._state[[name not in gone for name in self._names]]
        self._names = [name for name in self._names if name not in gone]
        self._index = {name: k for k, name in enumerate(self._names)}
        for key, (group, members) in self._groups.items():
            group.keep(np.array([name not in gone for name in members], dtype=np.bool_))
            self._groups[key] = (group, [name for name in members if name not in gone])

    def seed_of(self, name: str) -> np.random.SeedSequence:
        """The random numbers of a vehicle's driver: those of a conversion with this seed."""
        return np.random.SeedSequence([self.seed, 0, 0, zlib.crc32(name.encode())])

    def _profile_key(self, name: str) -> str:
        return name if name in self._profiles else ""

    # ---- model steps -------------------------------------------------------------------------------------------------
    def is_due(self, time: float) -> bool:
        """Whether `step` at `time` [s] will look at the context: lane widths and places matter then only."""
        return time >= self._step * self._knots - 1e-9 or self._time is None

    def _context(self, moment: Moment) -> dict[str, FloatArray]:
        """What everybody sees, checked before anything changes."""
        found: dict[str, FloatArray] = {"speed": moment.speed, "is_truck": moment.is_truck.astype(np.float64)}
        acceleration = np.zeros(len(moment.names))
        for row, name in enumerate(moment.names):
            k = self._index.get(name)
            if k is not None and self._state["begun"][k]:
                acceleration[row] = (moment.speed[row] - self._state["speeds"][k, 0]) / (_SPEEDS - 1) / self._step
        found["acceleration"] = acceleration
        if moment.places is not None and self._roads is not None:
            found |= look_around(self._roads, moment.places, moment.offset, moment.is_truck)
        found |= {name: np.asarray(values, dtype=np.float64) for name, values in moment.context.items()}
        found["lane_width"] = moment.lane_width
        if self._columns is not None and (missing := set(self._columns) - found.keys()):
            raise SimulationError(f"the simulation says nothing of {min(missing)!r}, which it did before")
        for name, values in found.items():
            if (row_ := first_implausible(name, values)) is not None:
                raise SimulationError(f"vehicle {moment.names[row_]!r}: {implausible(name, float(values[row_]))}")
        return found

    def _advance(
        self,
        time: float,
        moment: Moment,
        context: dict[str, FloatArray],
        there: NDArray[np.int64],
        who: NDArray[np.int64],
    ) -> None:
        """On to the model step that is now, or to the last one of those that have passed."""
        if self._columns is None:
            self._columns = tuple(sorted(context))
            self._knots = max(self._knots, int(np.floor(time / self._step + 1e-9)))
        due = int(np.floor(time / self._step + 1e-9)) + 1 - self._knots
        self._knots += due
        row, width = {moment.names[k]: k for k in there.tolist()}, context["lane_width"]
        for name in row:
            key = self._profile_key(name)
            if key not in self._groups:
                self._groups[key] = (OffsetGroup(self._profiles[key], self._columns), [])
            if not self._state["begun"][self._index[name]] and name not in self._groups[key][1]:
                group, members = self._groups[key]
                group.add([self.seed_of(name)])
                members.append(name)
        for key, (group, members) in self._groups.items():
            if not members:
                continue
            rows, drivers = np.array([row[name] for name in members]), [self._index[name] for name in members]
            other_hand = self._profiles[key].left_hand != self._left_hand
            seen = mirrored_context(context) if other_hand else context
            for _ in range(due):
                curve = group.advance(
                    {name: seen[name][rows] for name in self._columns}, self._width(drivers, width[rows])
                )
            self._state["curve"][drivers] = -curve if other_hand else curve
        state = self._state
        new = who[~state["begun"][who]]
        state["speeds"][new] = moment.speed[there][~state["begun"][who], None]
        state["begun"][who] = True
        state["speeds"][who] = np.column_stack([state["speeds"][who, 1:], moment.speed[there]])
        state["wanted"][who] = self._aside(moment, there, who)[there]

    def _width(self, drivers: list[int], width: FloatArray) -> FloatArray:
        """The lane's, a first-order lag behind what it is: a border of two widths is no jump of the path. [m]"""
        before = np.where(self._state["width"][drivers] > 0.0, self._state["width"][drivers], width)
        self._state["width"][drivers] = width + (before - width) * np.exp(-self._step / STEERING)
        return np.asarray(self._state["width"][drivers])

    def _aside(self, moment: Moment, there: NDArray[np.int64], who: NDArray[np.int64]) -> FloatArray:
        """How far everybody wants to move aside, shape (n,). [m]"""
        if moment.places is None or self._neighbours is not Neighbours.BORROW:
            return np.zeros(len(moment.names))
        known = {f"{word}_{side}": np.zeros(len(moment.names), dtype=np.bool_)
                 for word in ("responds", "alone") for side in ("left", "right")}  # fmt: skip
        for key, (_, members) in self._groups.items():
            profile = self._profiles[key]
            other_hand = profile.left_hand != self._left_hand
            rows = there[np.isin(who, [self._index[name] for name in members])]
            for word, basis in (("responds", {Basis.POPULATION}), ("alone", {Basis.MEASURED, Basis.DECLARED})):
                for side in sides_known(profile, basis, other_hand=other_hand):
                    known[f"{word}_{side}"][rows] = True
        lateral = np.where(moment.following, moment.offset - moment.nominal, 0.0)
        deviation = lateral.copy()
        deviation[there] -= np.where(moment.following[there], self._state["aside"][who], 0.0)
        can_move = moment.driven & moment.following
        return give_way_now(moment.places, lateral, deviation, can_move, known, left_hand=self._left_hand)

    # ---- every step --------------------------------------------------------------------------------------------------
    def _drive(
        self,
        state: NDArray[Any],
        time: float,
        passed: float,
        speed: FloatArray,
        offset: FloatArray,
        base: FloatArray,
        following: BoolArray,
        *,
        is_first: bool,
    ) -> tuple[NDArray[Any], Moves]:
        """The drivers' states and moves after so much time [s], shape (n,) each; see `_DRIVER`."""
        u = min(max(time / self._step - (self._knots - 1), 0.0), 1.0)
        powers = u ** np.arange(6)
        own = state["curve"] @ powers
        own_rate = state["curve"][:, 1:] @ (np.arange(1, 6) * powers[:-1]) / self._step
        pace = _pace(speed)
        is_driven = following & state["begun"]
        taken_over = is_driven & ~state["following"]
        was_rate = np.where(passed > 0.0, (offset - state["place"]) / max(passed, 1e-9), 0.0)
        _move_aside(state, passed * pace)
        aside, aside_rate = state["aside"], state["aside_rate"] * pace
        if is_first:
            state["rest"][taken_over] = 0.0
        elif taken_over.any():
            was_rate = np.where(np.abs(was_rate) < np.maximum(0.2 * np.abs(speed), 0.1), was_rate, 0.0)  # placed anew
            was_rate = np.where(state["place"] == 0.0, 0.0, was_rate)
            gap_rate = was_rate - own_rate * pace - aside_rate
            gap = offset - base - own - aside + (own_rate * pace + aside_rate) * passed  # a step ago
            _lead_over(state, taken_over, gap, gap_rate, speed)
        went_on = is_driven & state["following"]
        state["slip"] = np.where(went_on, state["slip"] - (1.0 - pace) * (own - state["own"]), 0.0)
        slipped = is_driven & (state["over"] <= 0.0) & (np.abs(state["slip"]) > _NOTHING)
        if slipped.any():
            _lead_over(state, slipped, state["slip"], np.zeros(len(state)), speed)
            state["slip"][slipped] = 0.0
        rest_rate = _settle(state, passed * pace) * pace
        place = np.where(is_driven, base + own + state["rest"] + state["slip"] + aside, offset)
        rate = np.where(is_driven, own_rate * pace + rest_rate + aside_rate, was_rate * (passed > 0.0))
        moving = np.abs(speed) > _STANDSTILL
        sine = np.divide(rate, speed, out=np.zeros(len(state)), where=moving)
        heading = np.arcsin(np.clip(sine, -1.0, 1.0))
        state["following"], state["place"], state["own"] = is_driven, place, own
        return state, Moves(place, np.where(is_driven, rate, 0.0), np.where(is_driven, heading, 0.0), is_driven)

    # ---- state -------------------------------------------------------------------------------------------------------
    def to_dict(self) -> dict[str, Any]:
        """All that changes while driving, as plain JSON values."""
        return {
            "format": FORMAT,
            "version": 1,
            "seed": self.seed,
            "profiles": {key: sampling_hash(profile) for key, profile in self._profiles.items()},
            "time": self._time,
            "knots": self._knots,
            "columns": self._columns,
            "drivers": {
                name: [_plain(value) for value in own]
                for name, own in zip(self._names, self._state.tolist(), strict=True)
            },
            "groups": {key: {"members": members, **group.to_dict()} for key, (group, members) in self._groups.items()},
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what `to_dict` gave; the same profiles, settings and roads were given at the start.

        Raises
        ------
        SimulationError
            If it is no such state, or one of other profiles.
        """
        if not isinstance(state, Mapping) or state.get("format") != FORMAT or state.get("version") != 1:
            raise SimulationError(f'not a state of live traffic: "format" is not "{FORMAT}", or its version is not 1')
        if state["profiles"] != {key: sampling_hash(profile) for key, profile in self._profiles.items()}:
            raise SimulationError("the state of live traffic belongs to other profiles")
        self.seed, self._time, self._knots = int(state["seed"]), state["time"], int(state["knots"])
        self._columns = None if state["columns"] is None else tuple(state["columns"])
        self._names = list(state["drivers"])
        self._index = {name: k for k, name in enumerate(self._names)}
        self._state = np.array([tuple(map(_tupled, own)) for own in state["drivers"].values()], dtype=_DRIVER)
        self._groups = {}
        for key, saved in state["groups"].items():
            group = OffsetGroup(self._profiles[key], self._columns or ())
            group.restore(saved, [self.seed_of(name) for name in saved["members"]])
            self._groups[key] = (group, list(saved["members"]))


def _check(time: float, before: float | None, moment: Moment) -> None:
    if not np.isfinite(time) or (before is not None and time < before):
        raise SimulationError(
            f"the simulation's time is {time:g} s" + ("" if before is None else f" after {before:g} s")
        )
    columns = {"speed": moment.speed, "lane width": moment.lane_width, "offset": moment.offset, "base": moment.nominal}
    if moment.places is not None:
        columns |= {name: getattr(moment.places, name) for name in ("x", "y", "heading", "s")}
    for what, values in columns.items():
        if len(values) != len(moment.names):
            raise ValueError(f"{what}: {len(values)} rows for {len(moment.names)} vehicles")
        bad = ~np.isfinite(values)
        if what == "lane width":
            bad |= ~(values > 0.0)
        if bad.any():
            row = int(np.flatnonzero(bad)[0])
            raise SimulationError(f"vehicle {moment.names[row]!r} at {time:g} s: {what} is {values[row]}")


def _pace(speed: FloatArray) -> FloatArray:
    """How much of the driver's lateral movement there is, shape as the speed [m/s]. [-]

    All from 40 km/h on; below, less, so that a path runs along the lane where its car stops and drives on.
    """
    u = np.abs(speed) / MINIMUM_SPEED
    u = np.where(u > 1.0 - 1e-6, 1.0, u)  # 11.1111 m/s are meant as 40 km/h
    return np.asarray(u**2 * (3.0 - 2.0 * u))


def _move_aside(state: NDArray[Any], passed: FloatArray) -> None:
    """Two equal first-order lags towards what is wanted, solved exactly; drivers respond within `STEERING`."""
    keep = np.exp(-passed / STEERING)
    gap = state["aside"] - state["wanted"]
    drift = state["aside_rate"] + gap / STEERING
    state["aside"] = state["wanted"] + (gap + drift * passed) * keep
    state["aside_rate"] = (drift - (gap + drift * passed) / STEERING) * keep


def _lead_over(state: NDArray[Any], which: BoolArray, gap: FloatArray, rate: FloatArray, speed: FloatArray) -> None:
    """Begin to lead over from a gap [m] that changes at a rate [m/s], within what is no kink at this speed. [m/s]"""
    bound = LEADING_OVER * TURN * np.maximum(np.abs(speed), MINIMUM_SPEED)
    over = np.maximum(SETTLING_TIME, np.maximum(np.sqrt(_PEAK * np.abs(gap) / bound), 4.0 * np.abs(rate) / bound))
    for name, values in (("from", gap), ("from_rate", rate), ("share", 0.0), ("over", over)):
        state[name] = np.where(which, values, state[name])


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
    level = 1.0 - u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    by_level = -30.0 * u**2 * (1.0 - u) ** 2 / over
    by_slope = 1.0 - 18.0 * u**2 + 32.0 * u**3 - 15.0 * u**4
    rest = state["from"] * level + settle(u * over, over, state["from_rate"], 0.0)
    state["rest"] = np.where(active & ~done, rest, 0.0)
    return np.where(active & ~done, state["from"] * by_level + state["from_rate"] * by_slope, 0.0)


def _plain(value: Any) -> Any:
    return value.tolist() if hasattr(value, "tolist") else value


def _tupled(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value
