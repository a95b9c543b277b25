"""What an action is while playing."""

from __future__ import annotations

from enum import IntFlag
from typing import Any

from xosc_lateral.motion.nominal import Activity
from xosc_lateral.playback.simulation import Simulation
from xosc_lateral.playback.state import EntityState
from xosc_lateral.playback.storyboard import ActionElement
from xosc_lateral.scenario import Action

JUMP = 0.05
"""When an action puts the entity further away than this at once, the entity's motion is not continuous. [m]"""


class Domain(IntFlag):
    """What an action needs to have for itself: a newer action of the same actor ends an older one."""

    NONE = 0
    LONGITUDINAL = 1
    LATERAL = 2
    BOTH = 3


class RunningAction:
    """One action of one actor (or of none).

    `start` is called when the event starts, `step` in every frame from then on (the first time in the same frame), with
    the time at its start and its length, 0 in the very first frame. An action that has done its work calls `end`.

    `source`: as read; `actor`: who acts; None for global and user-defined actions.
    """

    domains: Domain = Domain.NONE

    def __init__(self, source: Action, actor: EntityState | None, simulation: Simulation) -> None:
        self.source = source
        self.actor = actor
        self.simulation = simulation
        self.content: Any = source.content
        self.element: ActionElement
        self.prepare()

    @property
    def state(self) -> EntityState:
        """The actor of a private action."""
        assert self.actor is not None, "private actions have an actor"
        return self.actor

    def prepare(self) -> None:
        """Look at the content once, before the run: refuse what can't be played, say what the run has to provide."""

    def start(self) -> None:
        """Begin; state from an earlier execution must be forgotten."""

    def step(self, time: float, step: float) -> None:
        """Act for one frame from `time` on. [s]"""
        self.end()

    def finish(self) -> None:
        """Clean up, however the action came to its end."""

    def end(self) -> None:
        """Come to a regular end."""
        self.element.end()

    def jumped(self, distance: float) -> None:
        """The actor was put so far away at once [m]: up to here and from here on, its path is another one."""
        if abs(distance) > JUMP:
            self.state.activity |= Activity.TELEPORTED

    def note(self, what: str) -> None:
        """Say that something was not played, or not as written."""
        self.simulation.note(what, self.content.place)
