"""ConnectTrailerAction and DisconnectTrailerAction."""

from __future__ import annotations

from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.playback.trailers import connect, disconnect
from xosc_lateral.scenario.actions.trailer import ConnectTrailerAction, DisconnectTrailerAction


class RunningConnectTrailer(RunningAction):
    """Hitch a trailer; one that hangs on already is left behind."""

    content: ConnectTrailerAction

    def start(self) -> None:
        """Hitch it."""
        trailer = self.simulation.entity(self.content.trailer_ref, self.content.place)
        if trailer is self.state.trailer:
            return
        disconnect(self.state)
        connect(self.state, trailer)


class RunningDisconnectTrailer(RunningAction):
    """Leave the trailer where it is."""

    def start(self) -> None:
        """Let it go."""
        if self.state.trailer is None:
            self.note(f"'{self.state.name}' has no trailer")
        disconnect(self.state)


RUNNING: dict[type, type[RunningAction]] = {
    ConnectTrailerAction: RunningConnectTrailer,
    DisconnectTrailerAction: RunningDisconnectTrailer,
}
