"""The check of a reactive output in a user's own player: what would be told, and the library of esmini itself."""

from __future__ import annotations

import os
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

import xosc_lateral as xl
from tests.kit.made.reactive import reactive_scenarios
from xosc_lateral.extras.live.esmini_library import OBJECT_STATE
from xosc_lateral.extras.live.user_player import COMPLETE, RUNNING, Happened, as_motion, happens, told_by_player
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.workflows.conversion.shifts import compare_runs
from xosc_lateral.world.motion.look import look_at
from xosc_lateral.world.motion.nominal import NominalMotion
from xosc_lateral.world.road.network import RoadNetwork

REAL = os.environ.get("ESMINI_LIBRARY")
needs_esmini = pytest.mark.skipif(not REAL, reason="ESMINI_LIBRARY names no library of esmini")


@pytest.fixture(scope="module")
def cut_in(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cut_in")
    road, text = next((road, text) for name, road, text in reactive_scenarios() if name == "cut in by ttc")
    (folder / "road.xodr").write_text(road)
    (folder / "scenario.xosc").write_text(text)
    return folder / "scenario.xosc"


def happened(run: NominalMotion, network: RoadNetwork) -> Happened:
    """What a player would say that plays as ours does, along a road that is driven along its s."""
    states = np.zeros((len(run.entities), len(run.entities[0].time)), dtype=OBJECT_STATE)
    for row, one in zip(states, run.entities, strict=True):
        for name, ours in (("x", "x"), ("y", "y"), ("h", "heading"), ("speed", "speed"), ("s", "s"), ("lane", "lane")):
            row[name] = one.columns[ours]
        row["offset_t"], row["road"] = one.offset, [int(network.road_ids[road]) for road in one.road]
    names = [one.name for one in run.entities]
    frames = [dict(zip(names, frame.copy(), strict=True)) for frame in states.T]
    changes = [
        ("::".join(one.path), state, at)
        for one in run.actions
        for state, at in ((RUNNING, one.start), (COMPLETE, one.end))
        if at is not None
    ]
    return run.entities[0].time.tolist(), frames, changes


def test_what_a_player_does_is_told_by_the_look_and_the_comparison_of_the_check(cut_in: Path) -> None:
    played = play_scenario(cut_in, step=0.01)
    run, network = played.motion, played.network
    (action,) = (one for one in run.actions if one.path != ("Init",) and one.actor == "T")
    name, start = "::".join(action.path), action.start

    def said(times: list[float], lane: int | None = None, aside: float = 0.0) -> list[str]:
        time, frames, changes = happened(run, network)
        changes = [one for one in changes if one[0] != name] + [(name, RUNNING, at) for at in times]
        changes += [(name, COMPLETE, action.end + times[0] - start) for _ in times[:1]]
        for at, states in zip(time, frames, strict=True):
            if lane is not None and at > run.end_time - 1.0:
                states["T"]["lane"], states["T"]["offset_t"] = lane, 0.0
            states["T"]["y"] += aside if at > 5.0 else 0.0
        both = happened(run, network), (time, frames, changes)
        before, after = (as_motion(one, run, network, {"T"}) for one in both)
        compared = compare_runs(played.scenario, network, before, after, ignored={"Ego"}, ends=False)
        found = look_at(network, before, after, {"T"}, shifted=compared.first)
        return [str(one.note) for one in compared.changes] + [str(one.note(None)) for one in found]

    event = f"event 'cut in' of 'T' at {start:.2f} s"
    assert said([start]) == []
    assert said([start + 0.04]) == []
    assert said([]) == [f"{event} no longer happens with the offsets"]
    again = f"event 'cut in' of 'T' at {start + 5.0:.2f} s"
    assert said([start, start + 5.0]) == [f"{again} happens once more with the offsets"]
    assert said([start + 0.4])[0] == f"{event} happens 0.40 s later with the offsets"
    assert any("the last lane of 'T', -2, is -1" in line for line in said([start], lane=-1))
    (corner,) = said([start], aside=0.05)
    assert "'T' is driven round a corner" in corner and re.search(r"at (4\.9|5\.[01]) s", corner)


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
            played.scenario,
            (cut_in, never),
            [("nominal", played.motion)],
            played.network,
            egos=["Ego"],
            moved=["T"],
        )
    )
    assert any("event 'cut in' of 'T'" in note.what and "no longer happens" in note.what for note in told), told
    assert {note.run for note in told} == {"nominal"}
    assert [one.name for one in cut_in.parent.glob(".*")] == []


@needs_esmini
def test_a_player_follows_who_is_driven_from_outside(cut_in: Path, tmp_path: Path) -> None:
    """Ego stands: nobody cuts in before it."""
    assert REAL is not None
    shutil.copytree(cut_in.parent, tmp_path / "there", dirs_exist_ok=True)
    run = play_scenario(cut_in, step=0.05).motion
    ego = next(one for one in run.entities if one.name == "Ego")
    held = np.stack([ego.time, np.full_like(ego.x, ego.x[0]), np.full_like(ego.x, ego.y[0]), 0 * ego.x, 0 * ego.x])
    _, frames, changes = happens(tmp_path / "there" / "scenario.xosc", REAL, {"Ego": held}, 20.0)
    assert not [path for path, state, _ in changes if "cut in" in path and state == RUNNING]
    assert frames[-1]["T"]["lane"] == -1
