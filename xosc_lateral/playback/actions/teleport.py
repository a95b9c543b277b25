"""TeleportAction: somewhere else, at once."""

from __future__ import annotations

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.actions.base import Domain, RunningAction
from xosc_lateral.playback.positions.resolve import resolve
from xosc_lateral.playback.trailers import align_trailers
from xosc_lateral.scenario.actions.teleport import TeleportAction


class RunningTeleport(RunningAction):
    """Takes effect when it starts. A towed vehicle stays behind its tractor."""

    domains = Domain.BOTH
    content: TeleportAction

    def start(self) -> None:
        """Put the actor there, with its trailers."""
        state = self.state
        place = resolve(self.content.position, self.simulation, route=state.route)
        if state.tow is not None:
            self.note(f"'{state.name}' is towed by '{state.tow.name}': it is not teleported")
            return
        state.put(place)
        state.teleported = True
        state.longitudinal_taken = state.speed_taken = True
        state.activity |= Activity.TELEPORTED
        align_trailers(state)


RUNNING: dict[type, type[RunningAction]] = {TeleportAction: RunningTeleport}
