"""Drivers in esmini, through the library that its user has (``libesminiLib.so``, ``esminiLib.dll``), by ctypes.

A vehicle's lateral place is reported as t in road coordinates: that alone leaves its speed, maneuvers and triggers as
written. A report by lane marks the longitudinal direction as reported as well, and stops the vehicle. Where a lateral
action runs, nothing is reported: both would write the same place.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from xosc_lateral.base.arrays import IntArray
from xosc_lateral.base.errors import FormatError, SimulationError
from xosc_lateral.base.segment import MINIMUM_SPEED
from xosc_lateral.drivers.model.profile import DriverProfile
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.workflows.conversion.result import Neighbours
from xosc_lateral.workflows.live.esmini_library import ObjectState, Player, StoryboardCallback
from xosc_lateral.workflows.live.paths import LARGEST_TURN_RATE, LEADING_OVER_SHARE, Moves
from xosc_lateral.workflows.live.traffic import Moment, Traffic
from xosc_lateral.world.motion.trajectory import SETTLING_TIME, settle
from xosc_lateral.world.scenario.controllers import Domains, controlled_entities
from xosc_lateral.world.scenario.private_actions import (
    FollowTrajectoryAction,
    LaneChangeAction,
    LaneOffsetAction,
    LateralDistanceAction,
    TeleportAction,
)
from xosc_lateral.world.scenario.scenario import Scenario
from xosc_lateral.world.surroundings.moment import OpenDriveRoads, Places

LATERAL_ACTIONS = (LaneChangeAction, LaneOffsetAction, LateralDistanceAction, FollowTrajectoryAction, TeleportAction)
"""Actions that say where a vehicle is sideways."""

_INIT_NAMES = {TeleportAction: "TeleportAction", FollowTrajectoryAction: "RoutingAction"}
"""What esmini calls actions of Init, apart from ``LateralAction``."""

_ACTION_TYPE, _RUNNING_STATE = 7, 2
"""Kind and state of a storyboard element (`StoryBoardElement::ElementType` and `State`)."""

_VEHICLE_TYPE, _TRUCK_CATEGORIES, _PULLED_CATEGORIES = 1, (2, 3, 4, 5), (3, 4)
"""`Object::Type`; `Vehicle::Category` of trucks, trailers and buses, and of what has no driver of its own."""


class _Lane(NamedTuple):
    """Where a vehicle is."""

    place: tuple[int, int]  # Road and lane.
    is_lane: bool
    is_driving: bool
    direction: float  # +1 where +t is to the left of where the vehicle drives, else -1.
    width: float  # [m]
    heading: float  # Of travel. [rad]


@dataclass(slots=True)
class _Rest:
    """What is left of the lateral speed at a maneuver's start."""

    rate: float  # At its start. [m/s]
    over: float  # It runs out over so long. [s]
    passed: float = 0.0  # [s]
    way: float = 0.0  # Beside the maneuver so far. [m]


LANE_STEP = 0.5
"""By more than this the offset changes when another lane is under a vehicle; at joints of roads it does by less. [m]"""

_SAME_PLACE = 0.05
"""A maneuver that moves a vehicle further in its first step puts it elsewhere, as a teleport does. [m]"""


class EsminiTraffic:
    """Drivers of the vehicles of a scenario that esmini has opened.

    Call `steer` before every ``SE_StepDT``, and `settle` after it; all else stays with the caller: opening, stepping,
    an external ego. The `library` is its path, a `ctypes.CDLL` or an object with the same functions, in which
    ``SE_Init`` was called for the `scenario`, which says which actions are lateral, and whose. Nobody of ours drives
    the `ego`, one or several; they are seen where they are. `on_element` is called as esmini's storyboard callback, of
    which there is one. For `seed`, `profiles` and `neighbours` see `Traffic`.
    """

    def __init__(
        self,
        library: Any,
        scenario: str | Path | Scenario,
        profile: DriverProfile,
        *,
        ego: str | Iterable[str] = (),
        seed: int = 0,
        profiles: dict[str, DriverProfile] | None = None,
        neighbours: Neighbours = Neighbours.BORROW,
        on_element: Callable[[bytes, int, int, bytes], None] | None = None,
    ) -> None:
        self.player = library if isinstance(library, Player) else Player(library)
        model = scenario if isinstance(scenario, Scenario) else read_scenario(scenario)
        self.entities = model.entities
        self._ego = {ego} if isinstance(ego, str) else set(ego)
        controlled = controlled_entities(model).items()  # the state of a vehicle names longitudinal controllers alone
        self._steered = {name for name, control in controlled if Domains.LATERAL in control.domains}
        self._moved_by = lateral_actions(model)
        self._running: Counter[str] = Counter()
        self._touched: set[str] = set()
        self._base: dict[str, float] = {}
        self._rates: dict[str, float] = {}  # of who is driven, lateral [m/s]
        self._rests: dict[str, _Rest] = {}
        self._lane_of: dict[str, _Lane] = {}
        self._also = on_element
        self.warnings: list[str] = []
        """What a user has to know, a line each."""
        path = (self.player.SE_GetODRFilename() or b"").decode()
        try:
            self.network = read_opendrive(path)
        except (FormatError, OSError) as error:
            raise SimulationError(f"{self.player.where}: its road can't be read: {error}") from error
        self._roads = {name: index for index, name in enumerate(self.network.road_ids)}
        left_hand = any(road.rule == "LHT" for road in self.network.roads)
        self.traffic = Traffic(
            profile, profiles=profiles, seed=seed, roads=OpenDriveRoads(self.network), neighbours=neighbours,
            left_hand=left_hand,
        )  # fmt: skip
        self._back = StoryboardCallback(self._on_element)
        self.player.SE_RegisterStoryBoardElementStateChangeCallback(self._back)
        names = {name for name, _ in self._objects()}
        if missing := sorted((self._ego | set(profiles or {})) - names):
            there = ", ".join(sorted(names))
            raise SimulationError(f"there is no vehicle {missing[0]!r} in the scenario (vehicles: {there})")
        self.moves: dict[str, tuple[float, bool]] = {}

    def steer(self, dt: float) -> Moves:
        """Say where everybody is sideways after the next step of `dt` seconds; before ``SE_StepDT(dt)``.

        Raises `SimulationError` if what the simulation says can't be used; nothing was reported then, and the
        simulation can go on.
        """
        there = dict(self._objects())
        for gone in self._base.keys() - there.keys():  # who is added again begins anew
            for known in (self._base, self._rests, self._lane_of):
                known.pop(gone, None)
        seen = [(name, state) for name, state in there.items() if self._is_sound(name, state)]
        moment = self._moment(seen, dt)
        moves = self.traffic.step(self.player.SE_GetSimulationTime() + dt, moment)
        for row, (_, state) in enumerate(seen):
            if moves.steered[row]:
                t = state.t + self._direction(state) * float(moves.offset[row] - moment.offset[row])
                self.player.SE_ReportObjectLateralPosition(state.id, t)
        self.moves = moves.by_name(moment.names)
        self._rates = dict(zip(moment.names, moves.rate.tolist(), strict=True))
        return moves

    def settle(self, dt: float) -> None:
        """Let the lateral speed that a maneuver has cut off at its start run out; after ``SE_StepDT(dt)``.

        A lateral action begins with no lateral speed, and says anew in every step where its vehicle is. What is
        reported after a step is seen in the vehicle's state until the next one, and changes nothing of the action.
        """
        busy = self._busy()
        for name, state in self._objects():
            offset, steered = self.moves.get(name, (0.0, False))
            if name in busy and steered:  # begun in this step, in which the driver's place still counts
                if abs(self.offset_of(state) - offset) > _SAME_PLACE:
                    continue
                bound = LEADING_OVER_SHARE * LARGEST_TURN_RATE * max(abs(state.speed), MINIMUM_SPEED)
                over = max(SETTLING_TIME, 4.0 * abs(self._rates[name]) / bound)
                self._rests[name] = _Rest(self._rates[name], over)
            elif self._road(state) < 0 or (name not in busy and name not in self._touched):
                self._rests.pop(name, None)
            elif name in self._rests:  # once more when the action is over: from there on the driver leads over
                rest = self._rests[name]
                rest.passed += dt
                rest.way = float(settle(np.array([rest.passed]), rest.over, rest.rate, 0.0)[0])
                self.player.SE_ReportObjectLateralPosition(state.id, state.t + self._direction(state) * rest.way)

    def _busy(self) -> set[str]:
        """Whom a lateral action moves now."""
        return {name for action, count in self._running.items() if count > 0 for name in self._moved_by[action]}

    def states(self) -> dict[str, ObjectState]:
        """Of all objects, by name."""
        return dict(self._objects())

    def offset_of(self, state: ObjectState) -> float:
        """From the centre of its lane, positive LEFT of travel. [m]"""
        return float(state.offset_t) * self._direction(state)

    def _direction(self, state: ObjectState) -> float:
        """+1 where +t is to the left of where a vehicle drives, on whichever lane it is, else -1."""
        road, network = self._road(state), self.network
        if road < 0:
            return 1.0
        direction = float(network.travel_direction(road, state.lane))
        if state.lane == 0 or not network.has_lane_at(road, state.lane, state.s):
            return direction
        ahead = network.pose_at(road, state.lane, state.s).heading + network.header_offset.heading
        return direction if np.cos(state.h - ahead) >= 0.0 else -direction

    # ---- what the simulation knows -----------------------------------------------------------------------------------
    def _objects(self) -> Iterable[tuple[str, ObjectState]]:
        for index in range(self.player.SE_GetNumberOfObjects()):
            number = self.player.SE_GetId(index)
            state = self.player.state(number)
            if state is not None:
                yield (self.player.SE_GetObjectName(number) or b"").decode(), state

    def _is_sound(self, name: str, state: ObjectState) -> bool:
        """Whether it is a vehicle that says where it is; one that doesn't is left alone, which is a warning."""
        if state.type != _VEHICLE_TYPE:
            return False
        numbers = {what: getattr(state, what) for what in ("x", "y", "h", "t", "s", "speed", "offset_t")}
        bad = [what for what, value in numbers.items() if not np.isfinite(value)]
        if bad and (line := f"vehicle {name!r}: {bad[0]} is {numbers[bad[0]]}; it is left alone") not in self.warnings:
            self.warnings.append(line)
        return not bad

    def _road(self, state: ObjectState) -> int:
        return self._roads.get(str(state.road), -1)

    def _moment(self, seen: list[tuple[str, ObjectState]], dt: float) -> Moment:
        names = tuple(name for name, _ in seen)
        column = {
            what: np.array([getattr(state, what) for _, state in seen], dtype=np.float64)
            for what in ("x", "y", "s", "speed", "offset_t", "length", "width", "center_x")
        }
        road = np.array([self._road(state) for _, state in seen], dtype=np.int64)
        lane = np.array([state.lane for _, state in seen], dtype=np.int64)
        lanes = self._lanes(seen, road, self.traffic.is_due(self.player.SE_GetSimulationTime() + dt))
        road = np.where([one.is_lane for one in lanes], road, -1)
        offset = column["offset_t"] * [one.direction for one in lanes]
        heading = np.array([one.heading for one in lanes])
        is_lane = np.array([one.is_driving for one in lanes], dtype=np.bool_)
        width = np.array([one.width for one in lanes])
        pulled = np.array([state.category in _PULLED_CATEGORIES for _, state in seen], dtype=np.bool_)
        others = self._ego | self._steered
        ours = np.array([state.ctrl_type == 0 and name not in others for name, state in seen], dtype=np.bool_)
        busy = self._busy()
        in_maneuver = np.array([name in busy or name in self._touched for name in names], dtype=np.bool_)
        for row, name in enumerate(names):
            if in_maneuver[row] or name not in self._base:
                self._base[name] = float(offset[row]) - (self._rests[name].way if name in self._rests else 0.0)
            elif abs(moved := float(offset[row]) - self.moves.get(name, (float(offset[row]), False))[0]) > LANE_STEP:
                self._base[name] += moved  # another lane is under it: it stays where it is
            if name not in busy:
                self._rests.pop(name, None)
        self._touched.clear()
        return Moment(
            names, column["speed"], width, offset, is_lane & ~in_maneuver, ours & ~pulled,
            np.array([state.category in _TRUCK_CATEGORIES for _, state in seen], dtype=np.bool_),
            base=np.array([self._base[name] for name in names]),
            places=Places(column["x"], column["y"], heading, road, lane, column["s"], column["length"],
                          column["width"], column["center_x"]),
        )  # fmt: skip

    def _lanes(self, seen: list[tuple[str, ObjectState]], road: IntArray, anew: bool) -> list[_Lane]:
        """The lanes that vehicles are on; between steps of the model as they were, if they are the same."""
        network, lanes = self.network, []
        for (name, state), index in zip(seen, road.tolist(), strict=True):
            known = self._lane_of.get(name)
            if known is None or anew or known.place != (index, state.lane):
                where = (index, state.lane, state.s)
                known = _Lane(where[:2], False, False, 1.0, 1.0, state.h)
                if index >= 0 and state.lane != 0 and network.has_lane_at(*where):
                    width, heading = float(network.lane_width(*where)), network.pose_at(*where).heading
                    is_driving = bool(network.lane_index(*where)[0] >= 0) and width > 0.0
                    heading += network.header_offset.heading  # x and y are inertial
                    known = _Lane(where[:2], True, is_driving, self._direction(state), max(width, 1e-3), heading)
                self._lane_of[name] = known
            lanes.append(known)
        return lanes

    def _on_element(self, name: bytes, kind: int, state: int, path: bytes) -> None:
        """Esmini's callback: a lateral action takes its vehicles, and gives them back."""
        key = path.decode(errors="replace")
        if kind == _ACTION_TYPE and key in self._moved_by:
            self._running[key] = max(self._running[key] + (1 if state == _RUNNING_STATE else -1), 0)
            self._touched |= self._moved_by[key]
        if self._also is not None:
            self._also(name, kind, state, path)


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
