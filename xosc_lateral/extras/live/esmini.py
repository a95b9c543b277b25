"""Drivers in esmini, through the library that its user has (``libesminiLib.so``, ``esminiLib.dll``), by ctypes.

A vehicle's lateral place is reported as t in road coordinates, together with the speed as it is read: that leaves its
speed, maneuvers and triggers as written. Without the speed the player makes one of the way aside, of a car that stands;
a report by lane marks the longitudinal direction as reported, and stops the vehicle. Where a lateral action runs,
nothing is reported: both would write the same place. Whose place is whose: `esmini_places`.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from xosc_lateral.base.errors import FormatError, SimulationError
from xosc_lateral.base.own_clock import clock_rate
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.live.esmini_library import ObjectState, Player, StoryboardCallback
from xosc_lateral.extras.live.esmini_places import Ledger, Place, Rest, ToldPlace
from xosc_lateral.extras.live.loop import Row
from xosc_lateral.extras.live.moment import OpenDriveRoads, Places
from xosc_lateral.extras.live.paths import CLOCK_TOLERANCE, Moves, left_of_gap
from xosc_lateral.extras.live.traffic import Moment, Traffic
from xosc_lateral.extras.live.under_test import UnderTest
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.workflows.conversion.result import Neighbours
from xosc_lateral.world.motion.driver_clock import leading_time
from xosc_lateral.world.scenario.controllers import Domains, controlled_entities
from xosc_lateral.world.scenario.private_actions import (
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
    TeleportAction,
)
from xosc_lateral.world.scenario.scenario import Scenario
from xosc_lateral.world.surroundings.around import smooth_step

LATERAL_ACTIONS = (LaneChangeAction, LaneOffsetAction, LateralDistanceAction, FollowTrajectoryAction, TeleportAction)
"""Actions that say where a vehicle is sideways."""

_INIT_NAMES = {TeleportAction: "TeleportAction", FollowTrajectoryAction: "RoutingAction"}
"""What esmini calls actions of Init, apart from ``LateralAction``."""

_ACTION_TYPE, _RUNNING_STATE = 7, 2
"""Kind and state of a storyboard element (`StoryBoardElement::ElementType` and `State`)."""

_VEHICLE_TYPE, _TRUCK_CATEGORIES, _PULLED_CATEGORIES = 1, (2, 3, 4, 5), (3, 4)
"""`Object::Type`; `Vehicle::Category` of trucks, trailers and buses, and of what has no driver of its own."""

EXTERNAL_CONTROLLERS = (1, 11)
"""Controllers that wait for somebody else: external, UDP driver (`Controller::Type`)."""

MIDDLE = 1.5
"""So near to the middle of the road, what is left of a lateral speed fades: a place reported beyond it is one of the
oncoming lane, where a lane change across goes astray. [m]"""

AT_REST = 1e-6
"""Of what stands, as the player has it, every way aside becomes a speed: nothing is reported. [m/s]"""


class EsminiTraffic:
    """Drivers of the vehicles of a scenario that esmini has opened.

    Call `steer` before every ``SE_StepDT``, and `settle` after it; all else stays with the caller: opening, stepping,
    an external ego. The `library` is its path, a `ctypes.CDLL` or an object with the same functions, in which
    ``SE_Init`` was called for the `scenario`, which says which actions are lateral, and whose. Nobody of ours drives
    the `ego`, see `UnderTest`; they are seen where they are. `on_element` is called as esmini's storyboard callback, of
    which there is one. For `seed`, `profiles` and `neighbours` see `Traffic`.
    """

    def __init__(
        self,
        library: Any,
        scenario: str | Path | Scenario,
        profile: DriverProfile,
        *,
        ego: str | Iterable[str] | None = None,
        seed: int = 0,
        profiles: dict[str, DriverProfile] | None = None,
        neighbours: Neighbours = Neighbours.BORROW,
        on_element: Callable[[bytes, int, int, bytes], None] | None = None,
    ) -> None:
        self.player = library if isinstance(library, Player) else Player(library)
        model = scenario if isinstance(scenario, Scenario) else read_scenario(scenario)
        self.entities = model.entities
        self.ego = UnderTest(ego, profiles or ())
        controlled = controlled_entities(model).items()  # the state of a vehicle names longitudinal controllers alone
        self._steered = {name for name, control in controlled if Domains.LATERAL in control.domains}
        self._moved_by = lateral_actions(model)
        self._running: Counter[str] = Counter()
        self._touched: set[str] = set()
        self._begun: dict[str, float] = {}
        self.spans: dict[str, list[tuple[float, float]]] = {}
        """From when to when lateral actions ran that are over, by their path in the storyboard. [s]"""
        self._also = on_element
        self.warnings: list[str] = []
        """What a user has to know, a line each."""
        self.waits: set[str] = set()
        """Vehicles whose controller waits for another program."""
        self.undriven: dict[str, str] = {}
        """Vehicles that no driver of ours has had so far, and why."""
        self._said: set[tuple[str, str]] = set()
        path = (self.player.SE_GetODRFilename() or b"").decode()
        try:
            self.network = read_opendrive(path)
        except (FormatError, OSError) as error:
            raise SimulationError(f"{self.player.where}: its road can't be read: {error}") from error
        self._ledger = Ledger(self.network, self._say)
        left_hand = any(road.rule == "LHT" for road in self.network.roads)
        self.traffic = Traffic(
            profile, profiles=profiles, seed=seed, roads=OpenDriveRoads(self.network), neighbours=neighbours,
            left_hand=left_hand,
        )  # fmt: skip
        self._back = StoryboardCallback(self._on_element)
        self.player.SE_RegisterStoryBoardElementStateChangeCallback(self._back)
        for element in self.player.heard:  # what began within SE_Init
            self._follow_action(*element)
        self._touched.clear()  # what is over by now has put everybody where he begins
        names = {name for name, _ in self._objects()}
        if missing := sorted((self.ego.named | set(profiles or {})) - names):
            there = ", ".join(sorted(names))
            raise SimulationError(f"there is no vehicle {missing[0]!r} in the scenario (vehicles: {there})")
        self.moves: dict[str, tuple[float, bool]] = {}
        pulled_by = {entity.trailer: entity.name for entity in model.entities if entity.trailer is not None}
        self._unit = {entity.name: _first_of(entity.name, pulled_by) for entity in model.entities}

    def steer(self, dt: float) -> Moves:
        """Say where everybody is sideways after the next step of `dt` seconds; before ``SE_StepDT(dt)``.

        Raises `SimulationError` if what the simulation says can't be used; nothing was reported then, and the
        simulation can go on.
        """
        there = dict(self._objects())
        vehicles = self._ledger.vehicles
        for gone in vehicles.keys() - there.keys():  # who is added again begins anew
            del vehicles[gone]
        seen = {name: state for name, state in there.items() if self._is_sound(name, state)}
        moment, places = self._moment(seen, dt)
        moves = self.traffic.step(self.player.SE_GetSimulationTime() + dt, moment)
        starts: dict[str, float] = {}
        for row, (name, state) in enumerate(seen.items()):
            known, place = vehicles[name], places[row]
            known.steered, known.rate = bool(moves.steered[row]), float(moves.rate[row])
            if known.steered:
                offset = float(moves.offset[row])
                t = place.centre + place.left * offset
                self._tell(name, state, t)
                if known.place is None:
                    starts[name] = t - state.t
                known.place = offset
                self.undriven.pop(name, None)
        for name, state in seen.items():  # where a vehicle begins, what it pulls begins behind it
            first = self._unit.get(name, name)
            if first != name and first in starts:
                self._tell(name, state, state.t + starts[first])
        self.moves = moves.by_name(moment.names)
        return moves

    def settle(self, dt: float) -> None:
        """Let what a maneuver has cut off at its start run out, offset and lateral speed; after ``SE_StepDT(dt)``.

        A lateral action begins with no lateral speed, a trajectory without offset, and both say anew in every step
        where their vehicle is. What is reported after a step is seen in the vehicle's state until the next one, and
        changes nothing of the action.
        """
        busy = self._busy()
        for name, state in self._objects():
            if (known := self._ledger.vehicles.get(name)) is None:
                continue
            pace = float(clock_rate(np.array([state.speed]))[0])
            if name in busy and known.steered:  # begun in this step, in which the driver's place still counts
                if (gap := self._ledger.dropped(known, state)) is None:
                    continue
                rate = known.rate / max(pace, CLOCK_TOLERANCE)
                known.rest = Rest(gap, rate, float(leading_time(*np.array([gap, rate, state.speed]))), -dt * pace)
            elif self._ledger.road_of(state) < 0 or (name not in busy and name not in self._touched):
                known.rest = None
            # once more when the action is over: from there on the driver leads over
            if (rest := known.rest) is not None and (rest.gap or abs(state.speed) > AT_REST):
                rest.passed += dt * pace
                left = left_of_gap(*np.array([[rest.passed / rest.over], [rest.over], [rest.gap], [rest.rate]]))
                room = self._ledger.room_to_middle(state)
                rest.way = float(left[0] * smooth_step(np.array([min(max(room / MIDDLE, 0.0), 1.0)]))[0])
                if room > 0.0 and rest.way:
                    t = state.t + self._ledger.left_of(state) * rest.way
                    self.player.SE_ReportObjectLateralPosition(state.id, t)

    # ---- a simulation that runs by itself (`loop`) -------------------------------------------------------------------
    def time(self) -> float:
        """Now. [s]"""
        return float(self.player.SE_GetSimulationTime())

    def is_over(self) -> bool:
        """Whether the player wants to end."""
        return bool(self.player.SE_GetQuitFlag() == 1)

    def rows(self) -> Iterator[Row]:
        """Where everybody is now."""
        now = self.time()
        for name, state in self._objects():
            place = (state.road, state.lane, state.s, self.offset_of(state))
            move = self.moves.get(name, (float("nan"), False))
            yield now, name, state.x, state.y, state.h, state.speed, *place, *move, state.z, state.p, state.r

    def drive(self, step: float) -> None:
        """On by a step [s]; raises `SimulationError` if the player can't."""
        self.steer(step)
        if self.player.SE_StepDT(step) != 0:
            raise SimulationError(f"{self.player.where} stopped at {self.time():g} s")
        self.settle(step)

    def states(self) -> dict[str, ObjectState]:
        """Of all objects, by name."""
        return dict(self._objects())

    def offset_of(self, state: ObjectState) -> float:
        """From the centre of the lane that it is on, positive LEFT of travel. [m]"""
        return float(state.offset_t) * self._ledger.left_of(state)

    # ---- what is told ------------------------------------------------------------------------------------------------
    def _tell(self, name: str, state: ObjectState, t: float) -> None:
        """Report a place [m], and the speed that there is; who stands is where he is."""
        if abs(state.speed) > AT_REST:
            self.player.SE_ReportObjectSpeed(state.id, state.speed)
            self.player.SE_ReportObjectLateralPosition(state.id, t)
        else:
            t = state.t
        offset_t = state.offset_t + t - state.t
        self._ledger.vehicles[name].told_place = ToldPlace(self._ledger.road_of(state), state.lane, t, offset_t)

    def _say(self, key: tuple[str, str], line: str) -> None:
        """A warning, once for its key."""
        if key not in self._said:
            self._said.add(key)
            self.warnings.append(line)

    # ---- what the simulation knows -----------------------------------------------------------------------------------
    def _busy(self) -> set[str]:
        """Whom a lateral action moves now."""
        return {name for action, count in self._running.items() if count > 0 for name in self._moved_by[action]}

    def _objects(self) -> Iterator[tuple[str, ObjectState]]:
        for index in range(self.player.SE_GetNumberOfObjects()):
            number = self.player.SE_GetId(index)
            state = self.player.state(number)
            if state is not None:
                yield (self.player.SE_GetObjectName(number) or b"").decode(), state

    def _is_sound(self, name: str, state: ObjectState) -> bool:
        """Whether it is a vehicle that says where it is; one that doesn't is left alone, which is a warning."""
        if state.type != _VEHICLE_TYPE:
            self.undriven.setdefault(name, "no vehicle")
            return False
        numbers = {what: getattr(state, what) for what in ("x", "y", "h", "t", "s", "speed", "offset_t")}
        bad = [what for what, value in numbers.items() if not np.isfinite(value)]
        if bad:
            self._say((name, bad[0]), f"vehicle {name!r}: {bad[0]} is {numbers[bad[0]]}; it is left alone")
        return not bad

    def _why_not_ours(self, name: str, state: ObjectState) -> str:
        """Why no driver of ours has a vehicle; empty: he may."""
        if name in self.ego.named:
            return "it is under test"
        if state.category in _PULLED_CATEGORIES:
            return "it is pulled"
        if state.ctrl_type in EXTERNAL_CONTROLLERS:
            self.waits.add(name)
            return "its controller waits for another program"
        if name in self.ego:
            return f"it is under test{self.ego.why(name)}"
        return "a controller of its own steers it" if state.ctrl_type != 0 or name in self._steered else ""

    def _moment(self, seen: dict[str, ObjectState], dt: float) -> tuple[Moment, list[Place]]:
        names, now, busy = tuple(seen), float(self.player.SE_GetSimulationTime()), self._busy()
        column = {
            what: np.array([getattr(state, what) for state in seen.values()], dtype=np.float64)
            for what in ("x", "y", "s", "speed", "length", "width", "center_x")
        }
        why = {name: self._why_not_ours(name, state) for name, state in seen.items()}
        anew = self.traffic.is_due(now + dt)
        places = [
            self._ledger.place(
                name, state, now, in_action=name in busy or name in self._touched, is_ours=not why[name], anew=anew
            )
            for name, state in seen.items()
        ]
        for name, place in zip(names, places, strict=True):
            if not self._ledger.vehicles[name].steered and (why[name] or not place.is_free):
                moved = "it is moved sideways all the time" if name in busy else "it is in no lane for driving"
                self.undriven[name] = why[name] or moved
            if name not in busy:
                self._ledger.vehicles[name].rest = None
        self._touched.clear()
        units = {first: k for k, first in enumerate(dict.fromkeys(self._unit.get(name, name) for name in names))}
        column_at = {
            what: np.array([getattr(place, what) for place in places], dtype=kind)
            for what, kind in (("width", float), ("offset", float), ("base", float), ("heading", float),
                               ("road", np.int64), ("lane", np.int64), ("is_free", np.bool_))
        }  # fmt: skip
        unit = np.array([units[self._unit.get(name, name)] for name in names], dtype=np.int64)
        moment = Moment(
            names, column["speed"], column_at["width"], column_at["offset"], column_at["is_free"],
            np.array([not why[name] for name in names], dtype=np.bool_),
            np.array([state.category in _TRUCK_CATEGORIES for state in seen.values()], dtype=np.bool_),
            base=column_at["base"],
            places=Places(
                column["x"], column["y"], column_at["heading"], column_at["road"], column_at["lane"], column["s"],
                column["length"], column["width"], column["center_x"], unit,
            ),
        )  # fmt: skip
        return moment, places

    def _on_element(self, name: bytes, kind: int, state: int, path: bytes) -> None:
        """Esmini's callback."""
        self._follow_action(name, kind, state, path)
        if self._also is not None:
            self._also(name, kind, state, path)

    def _follow_action(self, _name: bytes, kind: int, state: int, path: bytes) -> None:
        """A lateral action takes its vehicles, and gives them back."""
        key = path.decode(errors="replace")
        if kind == _ACTION_TYPE and key in self._moved_by:
            begins, now = state == _RUNNING_STATE, self.time()
            if begins:
                self._begun[key] = now
            elif self._running[key] and key in self._begun:
                self.spans.setdefault(key, []).append((self._begun.pop(key), now))
            self._running[key] = max(self._running[key] + (1 if begins else -1), 0)
            self._touched |= self._moved_by[key]


def _first_of(name: str, pulled_by: dict[str, str]) -> str:
    """Who pulls it, and whoever pulls that one."""
    for _ in range(len(pulled_by)):
        name = pulled_by.get(name, name)
    return name


def lateral_actions(scenario: Scenario) -> dict[str, set[str]]:
    """Lateral actions by the paths that esmini gives them -> names of the vehicles that each moves."""
    everybody = {entity.name for entity in scenario.entities}
    moved_by: defaultdict[str, set[str]] = defaultdict(set)
    for private in scenario.storyboard.init.privates:
        for action in private.actions:
            if isinstance(action.content, LATERAL_ACTIONS):
                word = _INIT_NAMES.get(type(action.content), "LateralAction")
                moved_by[f"Init {private.entity_ref} {word}"].add(private.entity_ref)
    groups = ((story, act, group) for story in scenario.storyboard.stories for act in story.acts
              for group in act.maneuver_groups)  # fmt: skip
    for story, act, group in groups:
        actors = everybody if group.actors.select_triggering_entities else set(group.actors.entity_refs)
        for maneuver in group.maneuvers:
            for event in maneuver.events:
                for action in event.actions:
                    if isinstance(action.content, LATERAL_ACTIONS):
                        parts = (story, act, group, maneuver, event, action)
                        moved_by["::".join(part.name for part in parts)] |= actors
    return dict(moved_by)
