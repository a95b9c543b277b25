"""A scenario being played: everything that actions, conditions and positions may look at."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from typing import Any

from xosc_lateral.base.errors import PlaybackError
from xosc_lateral.world.motion.nominal import Note, PlayedAction
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.player.unwatched import Unwatched
from xosc_lateral.world.player.values import Values
from xosc_lateral.world.road.network import RoadNetwork
from xosc_lateral.world.scenario import Action, Place, Scenario, TrafficSignalController
from xosc_lateral.world.scenario.controllers import DrivingControllers
from xosc_lateral.world.scenario.scenario import TrafficSignalPhase


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
        self.played: list[PlayedAction] = []
        """All actions started so far, in order of start."""
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
            raise place.error(f"entity '{name}' is not in the scenario", PlaybackError)
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
        self.played.append(PlayedAction(action, actor, path, self.time, None))
        return len(self.played) - 1

    def record_end(self, number: int) -> None:
        """Note the end of an action."""
        self.played[number] = replace(self.played[number], end=self.stamp)
