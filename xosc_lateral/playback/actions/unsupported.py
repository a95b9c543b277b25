"""Actions that the model holds no more of than their name."""

from __future__ import annotations

from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.scenario import Unsupported


class RunningUnsupported(RunningAction):
    """Named, and over at once."""

    content: Unsupported

    def start(self) -> None:
        """Say so."""
        self.note(self.content.reason or f"{self.content.kind} is not played")


RUNNING: dict[type, type[RunningAction]] = {Unsupported: RunningUnsupported}
