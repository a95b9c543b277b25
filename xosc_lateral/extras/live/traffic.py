"""Drivers of the vehicles of a running simulation: once per step they get what it knows, and say where they are.

A driver goes on at the model's step (5 Hz), on what he sees at that moment; in between he follows the curve of
`model.linear_filters`. What he sees he responds to a little later than in a conversion, which knows what comes
(`OffsetStream.preview`). Where a maneuver has moved a vehicle, its path leads over from there to the driver's.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from itertools import compress
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import BoolArray, FloatArray, IntArray
from xosc_lateral.base.errors import SimulationError, XoscLateralError
from xosc_lateral.base.limits import LIVE_PAUSE, LIVE_RANGES, TIME
from xosc_lateral.drivers.model.actuator import fault_in_words
from xosc_lateral.drivers.model.group import OffsetGroup
from xosc_lateral.drivers.model.plausibility import first_implausible, implausible
from xosc_lateral.drivers.model.profile import Basis, DriverProfile, sampling_hash
from xosc_lateral.drivers.model.seeds import of_driver
from xosc_lateral.drivers.model.stream import sealed, unsealed
from xosc_lateral.extras.live.moment import (
    CLOCK_TOLERANCE,
    DRIVER,
    SPEEDS_REMEMBERED,
    Moves,
    Places,
    Roads,
    drive_on,
    give_way_now,
    look_around,
    pace_of,
)
from xosc_lateral.workflows.conversion.driver_context import mirrored_context, sides_known
from xosc_lateral.workflows.conversion.result import Neighbours
from xosc_lateral.world.surroundings.give_way import Response

FORMAT = "xosc-lateral live traffic"


@dataclass(frozen=True, eq=False)
class Moment:
    """What a simulation knows at one moment: a row per vehicle, shape (n,) each."""

    names: tuple[str, ...]  # Each once.
    speed: FloatArray  # Along the road. [m/s]
    lane_width: FloatArray  # [m]
    offset: FloatArray  # Where the vehicle is now, from the lane's centre, positive LEFT of travel. [m]
    following: BoolArray  # No maneuver moves it sideways, and its lateral place is its driver's.
    driven: BoolArray  # It has a driver of ours; the vehicle under test has none, and is seen by the others.
    is_truck: BoolArray
    base: FloatArray | None = None  # Offset that the driver's is added to (what a lane offset action left). [m]
    # Further context columns, or ones that replace what places say; NaN: there is none.
    context: Mapping[str, FloatArray] = field(default_factory=dict)
    places: Places | None = None  # For the vehicles around. Without, nobody knows of anybody but by `context`.

    @cached_property
    def nominal(self) -> FloatArray:
        """`base`, or zeros. [m]"""
        return np.zeros(len(self.names)) if self.base is None else self.base


class Traffic:
    """The drivers of many vehicles: ``Traffic(profile, seed=1).step(time, moment)``.

    `profile` drives, or another of `profiles` by the vehicle's name. A vehicle's random numbers follow from `seed` and
    its name, as in a conversion: same seed, same drivers. Without `roads`, `Moment.places` serve for giving way alone,
    as far as `neighbours` says; `left_hand`: one keeps left here.
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
        for other in self._profiles.values():
            if other.model.step != self._step:
                raise ValueError(f"{other.name} has steps of {other.model.step} s, {profile.name} of {self._step} s")
        self._groups: dict[str, tuple[OffsetGroup, list[str]]] = {}
        self._names: list[str] = []
        self._index: dict[str, int] = {}
        self._state = np.zeros(0, dtype=DRIVER)
        self._time: float | None = None
        self._knots = 0
        self._columns: tuple[str, ...] | None = None
        self.faults: dict[str, str] = {}
        """Vehicles whose drivers wanted what can't be driven and are held back (`actuator`), and what wanted it."""

    def fault_lines(self) -> list[str]:
        """The same, a line each."""
        return [f"vehicle {name!r}: {what} wanted what can't be driven; it is held back"
                for name, what in self.faults.items()]  # fmt: skip

    def __len__(self) -> int:
        return len(self._names)

    def step(self, time: float, moment: Moment) -> Moves:
        """Where everybody is at a time of the simulation, not earlier than the last one [s].

        From what is known then: how the last step of the simulation has left everybody. Raises `SimulationError` if a
        number is NaN or none that a road has, time runs backwards or leaps, or a context column is missing that was
        there. Nothing has changed then: the next good moment goes on.
        """
        _check(time, self._time, moment)
        context = self._context(moment) if self.is_due(time) else None
        there = np.flatnonzero(moment.driven)
        drivers = self._present(list(compress(moment.names, moment.driven.tolist())))
        passed = 0.0 if self._time is None else time - self._time
        is_first, is_restart = self._columns is None, self._time is None
        self._time = time
        if is_restart and not is_first:
            self._knots = self._knots_until(time) - 1
            share = time / self._step - self._knots
            self._state["clock"] = np.minimum(self._state["clock"], share)
        pace = pace_of(moment.speed[there], self._state["own_rate"][drivers])
        self._state["clock"][drivers] += passed * pace / self._step
        if context is not None:
            self._advance(time, moment, context, there, drivers)
        else:  # one driver's numbers at a time, while there is nothing else to do
            any(group.draw_ahead() for group, _ in self._groups.values())
        self._turn_over(drivers)
        rate, heading = np.zeros((2, len(moment.names)))
        moves = Moves(moment.offset.copy(), rate, heading, np.zeros(len(moment.names), dtype=np.bool_))
        if len(there):
            rows = (moment.speed[there], moment.offset[there], moment.nominal[there], moment.following[there])
            self._state[drivers], driven = drive_on(
                self._state[drivers], self._step, None if is_first else passed, *rows
            )
            for values, part in zip(moves, driven, strict=True):
                values[there] = part
        return moves

    def restart(self) -> None:
        """The next step may be at any time: after a pause, a leap above 60 s, in another player.

        The same drivers go on from where their vehicles are then.
        """
        self._time, self._knots = None, 0
        self._state["following"] = False

    # ---- who is there ------------------------------------------------------------------------------------------------
    def _present(self, names: list[str]) -> IntArray:
        """Drivers of these vehicles, shape (n,): those of others have gone, new ones have come."""
        if names != self._names:
            there = set(names)
            if not there >= self._index.keys():
                self._state = self._state[[name in there for name in self._names]]
                self._names = [name for name in self._names if name in there]
                for key, (group, members) in self._groups.items():
                    group.keep_present(np.array([name in there for name in members], dtype=np.bool_))
                    self._groups[key] = (group, [name for name in members if name in there])
            before = set(self._names)
            new = [name for name in names if name not in before]
            self._names += new
            self._index = {name: k for k, name in enumerate(self._names)}
            self._state = np.concatenate([self._state, np.zeros(len(new), dtype=DRIVER)])
        return np.array([self._index[name] for name in names], dtype=np.int64)

    def seed_of(self, name: str) -> np.random.SeedSequence:
        """The random numbers of a vehicle's driver: those of a conversion with this seed."""
        return of_driver(self.seed, name)

    def _profile_key(self, name: str) -> str:
        return name if name in self._profiles else ""

    # ---- model steps -------------------------------------------------------------------------------------------------
    def is_due(self, time: float) -> bool:
        """Whether `step` at `time` [s] will look at the context: lane widths and places matter then only."""
        return self._time is None or self._knots_until(time) > self._knots

    def _knots_until(self, time: float) -> int:
        """Model steps begun by a time [s], which a simulation may have added up from many steps of its own."""
        return int(np.floor(time / self._step + 1e-9)) + 1

    def _context(self, moment: Moment) -> dict[str, FloatArray]:
        """What everybody sees, checked before anything changes."""
        columns: dict[str, FloatArray] = {"speed": moment.speed, "is_truck": moment.is_truck.astype(np.float64)}
        columns["acceleration"] = np.zeros(len(moment.names))
        pairs = [(row, k) for row, name in enumerate(moment.names) if (k := self._index.get(name)) is not None]
        rows, drivers = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
        change = moment.speed[rows] - self._state["speeds"][drivers, 0]
        columns["acceleration"][rows] = np.where(
            self._state["begun"][drivers], change / SPEEDS_REMEMBERED / self._step, 0.0
        )
        if moment.places is not None and self._roads is not None:
            columns |= look_around(self._roads, moment.places, moment.offset, moment.is_truck)
        columns |= {name: np.asarray(values, dtype=np.float64) for name, values in moment.context.items()}
        columns["lane_width"] = moment.lane_width
        if self._columns is not None and (missing := set(self._columns) - columns.keys()):
            raise SimulationError(f"the simulation says nothing of {min(missing)!r}, which it did before")
        for name, values in columns.items():
            if (bad := first_implausible(name, values)) is not None:
                raise SimulationError(f"vehicle {moment.names[bad]!r}: {implausible(name, float(values[bad]))}")
        return columns

    def _advance(
        self, time: float, moment: Moment, context: dict[str, FloatArray], there: IntArray, all_drivers: IntArray
    ) -> None:
        """On to the model step that is now, or to the last one of those that have passed."""
        if self._columns is None:
            self._columns = tuple(sorted(context))
            self._knots = self._knots_until(time) - 1
        self._knots = self._knots_until(time)
        u = time / self._step - (self._knots - 1)  # since the step began, of it
        wanted = self._aside(moment, there, all_drivers)
        row, width = {moment.names[k]: k for k in there.tolist()}, context["lane_width"]
        for key, profile in self._profiles.items():
            names = [name for name in row if self._profile_key(name) == key]
            if not names:
                continue
            if key not in self._groups:
                self._groups[key] = (OffsetGroup(profile, self._columns), [])
            group, members = self._groups[key]
            known = set(members)
            if new := [name for name in names if name not in known]:
                group.add([self.seed_of(name) for name in new])
                members += new
            rows, drivers = np.array([row[name] for name in members]), [self._index[name] for name in members]
            other_hand = profile.left_hand != self._left_hand
            seen = mirrored_context(context) if other_hand else context
            seen, side = {name: seen[name][rows] for name in self._columns}, -1.0 if other_hand else 1.0
            self._draw(group, np.array(drivers), seen, width[rows], u, side)
            for k in np.flatnonzero(group.actuator.state["fault"]).tolist():
                self.faults[members[k]] = fault_in_words(profile, int(group.actuator.state["fault"][k]))
        state = self._state
        is_new = ~state["begun"][all_drivers]
        state["speeds"][all_drivers[is_new]] = moment.speed[there][is_new, None]
        state["begun"][all_drivers] = True
        state["speeds"][all_drivers] = np.column_stack([state["speeds"][all_drivers, 1:], moment.speed[there]])
        state["wanted"][all_drivers] = wanted[there]

    def _draw(
        self, group: OffsetGroup, drivers: IntArray, seen: Mapping[str, FloatArray], width: FloatArray, u: float,
        side: float,
    ) -> None:  # fmt: skip
        """Curves of a group's drivers for all until the next step begins, `u` into this one, as each's clock has it."""
        new = drivers[~self._state["begun"][drivers]]
        self._state["clock"][new] = 1.0 + u
        while True:
            self._turn_over(drivers)
            clock, ahead = self._state["clock"][drivers], self._state["ahead"][drivers]
            whose = ~ahead & (clock > u + CLOCK_TOLERANCE)
            if not whose.any():
                return
            self._state["next"][drivers[whose]] = side * group.advance(seen, width, whose)[whose]
            self._state["ahead"][drivers[whose]] = True

    def _turn_over(self, drivers: IntArray) -> None:
        """On to the next curve, of those who are at the end of theirs and have it."""
        state = self._state
        done = drivers[state["ahead"][drivers] & (state["clock"][drivers] >= 1.0 - CLOCK_TOLERANCE)]
        state["curve"][done], state["ahead"][done] = state["next"][done], False
        state["clock"][done] = np.maximum(state["clock"][done] - 1.0, 0.0)

    def _aside(self, moment: Moment, there: IntArray, drivers: IntArray) -> FloatArray:
        """How far everybody wants to move aside, shape (n,). [m]"""
        if moment.places is None or self._neighbours is not Neighbours.BORROW:
            return np.zeros(len(moment.names))
        response = Response(*np.zeros((4, len(moment.names)), dtype=np.bool_))
        for key, profile in self._profiles.items():
            other_hand = profile.left_hand != self._left_hand
            rows = [k for k in there.tolist() if self._profile_key(moment.names[k]) == key]
            for word, basis in (("responds", {Basis.POPULATION}), ("alone", {Basis.MEASURED, Basis.DECLARED})):
                for side in sides_known(profile, basis, other_hand=other_hand):
                    getattr(response, f"{word}_{side}")[rows] = True
        lateral = np.where(moment.following, moment.offset - moment.nominal, 0.0)
        deviation = lateral.copy()
        deviation[there] -= np.where(moment.following[there], self._state["aside"][drivers], 0.0)
        can_move = moment.driven & moment.following
        return give_way_now(moment.places, lateral, deviation, can_move, response, left_hand=self._left_hand)

    # ---- state -------------------------------------------------------------------------------------------------------
    def to_dict(self) -> dict[str, Any]:
        """All that changes while driving, as plain JSON values."""
        return sealed({
            "seed": self.seed,
            "profiles": {key: sampling_hash(profile) for key, profile in self._profiles.items()},
            "time": self._time,
            "knots": self._knots,
            "columns": self._columns,
            "drivers": {
                name: [np.asarray(value).tolist() for value in row]
                for name, row in zip(self._names, self._state.tolist(), strict=True)
            },
            "groups": {key: {"members": members, **group.to_dict()} for key, (group, members) in self._groups.items()},
        }, FORMAT)  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what `to_dict` gave; the same profiles, settings and roads were given at the start.

        Raises `SimulationError` if it is no such state, a damaged one, or one of other profiles; nothing has changed
        then.
        """
        trial, restored = copy(self), copy(self)
        try:
            values = unsealed(state, FORMAT)
            for traffic in (trial, restored):
                traffic._go_on_from(values)
            with np.errstate(over="raise"):
                trial._try()
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
            if isinstance(error, XoscLateralError):
                raise SimulationError(str(error)) from error
            raise SimulationError(f"the state of live traffic is damaged: {error!r}") from error  # and sealed anew
        self.__dict__ = restored.__dict__

    def _try(self) -> None:
        """One step more, with nothing around, as a check of a state."""
        if not all((np.abs(self._state[name]) <= LIVE_RANGES["offset"].high).all() for name in DRIVER.names or ()):
            raise ValueError("a driver's number that none has")
        begun = [name for name, is_begun in zip(self._names, self._state["begun"], strict=True) if is_begun]
        if sorted(begun) != sorted(name for _, members in self._groups.values() for name in members):
            raise ValueError("drivers and groups name others")
        if self._time is None and not self._knots:
            return
        if self._time is None or self._columns is None:
            raise ValueError("it says only one of time and columns")
        if not abs(self._time / self._step - self._knots) < 2.0:
            raise ValueError(f"its time is {self._time} s, after {self._knots} steps of its model")
        for group, _ in self._groups.values():
            group.try_next()
        n = len(self._names)
        even, on = np.full(n, 3.5), np.ones(n, dtype=np.bool_)
        seen = {name: np.full(n, np.nan) for name in self._columns if name not in ("lane_width", "speed")}
        moment = Moment(tuple(self._names), 10.0 * even, even, 0.0 * even, on, on, ~on, context=seen)
        moves = self.step(max(self._time, self._step * self._knots), moment)
        if not (np.abs(moves.offset) <= LIVE_RANGES["offset"].high).all():
            raise ValueError("a driver's place is none")

    def _go_on_from(self, state: Mapping[str, Any]) -> None:
        if state["profiles"] != {key: sampling_hash(profile) for key, profile in self._profiles.items()}:
            raise SimulationError("the state of live traffic belongs to other profiles")
        self.seed, self._time, self._knots = int(state["seed"]), state["time"], int(state["knots"])
        self._columns = None if state["columns"] is None else tuple(state["columns"])
        self._names = list(state["drivers"])
        self._index = {name: k for k, name in enumerate(self._names)}
        rows = state["drivers"].values()
        tuples = [tuple(tuple(value) if isinstance(value, list) else value for value in row) for row in rows]
        self._state = np.array(tuples, dtype=DRIVER)
        self._groups, self.faults = {}, {}
        for key, saved in state["groups"].items():
            group = OffsetGroup(self._profiles[key], self._columns or ())
            group.restore(saved, [self.seed_of(name) for name in saved["members"]])
            self._groups[key] = (group, list(saved["members"]))


def _check(time: float, before: float | None, moment: Moment) -> None:
    if not abs(time) <= TIME.value or (before is not None and time < before):
        raise SimulationError(
            f"the simulation's time is {time:g} s" + ("" if before is None else f" after {before:g} s")
        )
    if before is not None and time - before > LIVE_PAUSE.value:
        raise SimulationError(LIVE_PAUSE.refusal(time - before))
    columns = {"speed": moment.speed, "lane width": moment.lane_width, "offset": moment.offset, "base": moment.nominal}
    if moment.places is not None:
        columns |= {name: getattr(moment.places, name) for name in ("x", "y", "heading", "s")}
    others = {name: getattr(moment, name) for name in ("following", "driven", "is_truck")} | dict(moment.context)
    for what, values in {**columns, **others}.items():
        if len(values) != len(moment.names):
            raise ValueError(f"{what}: {len(values)} rows for {len(moment.names)} vehicles")
    if len(set(moment.names)) < len(moment.names):
        raise ValueError("a vehicle is named twice")
    for what, values in columns.items():
        bad = ~np.isfinite(values)
        if what == "lane width":
            bad |= ~(values > 0.0)
        elif what in LIVE_RANGES:
            bad |= ~(np.abs(values) <= LIVE_RANGES[what].high)
        if bad.any():
            row = int(np.flatnonzero(bad)[0])
            raise SimulationError(f"vehicle {moment.names[row]!r} at {time:g} s: {what} is {values[row]}")
