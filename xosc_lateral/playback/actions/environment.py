"""EnvironmentAction: weather, light, time of day."""

from __future__ import annotations

from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.scenario.actions.environment import EnvironmentAction


class RunningEnvironment(RunningAction):
    """Only the time of day matters to playback; the rest is recorded with the start of the action."""

    content: EnvironmentAction

    def start(self) -> None:
        """Set the clock."""
        clock = self.content.environment.time_of_day
        if clock is not None:
            self.simulation.time_of_day = (clock.date_time, clock.animation, self.simulation.time)


RUNNING: dict[type, type[RunningAction]] = {EnvironmentAction: RunningEnvironment}
