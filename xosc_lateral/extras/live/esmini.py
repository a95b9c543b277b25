"""Drivers in esmini, through the library that its user has (``libesminiLib.so``, ``esminiLib.dll``), by ctypes.

A vehicle's lateral place is reported as t in road coordinates, together with the speed as it is read: that leaves its
speed, maneuvers and triggers as written. Without the speed the player makes one of the way aside, of a car that stands;
a report by lane marks the longitudinal direction as reported, and stops the vehicle. Where a lateral action runs,
nothing is reported: both would write the same place. Whose place is whose: `esmini_places`.
"""

from __future__ import annotations

from collections import Counter, defaultdict, deque
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from xosc_lateral.base.arrays import FloatArray, IntArray
from xosc_lateral.base.errors import FormatError, SimulationError
from xosc_lateral.base.segment import clock_rate
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.extras.live.esmini_library import OBJECT_STATE, EsminiLibrary, ObjectState, StoryboardCallback
from xosc_lateral.extras.live.esmini_places import Ledger, LivePlaces, Rest
from xosc_lateral.extras.live.loop import Row, UnderTest
from xosc_lateral.extras.live.moment import CLOCK_TOLERANCE, Moves, OpenDriveRoads, Places, left_of_gap
from xosc_lateral.extras.live.traffic import Moment, Traffic
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

_PLACE = ("x", "y", "h", "t", "s", "speed", "offset_t")
"""What a vehicle's state has to say."""

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
        self.player = library if isinstance(library, EsminiLibrary) else EsminiLibrary(library)
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
        names = {*self.player.objects()[0]}
        if missing := sorted((self.ego.named | set(profiles or {})) - names):
            there = ", ".join(sorted(names))
            raise SimulationError(f"there is no vehicle {missing[0]!r} in the scenario (vehicles: {there})")
        self._moved: tuple[tuple[str, ...], Moves | None] = ((), None)
        self._signs: list[tuple[str, int, int]] = []
        self._why: list[str] = []
        self._is_truck = np.zeros(0, dtype=np.bool_)
        self._named: tuple[str, ...] = ()
        self._units = np.zeros(0, dtype=np.int64)
        pulled_by = {entity.trailer: entity.name for entity in model.entities if entity.trailer is not None}
        self._unit = {entity.name: _first_of(entity.name, pulled_by) for entity in model.entities}

    def steer(self, dt: float) -> Moves:
        """Say where everybody is sideways after the next step of `dt` seconds; before ``SE_StepDT(dt)``.

        Raises `SimulationError` if what the simulation says can't be used; nothing was reported then, and the
        simulation can go on.
        """
        names, every = self.player.objects()
        self._ledger.expect(names)
        rows = self._sound(names, every)
        states = every[rows]
        moment, places = self._moment(rows, states, dt)
        moves = self.traffic.step(self.player.SE_GetSimulationTime() + dt, moment)
        known = self._ledger.known
        known["steered"][rows], known["rate"][rows] = moves.steered, moves.rate
        steered = np.flatnonzero(moves.steered)
        t = places.centre[steered] + places.left[steered] * moves.offset[steered]
        begin = np.flatnonzero(np.isnan(known["place"][rows[steered]])).tolist()
        starts = {moment.names[steered[k]]: t[k] - states["t"][steered[k]] for k in begin}
        self._tell(rows[steered], states[steered], t)
        known["place"][rows[steered]] = moves.offset[steered]
        for k in steered.tolist() if self.undriven else ():
            self.undriven.pop(moment.names[k], None)
        for k, name in enumerate(moment.names if starts else ()):  # what it pulls begins behind a vehicle
            first = self._unit.get(name, name)
            if first != name and first in starts:
                self._tell(rows[k : k + 1], states[k : k + 1], states["t"][k : k + 1] + starts[first])
        self._moved = moment.names, moves
        return moves

    @property
    def moves(self) -> dict[str, tuple[float, bool]]:
        """Offset of each vehicle [m], and whether it is its driver's, as `steer` had them."""
        names, moves = self._moved
        return {} if moves is None else moves.by_name(names)

    def settle(self, dt: float) -> None:
        """Let what a maneuver has cut off at its start run out, offset and lateral speed; after ``SE_StepDT(dt)``.

        A lateral action begins with no lateral speed, a trajectory without offset, and both say anew in every step
        where their vehicle is. What is reported after a step is seen in the vehicle's state until the next one, and
        changes nothing of the action.
        """
        busy, ledger = self._busy(), self._ledger
        if not busy and not ledger.rests:
            return
        names, every = self.player.objects()
        ledger.expect(names)
        for row, name in enumerate(names):
            if name not in busy and name not in ledger.rests:
                continue
            known, state = ledger.known[row], every[row : row + 1]
            speed = state["speed"]
            pace = float(clock_rate(speed)[0])
            if name in busy and known["steered"]:  # begun in this step, in which the driver's place still counts
                if (gap := ledger.dropped(row, state)) is None:
                    continue
                rate = float(known["rate"]) / max(pace, CLOCK_TOLERANCE)
                over = leading_time(*np.array([[gap], [rate], [speed[0]]]))
                ledger.rests[name] = Rest(gap, rate, float(over[0]), -dt * pace)
            elif ledger.roads_of(state)[0] < 0 or (name not in busy and name not in self._touched):
                ledger.rests.pop(name, None)
            # once more when the action is over: from there on the driver leads over
            if (rest := ledger.rests.get(name)) is not None and (rest.gap or abs(speed[0]) > AT_REST):
                rest.passed += dt * pace
                left = left_of_gap(*np.array([[rest.passed / rest.over], [rest.over], [rest.gap], [rest.rate]]))
                room = float(ledger.room_to_middle(state)[0])
                rest.way = float(left[0] * smooth_step(np.array([min(max(room / MIDDLE, 0.0), 1.0)]))[0])
                if room > 0.0 and rest.way:
                    t = float(state["t"][0] + ledger.left_of(state)[0] * rest.way)
                    self.player.SE_ReportObjectLateralPosition(int(state["id"][0]), t)

    # ---- a simulation that runs by itself (`loop`) -------------------------------------------------------------------
    def time(self) -> float:
        """Now. [s]"""
        return float(self.player.SE_GetSimulationTime())

    def is_over(self) -> bool:
        """Whether the player wants to end."""
        return bool(self.player.SE_GetQuitFlag() == 1)

    def rows(self) -> Iterator[Row]:
        """Where everybody is now."""
        now, (names, states), moves = self.time(), self.player.objects(), self.moves
        columns = [states[what].tolist() for what in ("x", "y", "h", "speed", "road", "lane", "s")]
        offsets = (states["offset_t"] * self._ledger.left_of(states)).tolist()
        for k, name in enumerate(names):
            move, state = moves.get(name, (float("nan"), False)), states[k]
            at = (column[k] for column in columns)
            yield now, name, *at, offsets[k], *move, float(state["z"]), float(state["p"]), float(state["r"])

    def drive(self, step: float) -> None:
        """On by a step [s]; raises `SimulationError` if the player can't."""
        self.steer(step)
        if self.player.SE_StepDT(step) != 0:
            raise SimulationError(f"{self.player.where} stopped at {self.time():g} s")
        self.settle(step)

    def states(self) -> dict[str, ObjectState]:
        """Of all objects, by name."""
        names, states = self.player.objects()
        return {name: ObjectState.from_buffer_copy(state.tobytes()) for name, state in zip(names, states, strict=True)}

    def offset_of(self, state: ObjectState) -> float:
        """From the centre of the lane that it is on, positive LEFT of travel. [m]"""
        return float(state.offset_t * self._ledger.left_of(np.frombuffer(bytes(state), dtype=OBJECT_STATE))[0])

    # ---- what is told ------------------------------------------------------------------------------------------------
    def _tell(self, rows: IntArray, states: NDArray[Any], t: FloatArray) -> None:
        """Report places of vehicles [m], and the speeds that there are; who stands is where he is."""
        is_moving = np.abs(states["speed"]) > AT_REST
        numbers, speeds, at = (column[is_moving].tolist() for column in (states["id"], states["speed"], t))
        for report, values in ((self.player.SE_ReportObjectSpeed, speeds),
                               (self.player.SE_ReportObjectLateralPosition, at)):  # fmt: skip
            deque(map(report, numbers, values), maxlen=0)  # whatever it answers
        self._ledger.tell(rows, states, np.where(is_moving, t, states["t"]))

    def _say(self, key: tuple[str, str], line: str) -> None:
        """A warning, once for its key."""
        if key not in self._said:
            self._said.add(key)
            self.warnings.append(line)

    # ---- what the simulation knows -----------------------------------------------------------------------------------
    def _busy(self) -> set[str]:
        """Whom a lateral action moves now."""
        return {name for action, count in self._running.items() if count > 0 for name in self._moved_by[action]}

    def _sound(self, names: tuple[str, ...], states: NDArray[Any]) -> IntArray:
        """Rows of vehicles that say where they are; one that doesn't is left alone, which is a warning."""
        is_vehicle = states["type"] == _VEHICLE_TYPE
        for k in np.flatnonzero(~is_vehicle).tolist():
            self.undriven.setdefault(names[k], "no vehicle")
        finite = np.isfinite([states[what] for what in _PLACE])
        for k in np.flatnonzero(is_vehicle & ~finite.all(axis=0)).tolist():
            what = _PLACE[int(np.argmin(finite[:, k]))]
            self._say((names[k], what), f"vehicle {names[k]!r}: {what} is {states[what][k]}; it is left alone")
        return np.flatnonzero(is_vehicle & finite.all(axis=0))

    def _why_not_ours(self, name: str, controller: int, category: int) -> str:
        """Why no driver of ours has a vehicle; empty: he may."""
        if name in self.ego.named:
            return "it is under test"
        if category in _PULLED_CATEGORIES:
            return "it is pulled"
        if controller in EXTERNAL_CONTROLLERS:
            self.waits.add(name)
            return "its controller waits for another program"
        if name in self.ego:
            return f"it is under test{self.ego.why(name)}"
        return "a controller of its own steers it" if controller != 0 or name in self._steered else ""

    def _moment(self, rows: IntArray, states: NDArray[Any], dt: float) -> tuple[Moment, LivePlaces]:
        names = tuple([self._ledger.names[row] for row in rows.tolist()])
        now, busy = float(self.player.SE_GetSimulationTime()), self._busy()
        signs = list(zip(names, states["ctrl_type"].tolist(), states["category"].tolist(), strict=True))
        if signs != self._signs:
            self._signs, self._why = signs, [self._why_not_ours(*sign) for sign in signs]
            self._is_truck = np.isin(states["category"], _TRUCK_CATEGORIES)
        is_ours = np.array([not reason for reason in self._why], dtype=np.bool_)
        touched = busy | self._touched
        in_action = np.array([name in touched for name in names], dtype=np.bool_) if touched else np.zeros_like(is_ours)
        places = self._ledger.places(
            rows, states, now, in_action=in_action, is_ours=is_ours, anew=self.traffic.is_due(now + dt)
        )
        for k in np.flatnonzero(~self._ledger.known["steered"][rows] & ~(is_ours & places.is_free)).tolist():
            moved = "it is moved sideways all the time" if names[k] in busy else "it is in no lane for driving"
            self.undriven[names[k]] = self._why[k] or moved
        self._ledger.rests = {name: rest for name, rest in self._ledger.rests.items() if name in busy}
        self._touched.clear()
        if names != self._named:
            first = {name: self._unit.get(name, name) for name in names}
            units = {one: k for k, one in enumerate(dict.fromkeys(first.values()))}
            self._named, self._units = names, np.array([units[first[name]] for name in names], dtype=np.int64)
        moment = Moment(
            names, states["speed"], places.width, places.offset, places.is_free, is_ours,
            self._is_truck, base=places.base,
            places=Places(
                states["x"], states["y"], places.heading, places.road, places.lane, states["s"], states["length"],
                states["width"], states["center_x"], self._units,
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
