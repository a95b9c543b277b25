"""The storyboard as a tree of state machines: stories, acts, maneuver groups, maneuvers, events, actions.

An element with a start trigger waits in standby; one without runs as soon as its parent does. An element ends when its
children have all ended; events and maneuver groups then start again as often as they may. (ASAM OpenSCENARIO XML 1.3,
7.3 and 7.5.) The storyboard itself only ever stops by its stop trigger.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import Enum
from typing import Protocol

from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.trigger import RunningTrigger
from xosc_lateral.scenario import Action
from xosc_lateral.scenario.enums import Priority, StoryboardElementType


class ElementState(Enum):
    """Where an element is in its life."""

    INIT = "init"
    STANDBY = "standby"
    RUNNING = "running"
    COMPLETE = "complete"


class ElementTransition(Enum):
    """How it came there."""

    NONE = "none"
    TO_STANDBY = "to standby"
    START = "start"
    END = "end"
    STOP = "stop"


class Watcher(Protocol):
    """Whoever wants to know of an element's changes."""

    def register(self, state: ElementState, transition: ElementTransition) -> None:
        """The element has changed."""


class Behaviour(Protocol):
    """What an action does while it runs (see `actions.base.RunningAction`)."""

    element: ActionElement
    source: Action
    actor: EntityState | None

    @property
    def domains(self) -> int:
        """What it needs to have for itself, as a bit set."""

    def start(self) -> None:
        """Begin."""

    def step(self, time: float, step: float) -> None:
        """Act for one frame. [s]"""

    def finish(self) -> None:
        """Clean up."""


class StoryboardElement:
    """One element of the tree.

    `kind`: none for the storyboard; `maximum_count`: how often it may run; None for elements that run once and cannot
    be run again by themselves.
    """

    __slots__ = (
        "children",
        "count",
        "kind",
        "maximum_count",
        "name",
        "parent",
        "path",
        "start_trigger",
        "state",
        "stop_trigger",
        "watchers",
    )

    def __init__(
        self,
        name: str,
        kind: StoryboardElementType | None,
        children: Sequence[StoryboardElement] = (),
        *,
        start_trigger: RunningTrigger | None = None,
        stop_trigger: RunningTrigger | None = None,
        maximum_count: int | None = None,
    ) -> None:
        self.name = name
        self.kind = kind
        self.children = tuple(children)
        self.start_trigger = start_trigger
        self.stop_trigger = stop_trigger
        self.maximum_count = maximum_count
        self.state = ElementState.INIT
        self.count = 0
        self.parent: StoryboardElement | None = None
        self.path: tuple[str, ...] = ()
        self.watchers: list[Watcher] = []
        for child in self.children:
            child.parent = self

    # ---- the tree ----------------------------------------------------------------------------------------------------
    def settle(self, path: tuple[str, ...] = ()) -> None:
        """Tell the whole tree its paths (names from the story down)."""
        self.path = (*path, self.name) if self.kind is not None else ()
        for child in self.children:
            child.settle(self.path)

    def walk(self) -> Iterator[StoryboardElement]:
        """This element and all under it, parents first."""
        yield self
        for child in self.children:
            yield from child.walk()

    # ---- life --------------------------------------------------------------------------------------------------------
    def start(self) -> None:
        """Go from init to standby (with a start trigger) or on to running, with all children."""
        if self.state is ElementState.INIT and self.start_trigger is not None:
            self.change(ElementState.STANDBY, ElementTransition.TO_STANDBY)
            return
        self.count += 1
        self.change(ElementState.RUNNING, ElementTransition.START)
        self.start_children()

    def start_children(self) -> None:
        """Start what runs as soon as this element does."""
        for child in self.children:
            child.start()

    def evaluate_triggers(self, time: float) -> None:
        """One pass over the triggers of this element and, when it runs, of its children."""
        if self.state is ElementState.RUNNING and self.stop_trigger is not None and self.stop_trigger.evaluate(time):
            self.stop()
        if self.state is ElementState.STANDBY and (self.start_trigger is None or self.start_trigger.evaluate(time)):
            self.start()
        if self.state is ElementState.RUNNING:
            for child in self.children:
                child.evaluate_triggers(time)

    def step(self, time: float, step: float) -> None:
        """Let running actions move their actors."""
        if self.state is ElementState.RUNNING:
            for child in self.children:
                child.step(time, step)

    def end(self) -> None:
        """Come to a regular end, with all that still runs below; perhaps to start again."""
        if self.state is ElementState.COMPLETE:
            return
        for child in self.children:
            if child.state is ElementState.RUNNING:
                child.end()
        if self.state in (ElementState.RUNNING, ElementState.STANDBY):
            if self.maximum_count is not None and self.count < self.maximum_count:
                self._reset_triggers()
                self.change(ElementState.STANDBY, ElementTransition.END)
                for child in self.children:
                    child.reset()
            else:
                self.change(ElementState.COMPLETE, ElementTransition.END)
        self.tell_parent()

    def stop(self) -> None:
        """Be cut off, with everything below."""
        for child in self.children:
            child.stop()
        if self.state in (ElementState.STANDBY, ElementState.RUNNING):
            self.change(ElementState.COMPLETE, ElementTransition.STOP)
            self.tell_parent()

    def reset(self) -> None:
        """Back to init, to be started again by the parent; what its conditions saw before no longer counts."""
        for child in self.children:
            child.reset()
        self.state = ElementState.INIT
        self.count = 0
        self._reset_triggers()

    def _reset_triggers(self) -> None:
        for trigger in (self.start_trigger, self.stop_trigger):
            if trigger is not None:
                trigger.reset()

    def change(self, state: ElementState, transition: ElementTransition) -> None:
        """Change the state and tell conditions that watch it."""
        if state is self.state:
            return
        self.state = state
        for watcher in self.watchers:
            watcher.register(state, transition)

    def tell_parent(self) -> None:
        """The parent ends when its last child has."""
        parent = self.parent
        if parent is None or parent.kind is None or parent.state is ElementState.COMPLETE:
            return
        if all(child.state is ElementState.COMPLETE for child in parent.children):
            parent.end()


class EventElement(StoryboardElement):
    """An event: priorities among its siblings, and conflicts of its actions with others of the same actor."""

    __slots__ = ("priority",)

    def __init__(
        self,
        name: str,
        actions: Sequence[ActionElement],
        *,
        priority: Priority,
        start_trigger: RunningTrigger,
        maximum_count: int,
    ) -> None:
        super().__init__(
            name, StoryboardElementType.EVENT, actions, start_trigger=start_trigger, maximum_count=maximum_count
        )
        self.priority = priority

    def start(self) -> None:
        """As any element, but the priority decides what happens to events beside it, or to itself."""
        if self.state is ElementState.STANDBY and not self._make_room():
            return
        super().start()
        if self.state is ElementState.RUNNING and not self.children:
            self.end()

    def start_children(self) -> None:
        """Start the actions one after another; each ends running ones of its actor that it conflicts with."""
        for action in self.children:
            assert isinstance(action, ActionElement)
            action.end_conflicting()
            action.start()

    def _make_room(self) -> bool:
        siblings = () if self.parent is None else self.parent.children
        running = [event for event in siblings if event is not self and event.state is ElementState.RUNNING]
        if self.priority is Priority.SKIP:
            return not running
        if self.priority is Priority.OVERRIDE:
            for event in running:
                event.end()
        return True


class ActionElement(StoryboardElement):
    """An action as a leaf of the tree; what it does is in its `Behaviour`."""

    __slots__ = ("_number", "action", "simulation")

    def __init__(self, name: str, action: Behaviour, simulation: Simulation) -> None:
        super().__init__(name, StoryboardElementType.ACTION)
        self.action = action
        self.simulation = simulation
        self._number: int | None = None
        action.element = self

    def start(self) -> None:
        """Start to act."""
        actor = None if self.action.actor is None else self.action.actor.name
        if self.action.actor is not None:
            self.simulation.wake(self.action.actor)
        self._number = self.simulation.record_start(self.action.source, actor, self.path or ("Init",))
        self.count += 1
        self.change(ElementState.RUNNING, ElementTransition.START)
        self.action.start()

    @property
    def is_running(self) -> bool:
        """Whether it acts now."""
        return self.state is ElementState.RUNNING

    def step(self, time: float, step: float) -> None:
        """Act for one frame."""
        if self.state is ElementState.RUNNING:
            self.action.step(time, step)

    def change(self, state: ElementState, transition: ElementTransition) -> None:
        """As any element; the end is written down."""
        if state is ElementState.COMPLETE and self.state is ElementState.RUNNING and self._number is not None:
            self.simulation.record_end(self._number)
            self.action.finish()
        super().change(state, transition)

    def end_conflicting(self) -> None:
        """End what the actor does in a domain that this action needs."""
        actor, domains = self.action.actor, self.action.domains
        if actor is None or not domains:
            return
        for other in (*actor.init_actions, *actor.event_actions):
            assert isinstance(other, ActionElement)
            if other is not self and other.state is ElementState.RUNNING and other.action.domains & domains:
                other.end()


def storyboard_root(stories: Sequence[StoryboardElement], stop_trigger: RunningTrigger | None) -> StoryboardElement:
    """The storyboard element above the stories."""
    root = StoryboardElement("", None, stories, stop_trigger=stop_trigger)
    root.settle()
    return root
