"""AddEntityAction, DeleteEntityAction, TrafficAction."""

from __future__ import annotations

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.actions.base import RunningAction
from xosc_lateral.playback.positions.resolve import resolve
from xosc_lateral.playback.storyboard import ActionElement, ElementState
from xosc_lateral.playback.trailers import disconnect
from xosc_lateral.scenario.actions.population import AddEntityAction, DeleteEntityAction, TrafficAction


class RunningAddEntity(RunningAction):
    """The entity appears at the position, with the speed that it had when it was taken out (at first: none)."""

    content: AddEntityAction

    def start(self) -> None:
        """Put it there; one that exists already is left alone."""
        state = self.simulation.entity(self.content.entity_ref, self.content.place)
        if state.active:
            self.note(f"'{state.name}' exists already: it is not added")
            return
        state.active = True
        state.put(resolve(self.content.position, self.simulation))
        state.teleported = True
        state.activity = Activity.ACTIVE | Activity.TELEPORTED


class RunningDeleteEntity(RunningAction):
    """The entity is gone, and with it what it was doing."""

    content: DeleteEntityAction

    def start(self) -> None:
        """Take it out; trailers are left behind."""
        state = self.simulation.entity(self.content.entity_ref, self.content.place)
        state.active = False
        state.activity = 0
        disconnect(state)
        if state.tow is not None:
            disconnect(state.tow)
        for element in (*state.init_actions, *state.event_actions):
            assert isinstance(element, ActionElement)
            if element.state is ElementState.RUNNING:
                element.end()


class RunningTraffic(RunningAction):
    """Traffic of a tool's own making: no file says where its cars are."""

    content: TrafficAction

    def start(self) -> None:
        """Say that there is none."""
        self.note(f"{self.content.kind}: its vehicles are made by the simulator and are not played")


RUNNING: dict[type, type[RunningAction]] = {
    AddEntityAction: RunningAddEntity,
    DeleteEntityAction: RunningDeleteEntity,
    TrafficAction: RunningTraffic,
}
