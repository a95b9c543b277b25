"""Traffic signals: states set by actions, and controllers that go through their phases."""

from __future__ import annotations

from collections.abc import Sequence

from xosc_lateral.scenario import TrafficSignalController


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
