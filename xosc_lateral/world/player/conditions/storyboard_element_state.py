"""StoryboardElementStateCondition: what became of another element."""

from __future__ import annotations

from xosc_lateral.world.player.conditions.base import ValueCheck, ValueChecks
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.storyboard import StoryboardElement
from xosc_lateral.world.player.trigger import Watch
from xosc_lateral.world.scenario.conditions import StoryboardElementStateCondition
from xosc_lateral.world.scenario.enums import StoryboardElementState as State


class StateWatch(Watch):
    """Changes of one element since the last look.

    Any change since then that matches counts, also one that was passed through; without changes the last state goes on
    to count, but not its transition, which lasts for one look only.
    """

    def __init__(self, content: StoryboardElementStateCondition, simulation: Simulation) -> None:
        self._content = content
        self._simulation = simulation
        self._changes: list[tuple[State, State | None]] = []
        self._last: State | None = None

    def find(self, root: StoryboardElement) -> None:
        """Look for the element: the first whose path ends in the reference."""
        kind, reference = self._content.element_type, self._content.element_ref
        for element in root.walk():
            if (
                element.kind is kind
                and len(reference) >= len(element.name)
                and "::".join(element.path).endswith(reference)
            ):
                element.watchers.append(self._note)
                return
        what = f"no {kind.value} '{reference}' in the storyboard: the condition stays false"
        self._simulation.note(what, self._content.place)

    def _note(self, state: State, transition: State | None) -> None:
        self._changes.append((state, transition))
        self.is_settled = False
        if self.wake is not None:
            self.wake()

    def forget(self) -> None:
        """Leave changes that nobody has looked at aside."""
        self._changes.clear()

    def __call__(self) -> bool:
        """Whether the element is, or was since the last look, in the wanted state."""
        wanted = self._content.state
        self.is_settled = not self._changes
        if not self._changes:
            return self._last is wanted
        changes, self._changes = self._changes, []
        self._last = changes[-1][0]
        return any(wanted in change for change in changes)


def prepare(content: StoryboardElementStateCondition, simulation: Simulation) -> ValueCheck:
    """A watch; it finds its element once the storyboard stands."""
    watch = StateWatch(content, simulation)
    simulation.when_built.append(watch.find)
    return watch


CHECKS: ValueChecks = {StoryboardElementStateCondition: prepare}
