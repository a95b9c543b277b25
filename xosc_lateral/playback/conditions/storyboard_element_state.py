"""StoryboardElementStateCondition: what became of another element."""

from __future__ import annotations

from xosc_lateral.playback.conditions.base import ValueCheck, ValueChecks
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.storyboard import ElementState, ElementTransition, StoryboardElement
from xosc_lateral.scenario.conditions import StoryboardElementStateCondition
from xosc_lateral.scenario.enums import StoryboardElementState

_STATES = {
    StoryboardElementState.STANDBY: ElementState.STANDBY,
    StoryboardElementState.RUNNING: ElementState.RUNNING,
    StoryboardElementState.COMPLETE: ElementState.COMPLETE,
}
_TRANSITIONS = {
    StoryboardElementState.START_TRANSITION: ElementTransition.START,
    StoryboardElementState.END_TRANSITION: ElementTransition.END,
    StoryboardElementState.STOP_TRANSITION: ElementTransition.STOP,
}


class StateWatch:
    """Changes of one element since the last look.

    Any change since then that matches counts, also one that was passed through; without changes the last state goes on
    to count, but not its transition, which lasts for one look only.
    """

    def __init__(self, content: StoryboardElementStateCondition, simulation: Simulation) -> None:
        self.content = content
        self._simulation = simulation
        self._state = _STATES.get(content.state)
        self._transition = _TRANSITIONS.get(content.state)
        self._changes: list[tuple[ElementState, ElementTransition]] = []
        self._last: ElementState | None = None
        self.found = False

    def find(self, root: StoryboardElement) -> None:
        """Look for the element: the first whose path ends in the reference."""
        reference = self.content.element_ref
        for element in root.walk():
            if (
                element.kind is self.content.element_type
                and len(reference) >= len(element.name)
                and "::".join(element.path).endswith(reference)
            ):
                element.watchers.append(self)
                self.found = True
                return
        kind = self.content.element_type.value
        self._simulation.note(
            f"no {kind} '{reference}' in the storyboard: the condition stays false", self.content.place
        )

    def register(self, state: ElementState, transition: ElementTransition) -> None:
        """The element has changed."""
        self._changes.append((state, transition))

    def forget(self) -> None:
        """Leave changes that nobody has looked at aside."""
        self._changes.clear()

    def __call__(self) -> bool:
        """Whether the element is, or was since the last look, in the wanted state."""
        if not self._changes:
            return self._state is not None and self._last is self._state
        changes, self._changes = self._changes, []
        self._last = changes[-1][0]
        if self._state is not None:
            return any(state is self._state for state, _ in changes)
        return any(transition is self._transition for _, transition in changes)


def prepare(content: StoryboardElementStateCondition, simulation: Simulation) -> ValueCheck:
    """A watch; it finds its element once the storyboard stands."""
    watch = StateWatch(content, simulation)
    simulation.when_built.append(watch.find)
    return watch


CHECKS: ValueChecks = {StoryboardElementStateCondition: prepare}
