"""A scenario being played: everything that actions, conditions and positions may look at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from typing import Any

from xosc_lateral.errors import PlaybackError
from xosc_lateral.motion.nominal import Note, PlayedAction
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.unwatched import Unwatched
from xosc_lateral.playback.values import Values
from xosc_lateral.road.network import RoadNetwork
from xosc_lateral.scenario import Action, Place, Scenario, TrafficSignalController


class _Clock:
    """Phases of one controller, for ever."""

    def __init__(self, controller: TrafficSignalController, start: float) -> None:
        self.phases = controller.phases
        self.start = start
        self.cycle = sum(phase.duration for phase in controller.phases)

    def phase_at(self, time: float) -> int | None:
        """Index of the phase; None before the first, or without phases."""
        if not self.phases or time < self.start:
            return None
        left = (time - self.start) % self.cycle if self.cycle > 0.0 else 0.0
        for index, phase in enumerate(self.phases):
            if left < phase.duration:
                return index
            left -= phase.duration
        return len(self.phases) - 1

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
        self._clocks = {c.name: _Clock(c, self._start(c)) for c in controllers}
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
        index = None if clock is None else clock.phase_at(time)
        return None if clock is None or index is None else clock.phases[index].name

    def state(self, signal: str, time: float) -> str | None:
        """What a signal shows; None: nobody has said."""
        best: tuple[float, str] | None = None
        for clock in self._clocks.values():
            index = clock.phase_at(time)
            if index is None:
                continue
            states = dict(clock.phases[index].states)
            if signal in states:
                best = (self._phase_start(clock, index, time), states[signal])
        if signal in self._set:
            state, since = self._set[signal]
            if best is None or since >= best[0]:
                return state
        return None if best is None else best[1]

    def _start(self, controller: TrafficSignalController) -> float:
        start, seen = 0.0, set[str]()
        current: TrafficSignalController | None = controller
        while current is not None and current.name not in seen:
            seen.add(current.name)
            start += current.delay
            current = self._controllers.get(current.reference) if current.reference else None
        return start

    @staticmethod
    def _phase_start(clock: _Clock, index: int, time: float) -> float:
        into = (time - clock.start) % clock.cycle if clock.cycle > 0.0 else 0.0
        return time - into + sum(phase.duration for phase in clock.phases[:index])


class Simulation:
    """All that one play-out of a scenario knows."""

    def __init__(self, scenario: Scenario, network: RoadNetwork) -> None:
        self.scenario = scenario
        self.network = network
        self.entities = tuple(EntityState(entity, network) for entity in scenario.entities)
        self.unwatched = Unwatched(self.entities)
        self.by_name = {state.name: state for state in self.entities}
        self.parameters = Values(scenario.parameters)
        self.variables = Values(scenario.variables)
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
        """Called with the root of the storyboard once it stands: conditions on its elements look for theirs."""
        self.notes: list[Note] = []
        self._noted: set[tuple[str, str, int | None]] = set()
        self._played: list[_Record] = []
        for remark in scenario.remarks:
            self.note(remark.reason or "is not read", remark.place)

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
            raise PlaybackError(
                f"entity '{name}' is not in the scenario", path=place.path, line=place.line, element=place.element
            )
        return state

    def note(self, what: str, place: Place) -> None:
        """Say, once for each place, that something was not played, or not as written."""
        key = (what, place.path, place.line)
        if key not in self._noted:
            self._noted.add(key)
            self.notes.append(Note(what, place.path, place.line, place.element))

    def clock(self) -> datetime | None:
        """Time of day now; None if no environment has set it."""
        if self.time_of_day is None:
            return None
        date_time, goes_on, set_at = self.time_of_day
        return date_time + timedelta(seconds=self.time - set_at) if goes_on else date_time

    # ---- what was played ---------------------------------------------------------------------------------------------
    def record_start(self, action: Action, actor: str | None, path: tuple[str, ...]) -> int:
        """Note the start of an action; returns the number under which to note its end."""
        self._played.append(_Record(action, actor, path, self.time))
        return len(self._played) - 1

    def record_end(self, number: int) -> None:
        """Note the end of an action."""
        self._played[number].end = self.stamp

    def played(self) -> tuple[PlayedAction, ...]:
        """All actions started so far, in order of start."""
        return tuple(PlayedAction(r.action, r.actor, r.path, r.start, r.end) for r in self._played)


class _Record:
    """A started action; `PlayedAction` while its end is not known."""

    __slots__ = ("action", "actor", "end", "path", "start")

    def __init__(self, action: Action, actor: str | None, path: tuple[str, ...], start: float) -> None:
        self.action, self.actor, self.path, self.start = action, actor, path, start
        self.end: float | None = None
