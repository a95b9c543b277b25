"""One more action and one more condition, by what CONTRIBUTING's recipe names and nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from tests.kit.stage import Stage, by_entity, entity, event, maneuvers, private_action, row, start_of, when
from xosc_lateral.files.openscenario import storyboard as readers
from xosc_lateral.files.openscenario.context import Context
from xosc_lateral.files.openscenario.element import XmlElement
from xosc_lateral.world.player import storyboard_builder
from xosc_lateral.world.player.actions.base import Domain, RunningPrivateAction
from xosc_lateral.world.player.simulation import Simulation
from xosc_lateral.world.player.storyboard import EntityCheck
from xosc_lateral.world.scenario.place import Place


# ---- what a file says: scenario/ -------------------------------------------------------------------------------------
@dataclass(frozen=True, slots=True)
class HurryAction:
    """Faster by so much in every second, for some seconds. [m/s2], [s]"""

    acceleration: float
    duration: float
    place: Place


@dataclass(frozen=True, slots=True)
class BeyondCondition:
    """Further along the road than that. [m]"""

    s: float
    place: Place


# ---- how it is read: files/openscenario/ -----------------------------------------------------------------------------
def read_hurry(e: XmlElement, context: Context) -> Any:
    return HurryAction(e.number("acceleration"), e.number("duration"), e.place())


def read_beyond(e: XmlElement, context: Context) -> Any:
    return BeyondCondition(e.number("s"), e.place())


# ---- what is done: world/player/ -------------------------------------------------------------------------------------
class RunningHurry(RunningPrivateAction):
    domains = Domain.LONGITUDINAL
    content: HurryAction

    def _begin(self) -> None:
        self._left = self.content.duration

    def _act(self, time: float, step: float) -> None:
        step = min(step, self._left)
        self.actor.set_speed(self.actor.speed + self.content.acceleration * step)
        self._left -= step
        if self._left <= 1e-9:
            self.end()


def prepare_beyond(content: BeyondCondition, simulation: Simulation) -> EntityCheck:
    return lambda state: state.s > content.s


@pytest.fixture
def _known(monkeypatch: pytest.MonkeyPatch) -> None:
    """A line in the reader's table, and one in the table of the module that plays it."""
    monkeypatch.setitem(readers.PRIVATE_ACTIONS, "HurryAction", read_hurry)
    monkeypatch.setitem(storyboard_builder.RUNNING, HurryAction, RunningHurry)
    monkeypatch.setitem(readers.ENTITY_CONDITIONS, "BeyondCondition", read_beyond)
    monkeypatch.setitem(storyboard_builder.ENTITY_CHECKS, BeyondCondition, prepare_beyond)


HURRY = private_action('<HurryAction acceleration="2" duration="3"/>')


@pytest.mark.usefixtures("_known")
def test_another_action_is_played(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(HURRY, name="hurry")))
    ego = entity(played)
    begin = start_of(played, "hurry-0")
    assert ego.speed[row(ego, begin + 1.5)] == pytest.approx(23.0, abs=0.1)
    assert ego.speed[-1] == pytest.approx(26.0)


@pytest.mark.usefixtures("_known")
def test_another_condition_is_waited_for(tmp_path: Path) -> None:
    trigger = when(by_entity('<BeyondCondition s="50"/>'))
    played = Stage(tmp_path).play(maneuvers(event(HURRY, name="hurry", trigger=trigger)))
    assert start_of(played, "hurry-0") == pytest.approx((50.0 - 10.0) / 20.0, abs=0.05)


def test_what_nobody_knows_is_named_with_its_line(tmp_path: Path) -> None:
    played = Stage(tmp_path).play(maneuvers(event(HURRY, name="hurry")))
    assert any("HurryAction" in str(note) for note in played.motion.notes)
    assert entity(played).speed[-1] == pytest.approx(20.0)
