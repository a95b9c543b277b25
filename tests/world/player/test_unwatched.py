"""Entities that are played ahead have the same rows, to the bit, as those that move frame by frame."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import xosc_lateral as xl
from laboratory.many_cars import write
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.player import simulation
from xosc_lateral.world.player.simulation import Unwatched

COLUMNS = ("x", "y", "z", "heading", "speed", "road", "lane", "s", "offset", "heading_relative", "activity")


def the_same(path: Path, monkeypatch: pytest.MonkeyPatch, *, end: float) -> NominalMotion:
    """Play it both ways; somebody has to be played ahead."""
    ahead: list[int] = []
    rest = Unwatched.rest

    def counted(self: Unwatched, step: float) -> None:
        rest(self, step)
        ahead.append(len(self._ahead))

    monkeypatch.setattr(Unwatched, "rest", counted)
    motion = play_scenario(path, time_limit=end).motion
    assert max(ahead) > 0
    monkeypatch.setattr(simulation, "_follows_its_lane", lambda state: False)
    for one, other in zip(motion.entities, play_scenario(path, time_limit=end).motion.entities, strict=True):
        for name in COLUMNS:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=f"{one.name} {name}")
    return motion


def test_through_bends_and_lane_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    motion = the_same(write(tmp_path / "many", 12, 40.0), monkeypatch, end=40.0)
    assert any(len(set(entity.lane.tolist())) > 1 for entity in motion.entities)


@pytest.mark.parametrize("name", ["cut-in", "dense-traffic", "curves"])
@pytest.mark.parametrize("traffic", ["right", "left"])
def test_beside_triggers_that_look_at_others(
    name: str, traffic: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    the_same(Path(xl.write_template(name, tmp_path, traffic=traffic)[0]), monkeypatch, end=30.0)


def test_backwards_standing_and_across_the_seams_of_roads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source = write(tmp_path / "three", 3, 20.0, speeds=(-8.0, 0.0, 30.0))
    motion = the_same(source, monkeypatch, end=20.0)
    assert [np.sign(entity.speed[0]) for entity in motion.entities] == [-1.0, 0.0, 1.0]
