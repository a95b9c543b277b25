"""Triggers while playing: groups (or) of conditions (and), with edges and delays.

As the standard has it, where it is silent as the reference player: a group is evaluated from left to right and stops
at the first false condition, except that conditions with a delay are always evaluated; the first evaluation after a
trigger was armed never gives an edge; a delayed condition looks at the history of its (edge-filtered) values.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from math import inf

from xosc_lateral.world.player.transition import EPSILON
from xosc_lateral.world.scenario.enums import ConditionEdge

Check = Callable[[], bool]


class Watch:
    """What is told of changes; a check that goes by it gives the same until then.

    `wake`: tells the trigger that looks at it; `is_settled`: the next look gives what the last one gave.
    """

    wake: Callable[[], None] | None = None
    is_settled = False

    def forget(self) -> None:
        """Before the owner waits again: what happened until then no longer counts."""


@dataclass(slots=True, eq=False)
class RunningCondition:
    """One condition: its present value, edge-filtered and delayed.

    `check`: the bare condition, at the present moment; `delay`: [s]; `watch`: what tells the bare condition of changes.
    """

    check: Check
    edge: ConditionEdge
    delay: float
    watch: Watch | None = None
    _last: bool = False
    _armed: bool = False
    _history: list[tuple[float, bool]] = field(default_factory=list)
    _read: int = 0
    _time: float = -inf
    _value: bool = False

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
        if edge is ConditionEdge.FALLING:
            return self._last and not now
        return now is not self._last

    def _delayed(self, time: float) -> bool:
        """Value at an earlier time; a true one that came and went since the last look counts, too."""
        history, before = self._history, self._read
        while self._read < len(history) and time > history[self._read][0] - EPSILON:
            self._read += 1
        changes = history[max(before - (self._read == before), 0) : self._read]
        return any(value for _, value in changes)


@dataclass(slots=True, eq=False)
class RunningTrigger:
    """A trigger.

    `when_empty`: value of a trigger without groups: true for start, false for stop triggers.
    """

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
