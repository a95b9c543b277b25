"""What an action is while playing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from enum import IntFlag
from functools import partial
from typing import Any, TypeAlias

from xosc_lateral.world.motion.nominal import Activity, PlayedAction
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.state import EntityState
from xosc_lateral.world.player.storyboard import StoryboardElement
from xosc_lateral.world.scenario.enums import StoryboardElementState as State
from xosc_lateral.world.scenario.enums import StoryboardElementType
from xosc_lateral.world.scenario.scenario import Action

JUMP_DISTANCE = 0.05
"""When an action puts the entity further away than this at once, the entity's motion is not continuous. [m]"""


class Domain(IntFlag):
    """What an action needs to have for itself: a newer action of the same actor ends an older one."""

    NONE = 0
    LONGITUDINAL = 1
    LATERAL = 2
    BOTH = 3


class RunningAction(StoryboardElement):
    """One action of one actor (an `EntityState`), or of none: a leaf of the storyboard.

    A kind of action says what it does in `_prepare`, `_begin`, `_act` and `_finish`; one that has done its work calls
    `end`.
    """

    domains: Domain = Domain.NONE

    def __init__(self, source: Action, actor: EntityState | None, simulation: Simulation) -> None:
        super().__init__(source.name, StoryboardElementType.ACTION)
        self.source, self.simulation = source, simulation
        self.actor: Any = actor
        self.content: Any = source.content
        self._number = -1
        """Of its record in the simulation."""
        self._is_refused = False
        self._rank = 0
        """Among those of its actor, as in the file."""
        if actor is not None:
            self._rank = len(actor.actions)
            actor.actions.append(self)
        self._prepare()

    # ---- what a kind of action does ----------------------------------------------------------------------------------
    def _prepare(self) -> None:
        """Look at the content once, before the run: refuse what can't be played, say what the run has to provide."""

    def _begin(self) -> None:
        """When the event starts; nothing of an earlier execution counts."""

    def _act(self, time: float, step: float) -> None:
        """In every frame from then on (the first time in the same one), from `time` on; no length in the first. [s]"""
        self.end()

    def _finish(self) -> None:
        """Clean up, however the action came to its end."""

    # ---- as an element -----------------------------------------------------------------------------------------------
    def start(self) -> None:
        """Start to act, and write it down."""
        if self.actor is not None:
            self.simulation.wake(self.actor)
        actor, path = None if self.actor is None else self.actor.name, self.path if self.parent else ("Init",)
        self._number = len(self.simulation.played)
        self.simulation.played.append(PlayedAction(self.source, actor, path, self.simulation.time, None))
        super().start()
        self._is_refused = False
        self._begin()

    def step(self, time: float, step: float) -> None:
        """Act for one frame. [s]"""
        if not self.is_running:
            return
        if self._is_refused:
            self.end()
        else:
            self._act(time, step)

    def change(self, state: State, transition: State | None) -> None:
        """As any element; the end is written down."""
        if state is State.COMPLETE and self.is_running:
            played = self.simulation.played
            played[self._number] = replace(played[self._number], end=self.simulation.stamp)
            self._finish()
        super().change(state, transition)
        if self.actor is not None:
            (self.actor.running.add if self.is_running else self.actor.running.discard)(self)

    def make_room(self) -> bool:
        """End what the actor does in a domain that this action needs."""
        if self.actor is not None and self.domains:
            for other in sorted(self.actor.running, key=lambda action: action._rank):
                if other.is_running and other is not self and other.domains & self.domains:
                    other.end()
        return True

    def _refuse(self, what: str) -> None:
        """When it begins: say why nothing is done; it ends with its first step."""
        self.note(what)
        self._is_refused = True

    def note(self, what: str) -> None:
        """Say that something was not played, or not as written."""
        self.simulation.note(what, self.content.place, entity=None if self.actor is None else self.actor.name)


class AtOnce(RunningAction):
    """All of it is done when it starts; its end is that of its first step, unless it ends itself."""

    def __init__(self, do: Callable[[Any, AtOnce], None], domains: Domain, *played: Any) -> None:
        super().__init__(*played)
        self.domains = domains
        self._do = do

    def _begin(self) -> None:
        self._do(self.content, self)


Maker: TypeAlias = Callable[[Action, EntityState | None, Simulation], RunningAction]
"""Makes an action ready to run, of what a file says, who acts and where."""


def at_once(do: Callable[[Any, AtOnce], None], domains: Domain = Domain.NONE) -> Maker:
    """An action of which all is done when it starts."""
    return partial(AtOnce, do, domains)


class RunningPrivateAction(RunningAction):
    """One that has an actor."""

    actor: EntityState

    def _referred(self, target: object) -> EntityState | None:
        """The entity that a target is relative to; None: it is absolute."""
        name: str | None = getattr(target, "entity_ref", None)
        return None if name is None else self.simulation.entity(name, self.content.place)

    def _jumped(self, distance: float) -> None:
        """The actor was put so far away at once [m]: up to here and from here on, its path is another one."""
        if abs(distance) > JUMP_DISTANCE:
            self.actor.activity |= Activity.TELEPORTED


class RunningToTarget(RunningPrivateAction):
    """One whose target is absolute, or relative to another entity."""

    def _prepare(self) -> None:
        self._reference = self._referred(self.content.target)
