"""Controller actions: named, and replaced by the default driver."""

from __future__ import annotations

from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.scenario.actions.controller import (
    ActivateControllerAction,
    AssignControllerAction,
    OverrideControllerValueAction,
)


class RunningController(RunningAction):
    """Assigning, activating or overriding a controller changes nothing here; it is over at once."""

    def start(self) -> None:
        """Say that the default driver drives."""
        name = ""
        if isinstance(self.content, AssignControllerAction) and self.content.controller is not None:
            name = f" '{self.content.controller.name}'"
        self.note(f"controller{name} of '{self.state.name}': the default driver drives instead")
        self.end()


RUNNING: dict[type, type[RunningAction]] = {
    ActivateControllerAction: RunningController,
    AssignControllerAction: RunningController,
    OverrideControllerValueAction: RunningController,
}
