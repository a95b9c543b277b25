"""The storyboard as a tree of state machines: stories, acts, maneuver groups, maneuvers, events, actions.

An element with a start trigger waits in standby; one without runs as soon as its parent does. An element ends when its
children have all ended; events and maneuver groups then start again as often as they may. (ASAM OpenSCENARIO XML 1.3,
7.3 and 7.5.) The storyboard itself only ever stops by its stop trigger.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, TypeAlias

from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.scenario.enums import ConditionEdge, Priority, StoryboardElementType
from xosc_lateral.world.scenario.enums import StoryboardElementState as State

_RUNNING, _STANDBY = State.RUNNING, State.STANDBY  # looked at in every frame, and an enum's members are slow to find

Watcher = Callable[[State, State | None], None]
"""Told of a change: the state, and the transition that led to it (none to standby)."""


def last_name(reference: str) -> str:
    """What a reference to an element, or the element's name, ends with."""
    return reference.rpartition("::")[2]


@dataclass(eq=False)
class StoryboardElement:
    """One element of the tree."""

    name: str
    kind: StoryboardElementType | None  # none for the storyboard
    children: Sequence[StoryboardElement] = ()
    start_trigger: RunningTrigger | None = None
    stop_trigger: RunningTrigger | None = None
    maximum_count: int | None = None  # of runs; None: once, and never again by itself
    state: State | None = field(default=None, init=False)
    """None: its parent has not started it."""
    count: int = field(default=0, init=False)
    parent: StoryboardElement | None = field(default=None, init=False, repr=False)
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
    @property
    def path(self) -> tuple[str, ...]:
        """Names from the story down."""
        above = () if self.parent is None else self.parent.path
        return above if self.kind is None else (*above, self.name)

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
        siblings = () if self.parent is None else self.parent.children
        running = [event for event in siblings if event is not self and event.is_running]
        if self.priority is Priority.SKIP:
            return not running
        for event in running if self.priority is Priority.OVERRIDE else ():
            event.end()
        return True


# ---- triggers: groups (or) of conditions (and), with edges and delays ----
# As the standard has it, where it is silent as the reference player: a group is evaluated from left to right and
# stops at the first false condition, except that conditions with a delay are always evaluated; the first evaluation
# after a trigger was armed never gives an edge; a delayed condition looks at the history of its (edge-filtered)
# values.
Check = Callable[[], bool]
"""Whether a condition holds, now."""

EntityCheck = Callable[[EntityState], bool]
"""Whether it holds for one triggering entity, now."""

Checks: TypeAlias = dict[type, Callable[[Any, Simulation], Check]]
EntityChecks: TypeAlias = dict[type, Callable[[Any, Simulation], EntityCheck]]
"""What a file says -> a function that makes the check of it."""


class Watch:
    """What is told of changes; a check that goes by it gives the same until then."""

    wake: Callable[[], None] | None = None  # tells the trigger that looks at it
    is_settled = False  # the next look gives what the last one gave

    def forget(self) -> None:
        """Before the owner waits again: what happened until then no longer counts."""


@dataclass(slots=True, eq=False)
class RunningCondition:
    """One condition: the bare `check` at the present moment, edge-filtered and delayed [s]."""

    check: Check
    edge: ConditionEdge
    delay: float
    watch: Watch | None = field(init=False)
    """The check itself, if it is told of changes."""
    _last: bool = False
    _armed: bool = False
    _history: list[tuple[float, bool]] = field(default_factory=list)
    _read: int = 0
    _time: float = -inf
    _value: bool = False

    def __post_init__(self) -> None:
        self.watch = self.check if isinstance(self.check, Watch) else None

    def evaluate(self, time: float) -> bool:
        """Value at `time` [s]. At the same time again, as at time 0, the new value replaces the old one."""
        now = self.check()
        if self.delay <= 0.0 and self.edge is ConditionEdge.NONE:
            self._last, self._armed = now, True
            return now
        filtered = self._filter(now)
        self._last = now
        self._armed = True
        if self.delay > 0.0 and (filtered is not self._value or not self._history):
            if self._history and time < self._time + EPSILON:
                self._history.pop()
            self._history.append((time, filtered))
        self._time, self._value = time, filtered
        return self._value if self.delay <= 0.0 else self._delayed(time - self.delay)

    @property
    def is_watched(self) -> bool:
        """Whether its value changes only a while after a word of its watch."""
        return self.watch is not None and self.edge is ConditionEdge.NONE

    def settled_value(self) -> bool | None:
        """What it gives until something changes; None: that may be something else in the next frame."""
        if self.watch is None or not self.watch.is_settled or self._read < len(self._history) or not self.is_watched:
            return None
        return self._history[-1][1] if self._history else self._last

    def rearm(self) -> None:
        """After the trigger fired: the next evaluation gives no edge."""
        self._armed = False

    def reset(self) -> None:
        """Before the owner waits for its trigger again: earlier values no longer count."""
        self._history.clear()
        self._read = 0
        self._time = -inf
        if self.watch is not None:
            self.watch.forget()

    def _filter(self, now: bool) -> bool:
        edge = self.edge
        if edge is ConditionEdge.NONE:
            return now
        if not self._armed:
            return False
        if edge is ConditionEdge.RISING:
            return now and not self._last
        return self._last and not now if edge is ConditionEdge.FALLING else now is not self._last

    def _delayed(self, time: float) -> bool:
        """Value at an earlier time; a true one that came and went since the last look counts, too."""
        history, before = self._history, self._read
        while self._read < len(history) and time > history[self._read][0] - EPSILON:
            self._read += 1
        changes = history[max(before - (self._read == before), 0) : self._read]
        return any(value for _, value in changes)


@dataclass(slots=True, eq=False)
class RunningTrigger:
    """A trigger. `when_empty`: value of a trigger without groups: true for start, false for stop triggers."""

    groups: tuple[tuple[RunningCondition, ...], ...]
    when_empty: bool = field(kw_only=True)
    rests: bool = field(default=False, init=False)
    """It can't fire before one of its conditions is told of a change."""
    _may_rest: bool = field(default=False, init=False)

    def __post_init__(self) -> None:
        """Be woken by what its conditions watch."""
        for condition in (condition for group in self.groups for condition in group):
            if condition.watch is not None:
                condition.watch.wake = self._wake
        self._may_rest = bool(self.groups) and all(
            bool(group) and group[0].is_watched and all(one.is_watched for one in group if one.delay > 0.0)
            for group in self.groups
        )

    def evaluate(self, time: float) -> bool:
        """Whether it fires at `time`. [s]"""
        if self.rests:
            return False
        if not self.groups:
            return self.when_empty
        fired = False
        for group in self.groups:
            value = bool(group)
            for condition in group:
                if value or condition.delay > 0.0:
                    value = condition.evaluate(time) and value
            fired = fired or value
        if fired:
            for group in self.groups:
                for condition in group:
                    condition.rearm()
        self.rests = self._may_rest and not fired and all(map(_stays_false, self.groups))
        return fired

    def _wake(self) -> None:
        self.rests = False

    def reset(self) -> None:
        """Forget earlier values."""
        self.rests = False
        for group in self.groups:
            for condition in group:
                condition.reset()


def _stays_false(group: tuple[RunningCondition, ...]) -> bool:
    """Whether a group can't hold before something changes; what comes after a false condition is not looked at."""
    holds = True
    for condition in group:
        value = condition.settled_value()
        if value is None and (holds or condition.delay > 0.0):
            return False
        holds = holds and value is True
    return not holds
