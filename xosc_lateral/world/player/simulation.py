"""A scenario being played: everything that actions, conditions and positions may look at."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from math import isnan
from typing import Any

import numpy as np

from xosc_lateral.base.arrays import FloatArray
from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.base.note import Note
from xosc_lateral.world.motion.nominal import FollowedRoute, PlayedAction
from xosc_lateral.world.player.drive import along_reference, beside_line
from xosc_lateral.world.player.recorder import MAXIMUM_COORDINATE, MAXIMUM_SPEED, Rows
from xosc_lateral.world.player.state import ACTIVE, EntityState
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.road.geometry import Arc, Line
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario.controllers import DrivingControllers
from xosc_lateral.world.scenario.enums import ParameterType, Rule
from xosc_lateral.world.scenario.global_actions import ModifyOperation
from xosc_lateral.world.scenario.place import Place
from xosc_lateral.world.scenario.scenario import Parameter, Scenario, TrafficSignalController, TrafficSignalPhase


@dataclass
class _Clock:
    """Phases of one controller, for ever, from `start` on. [s]"""

    phases: Sequence[TrafficSignalPhase]
    start: float

    def phase_at(self, time: float) -> tuple[TrafficSignalPhase, float] | None:
        """The phase and when it began [s]; None before the first, or without phases."""
        if not self.phases or time < self.start:
            return None
        cycle = sum(phase.duration for phase in self.phases)
        into = (time - self.start) % cycle if cycle > 0.0 else 0.0
        left, before = into, 0.0
        for phase in self.phases:
            if left < phase.duration or phase is self.phases[-1]:
                break
            left -= phase.duration
            before += phase.duration
        return phase, time - into + before

    def go_to(self, name: str, time: float) -> bool:
        """Start the named phase now; False if there is none of that name."""
        before = 0.0
        for phase in self.phases:
            if phase.name == name:
                self.start = time - before
                return True
            before += phase.duration
        return False


class TrafficSignals:
    """All signals of a run.

    A controller starts `delay` seconds after the one that it refers to, else after the scenario's start (ASAM
    OpenSCENARIO XML, TrafficSignalController); a state set by an action holds until the next phase begins.
    """

    def __init__(self, controllers: Sequence[TrafficSignalController]) -> None:
        self._controllers = {controller.name: controller for controller in controllers}
        self._clocks = {c.name: _Clock(c.phases, self._start(c)) for c in controllers}
        self._set: dict[str, tuple[str, float]] = {}

    def set_state(self, signal: str, state: str, time: float) -> None:
        """Show a state from now on."""
        self._set[signal] = (state, time)

    def go_to_phase(self, controller: str, phase: str, time: float) -> bool:
        """Send a controller to a phase; False if there is no such controller or phase."""
        clock = self._clocks.get(controller)
        return clock is not None and clock.go_to(phase, time)

    def phase(self, controller: str, time: float) -> str | None:
        """Name of a controller's phase; None: unknown controller, or not started."""
        clock = self._clocks.get(controller)
        shown = None if clock is None else clock.phase_at(time)
        return None if shown is None else shown[0].name

    def state(self, signal: str, time: float) -> str | None:
        """What a signal shows; None: nobody has said."""
        best: tuple[str, float] | None = None
        for clock in self._clocks.values():
            phase = clock.phase_at(time)
            if phase is not None and signal in (states := dict(phase[0].states)):
                best = states[signal], phase[1]
        as_set = self._set.get(signal)
        if as_set is not None and (best is None or as_set[1] >= best[1]):
            return as_set[0]
        return None if best is None else best[0]

    def _start(self, controller: TrafficSignalController) -> float:
        start, seen = 0.0, set[str]()
        current: TrafficSignalController | None = controller
        while current is not None and current.name not in seen:
            seen.add(current.name)
            start += current.delay
            current = self._controllers.get(current.reference) if current.reference else None
        return start


class Simulation:
    """All that one play-out of a scenario knows."""

    def __init__(self, scenario: Scenario, network: RoadNetwork) -> None:
        self.scenario = scenario
        self.network = network
        for_carla = scenario.header.is_left_handed
        self.entities = tuple(
            EntityState(entity, network, controllers=DrivingControllers(entity.controllers, for_carla=for_carla))
            for entity in scenario.entities
        )
        self.unwatched = Unwatched(self.entities)
        self.by_name = {state.name: state for state in self.entities}
        self.parameters = Values("parameter", scenario.parameters)
        self.variables = Values("variable", scenario.variables)
        self.signals = TrafficSignals(scenario.traffic_signal_controllers)
        self.time = 0.0
        """Time at the start of the present frame. [s]"""
        self.stamp = 0.0
        """Time to be written beside what happens now: that of the row in which it first shows. [s]"""
        self.time_of_day: tuple[datetime, bool, float] | None = None
        """What the environment's clock showed, whether it goes on, and when it was set. [s]"""
        self.derives_motion = False
        """Somebody asks for velocities, accelerations or the way travelled."""
        self.derives_height = False
        """Somebody asks for their vertical components, which cost a look at the road for entities on trajectories."""
        self.derives_states = False
        """Somebody asks since when an entity has stood, been at the end of its road, or off it."""
        self.derives_off_road = False
        self.when_built: list[Callable[[Any], None]] = []
        """Called with all elements, by `last_name`, once the storyboard stands: conditions on them look for theirs."""
        self.notes: list[Note] = list(scenario.notes)
        self.routes: list[FollowedRoute] = []
        self._noted = {(note.what, note.path, note.line) for note in self.notes}
        self.played: list[PlayedAction] = []
        """All actions started so far, in order of start."""

    def entity(self, name: str, place: Place) -> EntityState:
        """The entity of that name, to be looked at now or later; raises `PlaybackError` at `place` if there is none."""
        state = self.actor(name, place)
        state.is_watched = True
        self.wake(state)
        return state

    def everybody(self) -> tuple[EntityState, ...]:
        """All entities, to be looked at now or later."""
        return tuple(self.entity(state.name, state.entity.place) for state in self.entities)

    def wake(self, state: EntityState) -> None:
        """Bring an entity that follows its lane unwatched to where it is now."""
        self.unwatched.wake(state, derives_motion=self.derives_motion)

    def actor(self, name: str, place: Place) -> EntityState:
        """The entity of that name, for actions of its own alone; raises `PlaybackError` as `entity` does."""
        state = self.by_name.get(name)
        if state is None:
            raise place.error(f"entity '{name}' is not in the scenario", PlaybackError)
        return state

    def note(self, what: str, place: Place, *, is_doubt: bool = False, entity: str | None = None) -> None:
        """Say, once for each place, that something was not played, or not as written; or that it can't be meant so."""
        key = (what, place.path, place.line)
        if key not in self._noted:
            self._noted.add(key)
            when = "" if entity is None or self.time <= 0.0 else f" (at {self.time:.2f} s)"
            self.notes.append(place.note(what + when, is_warning=is_doubt, entity=entity))

    def values_of(self, content: object) -> tuple[Values, str]:
        """Parameters or variables, whichever an action or a condition refers to, and the name that it gives."""
        name = getattr(content, "parameter_ref", None)
        return (self.variables, getattr(content, "variable_ref", "")) if name is None else (self.parameters, name)

    def clock(self) -> datetime | None:
        """Time of day now; None if no environment has set it."""
        if self.time_of_day is None:
            return None
        date_time, goes_on, set_at = self.time_of_day
        return date_time + timedelta(seconds=self.time - set_at) if goes_on else date_time


# ---- entities that only follow their lanes and that nobody looks at: many frames at once, with the same numbers ----
MAXIMUM_FRAMES, MINIMUM_FRAMES = 1000, 5
"""Frames that are worked out at once: more would often be for nothing, and fewer are not worth it."""


class Unwatched:
    """Who moves frame by frame, and who is ahead of the run."""

    def __init__(self, entities: Iterable[EntityState]) -> None:
        self.awake = {state: Rows(state) for state in entities}
        """Entities that move frame by frame, and their rows."""
        self.frames = 0
        """Rows that those have."""
        self._ahead: dict[EntityState, tuple[int, FloatArray, Rows]] = {}
        self._due: dict[int, list[EntityState]] = {}

    def rest(self, step: float) -> None:
        """Move everybody ahead who can be, after a frame of `step` [s] is written."""
        for state in [state for state in self.awake if _follows_its_lane(state)]:
            values = _way_ahead(state, state.speed * step)
            if (
                len(values) >= MINIMUM_FRAMES
                and abs(values[-1]) <= MAXIMUM_COORDINATE
                and abs(state.speed) <= MAXIMUM_SPEED
            ):
                self._ahead[state] = self.frames, values, self.awake.pop(state)
                self._due.setdefault(self.frames + len(values), []).append(state)

    def wake_due(self, *, derives_motion: bool) -> None:
        """Before a frame: take back whose frames are used up."""
        for state in self._due.pop(self.frames, ()):
            if state in self._ahead and self.frames - self._ahead[state][0] == len(self._ahead[state][1]):
                self.wake(state, derives_motion=derives_motion)

    def wake(self, state: EntityState, *, derives_motion: bool) -> None:
        """Bring an entity to where it was when the frame before ended; it moves frame by frame from here on."""
        if state not in self._ahead:
            return
        first, values, rows = self._ahead.pop(state)
        if done := self.frames - first:
            rows.follow(values[:done])
            state.move_to(state.road, state.lane, float(values[done - 1]), state.offset_t)
        state.last_place = state.road, state.s, state.offset_t
        state.begin_frame()
        state.previous = state.plane if derives_motion else None
        self.awake[state] = rows

    def wake_all(self) -> None:
        """At the end of the run."""
        for state in list(self._ahead):
            self.wake(state, derives_motion=False)


def _follows_its_lane(state: EntityState) -> bool:
    return (
        not state.is_watched
        and state.activity == ACTIVE | state.steered
        and state.free_pose is None
        and state.tow is None
        and state.trailer is None
        and not state.at_road_end
        and not state.longitudinal_taken
        and not state.running
    )


def _way_ahead(state: EntityState, distance: float) -> FloatArray:
    """s after each of the next frames in this lane section, as `drive` would have it, shape (n,). [m]"""
    s = state.s
    if abs(state.speed) <= EPSILON:
        return np.full(MAXIMUM_FRAMES, s)
    way = 1 if state.is_forward else -1
    road, (start, end) = state.network.roads[state.road], state.section
    places = [s]
    while start < s < end and len(places) <= MAXIMUM_FRAMES:
        low, high, element, begin, centre = road.stretch_of(state.lane, s)
        if isnan(centre):
            s += way * along_reference(state, s, distance)
            places.append(s)
        elif isinstance(element, Line | Arc):
            move = way * beside_line(element.curvature_at(s - begin), centre + state.offset_t, distance)
            room = (min(high, end) - s if move > 0.0 else s - max(low, start)) / abs(move)
            count = 1 + int(min(room, MAXIMUM_FRAMES - len(places)))
            ways = np.add.accumulate(np.array([s] + [move] * count))  # one after the other: the same last bits
            ways = ways[1 : 2 + int(np.count_nonzero((ways[1:-1] >= low) & (ways[1:-1] < high)))]
            places.extend(ways.tolist())
            s = places[-1]
        else:
            while low <= s < high and len(places) <= MAXIMUM_FRAMES:
                s += way * beside_line(element.curvature_at(s - begin), centre + state.offset_t, distance)
                places.append(s)
    values = np.array(places[1:])
    inside = (values > start) & (values < end)
    return values if inside.all() else values[: int(np.argmin(inside))]


# ---- Parameters and variables that change while playing, and how  ----
Value = bool | float | int | str

_INTEGER_TYPES = frozenset({ParameterType.INT, ParameterType.UNSIGNED_INT, ParameterType.UNSIGNED_SHORT})


def holds(left: float, rule: Rule, right: float) -> bool:
    """Compare measured quantities with the reference player's tolerance."""
    # One difference for all: the tolerance added to either side is rounded differently, and a rule and its mirror image
    # would disagree about one and the same pair. Equal infinities have none.
    beyond = 0.0 if left == right else left - right
    if rule is Rule.GREATER_THAN:
        return beyond > EPSILON
    if rule is Rule.LESS_THAN:
        return beyond < -EPSILON
    if rule is Rule.GREATER_OR_EQUAL:
        return beyond >= -EPSILON
    return beyond <= EPSILON if rule is Rule.LESS_OR_EQUAL else (abs(beyond) < EPSILON) is (rule is Rule.EQUAL_TO)


class Values:
    """Named values with their types: the parameters, or the variables, of a run; `kind`: what messages call one."""

    def __init__(self, kind: str, declared: Mapping[str, Parameter]) -> None:
        self.kind = kind
        self._types = {name: parameter.type for name, parameter in declared.items()}
        self._values: dict[str, Value] = {}
        for name, parameter in declared.items():
            self.set(name, parameter.value)

    def __contains__(self, name: str) -> bool:
        return name in self._values

    def __getitem__(self, name: str) -> Value:
        return self._values[name]

    def set(self, name: str, text: str) -> None:
        """Give a declared value another one, written as in a file."""
        self._values[name] = _read(text, self._types[name])

    def modify(self, name: str, operation: ModifyOperation, by: float) -> bool:
        """Add to a number or multiply it; False if the value is not a number."""
        value = self._values[name]
        if isinstance(value, str | bool):
            return False
        result = value + by if operation is ModifyOperation.ADD else value * by
        self._values[name] = int(result) if self._types[name] in _INTEGER_TYPES else result
        return True

    def compare(self, name: str, rule: Rule, text: str) -> bool:
        """Compare a value with one written as in a file, in the value's own type."""
        value = self._values[name]
        other = _read(text, self._types[name])
        if isinstance(value, float) and isinstance(other, float):
            return holds(value, rule, other)
        if isinstance(value, str) != isinstance(other, str):
            value, other = str(value), str(other)
        return rule.holds(value, other)


def _read(text: str, kind: ParameterType) -> Value:
    """The value of a text; the text itself where it is not of its type (the standard leaves that open)."""
    try:
        if kind is ParameterType.DOUBLE:
            return float(text)
        if kind in _INTEGER_TYPES:
            return int(float(text))
    except (ValueError, OverflowError):
        return text
    return text.strip() in ("true", "1") if kind is ParameterType.BOOLEAN else text
