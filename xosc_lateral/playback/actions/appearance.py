"""Actions that nothing in playback depends on: what can be seen, heard, or is sent to a simulator."""

from __future__ import annotations

from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.scenario.actions.appearance import AnimationAction, LightStateAction, VisibilityAction
from xosc_lateral.scenario.actions.userdefined import UserDefinedAction
from xosc_lateral.scenario.actions.values import SetMonitorAction


class RunningAppearance(RunningAction):
    """Over at once; the start is recorded like that of every action."""


class RunningLightState(RunningAction):
    """Over when the light has changed. [s]"""

    content: LightStateAction

    def start(self) -> None:
        """Count from now."""
        self._left = self.content.transition_time

    def step(self, time: float, step: float) -> None:
        """Wait; a light that flashes does so until something else is asked of it."""
        if self._left <= 0.0 and self.content.mode != "flashing":
            self.end()
        self._left -= step


class RunningAnimation(RunningAction):
    """Over after its duration, never when it loops. [s]"""

    content: AnimationAction

    def start(self) -> None:
        """Count from now."""
        self._left = self.content.duration

    def step(self, time: float, step: float) -> None:
        """Wait."""
        if self._left <= 0.0 and not self.content.loop:
            self.end()
        self._left -= step


RUNNING: dict[type, type[RunningAction]] = {
    AnimationAction: RunningAnimation,
    LightStateAction: RunningLightState,
    SetMonitorAction: RunningAppearance,
    UserDefinedAction: RunningAppearance,
    VisibilityAction: RunningAppearance,
}
