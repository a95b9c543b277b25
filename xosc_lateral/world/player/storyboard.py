"""The storyboard as a tree of state machines: stories, acts, maneuver groups, maneuvers, events, actions.

An element with a start trigger waits in standby; one without runs as soon as its parent does. An element ends when its
children have all ended; events and maneuver groups then start again as often as they may. (ASAM OpenSCENARIO XML 1.3,
7.3 and 7.5.) The storyboard itself only ever stops by its stop trigger.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from xosc_lateral.world.player.trigger import RunningTrigger
from xosc_lateral.world.scenario.enums import Priority, StoryboardElementType
from xosc_lateral.world.scenario.enums import StoryboardElementState as State

_RUNNING, _STANDBY = State.RUNNING, State.STANDBY  # looked at in every frame, and an enum's members are slow to find

Watcher = Callable[[State, State | None], None]
"""Told of a change: the state, and the transition that led to it (none to standby)."""


@dataclass(eq=False)
class StoryboardElement:
    """One element of the tree.

    `kind`: none for the storyboard; `maximum_count`: how often it may run; None for elements that run once and cannot
    be run again by themselves.
    """

    name: str
    kind: StoryboardElementType | None
    children: Sequence[StoryboardElement] = ()
    start_trigger: RunningTrigger | None = None
    stop_trigger: RunningTrigger | None = None
    maximum_count: int | None = None
    state: State | None = field(default=None, init=False)
    """None: its parent has not started it."""
    count: int = field(default=0, init=False)
    parent: StoryboardElement | None = field(default=None, init=False, repr=False)
    path: tuple[str, ...] = field(default=(), init=False)
    watchers: list[Watcher] = field(default_factory=list, init=False)

    def __post_init__(self) -> None:
        """Join the children."""
        for child in self.children:
            child.parent = self

    @property
    def is_running(self) -> bool:
        """Whether it runs now."""
        return self.state is _RUNNING

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
        """Go to standby (with a start trigger) or on to running, with all children."""
        if self.state is None and self.start_trigger is not None:
            self.change(State.STANDBY, None)
            return
        self.count += 1
        self.change(State.RUNNING, State.START_TRANSITION)
        self.start_children()

    def start_children(self) -> None:
        """Start what runs as soon as this element does."""
        for child in self.children:
            child.start()

    def make_room(self) -> bool:
        """Before it starts to run: end what is in its way; False if it may not start."""
        return True

    def evaluate_triggers(self, time: float) -> None:
        """One pass over the triggers of this element and, when it runs, of its children."""
        if self.state is _RUNNING and self.stop_trigger is not None and self.stop_trigger.evaluate(time):
            self.stop()
        if self.state is _STANDBY and (self.start_trigger is None or self.start_trigger.evaluate(time)):
            self.start()
        if self.state is _RUNNING:
            for child in self.children:
                if child.state is _STANDBY:
                    if child.start_trigger is None or not child.start_trigger.rests:
                        child.evaluate_triggers(time)
                elif child.state is _RUNNING and (child.children or child.stop_trigger):
                    child.evaluate_triggers(time)

    def step(self, time: float, step: float) -> None:
        """Let running actions move their actors for one frame from `time` on. [s]"""
        if self.state is _RUNNING:
            for child in self.children:
                if child.state is _RUNNING:
                    child.step(time, step)

    def end(self) -> None:
        """Come to a regular end, with all that still runs below; perhaps to start again."""
        if self.state is State.COMPLETE:
            return
        for child in self.children:
            if child.is_running:
                child.end()
        if self.state is not None:
            if self.maximum_count is not None and self.count < self.maximum_count:
                self._reset_triggers()
                self.change(State.STANDBY, State.END_TRANSITION)
                for child in self.children:
                    child.reset()
            else:
                self.change(State.COMPLETE, State.END_TRANSITION)
        self._tell_parent()

    def stop(self) -> None:
        """Be cut off, with everything below."""
        for child in self.children:
            child.stop()
        if self.state in (State.STANDBY, State.RUNNING):
            self.change(State.COMPLETE, State.STOP_TRANSITION)
            self._tell_parent()

    def reset(self) -> None:
        """To be started again by the parent; what its conditions saw before no longer counts."""
        for child in self.children:
            child.reset()
        self.state = None
        self.count = 0
        self._reset_triggers()

    def _reset_triggers(self) -> None:
        for trigger in (self.start_trigger, self.stop_trigger):
            if trigger is not None:
                trigger.reset()

    def change(self, state: State, transition: State | None) -> None:
        """Change the state and tell conditions that watch it."""
        if state is self.state:
            return
        self.state = state
        for watcher in self.watchers:
            watcher(state, transition)

    def _tell_parent(self) -> None:
        """The parent ends when its last child has."""
        parent = self.parent
        if parent is None or parent.kind is None or parent.state is State.COMPLETE:
            return
        if all(child.state is State.COMPLETE for child in reversed(parent.children)):  # the last one mostly is not
            parent.end()


@dataclass(eq=False, kw_only=True)
class EventElement(StoryboardElement):
    """An event: priorities among its siblings, and conflicts of its actions with others of the same actor."""

    priority: Priority

    def start(self) -> None:
        """As any element, but the priority decides what happens to events beside it, or to itself."""
        if self.state is State.STANDBY and not self.make_room():
            return
        super().start()
        if self.is_running and not self.children:
            self.end()

    def start_children(self) -> None:
        """Start the actions one after another; each ends running ones of its actor that it conflicts with."""
        for action in self.children:
            action.make_room()
            action.start()

    def make_room(self) -> bool:
        """By the priority among the events of the maneuver."""
        if self.priority not in (Priority.SKIP, Priority.OVERRIDE):
            return True
        siblings = () if self.parent is None else self.parent.children
        running = [event for event in siblings if event is not self and event.is_running]
        if self.priority is Priority.SKIP:
            return not running
        if self.priority is Priority.OVERRIDE:
            for event in running:
                event.end()
        return True
