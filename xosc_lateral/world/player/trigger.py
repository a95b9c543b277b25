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


@dataclass(slots=True, eq=False)
class RunningCondition:
    """One condition: its present value, edge-filtered and delayed.

    `check`: the bare condition, at the present moment; `delay`: [s]; `forget`: makes the bare condition forget what
    happened before its owner waits again.
    """

    check: Check
    edge: ConditionEdge
    delay: float
    forget: Callable[[], None] | None = None
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

    def rearm(self) -> None:
        """After the trigger fired: the next evaluation gives no edge."""
        self._armed = False

    def reset(self) -> None:
        """Before the owner waits for its trigger again: earlier values no longer count."""
        self._history.clear()
        self._read = 0
        self._time = -inf
        if self.forget is not None:
            self.forget()

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

    def evaluate(self, time: float) -> bool:
        """Whether it fires at `time`. [s]"""
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
        return fired

    def reset(self) -> None:
        """Forget earlier values."""
        for group in self.groups:
            for condition in group:
                condition.reset()
