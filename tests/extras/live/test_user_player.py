"""The check of a reactive output in a user's own player: what would be told, and the library of esmini itself."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import numpy as np
import pytest

import xosc_lateral as xl
from tests.kit.made.reactive import reactive_scenarios
from xosc_lateral.extras.live.user_player import _otherwise, happens, told_by_player
from xosc_lateral.workflows.conversion.load import play_scenario

REAL = os.environ.get("ESMINI_LIBRARY")
needs_esmini = pytest.mark.skipif(not REAL, reason="ESMINI_LIBRARY names no library of esmini")


@pytest.fixture(scope="module")
def cut_in(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cut_in")
    road, text = next((road, text) for name, road, text in reactive_scenarios() if name == "cut in by ttc")
    (folder / "road.xodr").write_text(road)
    (folder / "scenario.xosc").write_text(text)
    return folder / "scenario.xosc"


def test_lost_late_and_other_lanes_are_told_and_what_is_due_at_the_end_is_not(cut_in: Path) -> None:
    run = play_scenario(cut_in, step=0.05).motion
    (action,) = (one for one in run.actions if one.path != ("Init",) and one.actor == "T")
    name, start = "::".join(action.path), action.start

    def said(now: list[float], lane: int = -2, then: list[float] | None = None) -> list[str]:
        before = {name: [start] if then is None else then}, {"T": -2}
        return list(_otherwise(before, ({name: now}, {"T": lane}), run, {"T"}, 0.05))

    assert said([start + 0.04]) == []
    assert said([]) == ["event 'cut in' of 'T' happens 0 times instead of 1"]
    assert said([start, start + 5.0]) == ["event 'cut in' of 'T' happens 2 times instead of 1"]
    assert said([start + 0.4]) == ["event 'cut in' of 'T' happens 0.40 s later"]
    assert said([start], lane=-1) == ["'T' ends in lane -1 instead of -2"]
    assert said([], then=[run.end_time]) == []


@needs_esmini
def test_esmini_is_content_with_an_output_and_tells_of_a_cut_in_that_was_taken_out(cut_in: Path) -> None:
    assert REAL is not None
    made = xl.convert(cut_in, cut_in.with_name("out.xosc"), ego="Ego", seed=1, player_library=REAL)
    assert not [line for line in made.warnings if "in the player at" in line]
    played = play_scenario(cut_in, step=0.05)
    trigger = b'TimeToCollisionCondition value="'
    never = cut_in.read_bytes().replace(trigger + b"3.00000", trigger + b"0.00001")
    told = list(
        told_by_player(
            Path(REAL),
            cut_in,
            (cut_in, never),
            [("nominal", played.motion)],
            played.network,
            egos=["Ego"],
            moved=["T"],
            allowed=0.0,
        )
    )
    assert any("event 'cut in' of 'T' happens 0 times instead of 1 (run: nominal)" in str(note) for note in told), told
    assert [one.name for one in cut_in.parent.glob(".*")] == []


@needs_esmini
def test_a_player_follows_who_is_driven_from_outside(cut_in: Path, tmp_path: Path) -> None:
    """Ego stands: nobody cuts in before it."""
    assert REAL is not None
    shutil.copytree(cut_in.parent, tmp_path / "there", dirs_exist_ok=True)
    run = play_scenario(cut_in, step=0.05).motion
    ego = next(one for one in run.entities if one.name == "Ego")
    held = np.stack([ego.time, np.full_like(ego.x, ego.x[0]), np.full_like(ego.x, ego.y[0]), 0 * ego.x, 0 * ego.x])
    starts, lanes = happens(tmp_path / "there" / "scenario.xosc", REAL, {"Ego": held}, 20.0)
    assert not [path for path in starts if "cut in" in path]
    assert lanes["T"] == -1
