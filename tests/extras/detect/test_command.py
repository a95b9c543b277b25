"""A detector in another program: what it is told, what it may answer, and one clear line where it fails."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import xosc_lateral as xl
from tests.kit.lane_tracks import lane_change, scene, track
from xosc_lateral.base.errors import SimulationError
from xosc_lateral.cli import main
from xosc_lateral.extras.detect.detectors import WanderingZone
from xosc_lateral.extras.detect.observation import PERFECT_SENSOR, Sensor, views_of
from xosc_lateral.extras.detect.other_detectors import Command
from xosc_lateral.extras.detect.scoring import Tally
from xosc_lateral.extras.detect.sources import SourceSettings, sources_of
from xosc_lateral.extras.detect.tracks import STEP

ZONE = """
import json, sys
for line in sys.stdin:
    step = json.loads(line)
    found = {}
    for name, vehicle in step["vehicles"].items():
        side = 1 if vehicle["offset"] > 0 else -1
        if name != step["ego"] and abs(vehicle["offset"]) > 0.375 and side * vehicle["lateral_speed"] > 0:
            found[name] = {"score": 1, "side": "left" if side > 0 else "right"}
    print(json.dumps({"time": step["time"], "vehicles": found}), flush=True)
"""

AWK = r"""{
  time = $0; sub(/^\{"time": /, "", time); sub(/,.*/, "", time)
  if (!match($0, /"CutIn": \{"offset": [-0-9.e]+/)) { printf "{\"vehicles\": {}}\n"; fflush(); next }
  offset = substr($0, RSTART, RLENGTH); sub(/.*: /, "", offset); offset += 0
  side = offset > 0 ? "left" : "right"; size = offset > 0 ? offset : -offset
  printf "{\"time\": %s, \"vehicles\": {\"CutIn\": {\"score\": %d, \"side\": \"%s\"}}}\n", time, (size > 0.3), side
  fflush()
}"""


def python(folder: Path, text: str) -> str:
    program = folder / "mine.py"
    program.write_text(text)
    return f"{sys.executable} {program}"


def made_scene():
    time = 0.1 * np.arange(300)
    return scene(track(0.5 * np.sin(time) + lane_change(time, 15.0, 5.0)), track(0.0 * time, name="B", lane=0, x=30.0))


@pytest.mark.parametrize("sensor", [PERFECT_SENSOR, Sensor(noise=0.05, delay=0.1, rate=10.0)])
def test_a_program_with_the_rule_of_a_built_in_one_scores_the_same(sensor, tmp_path):
    made = made_scene()
    views = views_of(made, sensor, 0)
    tallies = [Tally(detector, "made") for detector in (WanderingZone(), Command(python(tmp_path, ZONE)))]
    for tally in tallies:
        tally.add(made, views)
    built_in, mine = (tally.curve() for tally in tallies)
    for attribute in ("counts", "leads"):
        one, other = (getattr(each, attribute)[:, each.detector.chosen] for each in (built_in, mine))
        np.testing.assert_array_equal(one, other)
    assert built_in.counts[:, built_in.detector.chosen].sum() > 0


def awk(folder: Path) -> str:
    """A program in another language that knows `offset` alone."""
    (folder / "mine.awk").write_text(AWK)
    return f"{'gawk' if shutil.which('gawk') else 'mawk -W interactive'} -f {folder / 'mine.awk'}"


@pytest.mark.skipif(shutil.which("mawk") is None and shutil.which("gawk") is None, reason="no awk that flushes")
def test_a_program_in_another_language_alarms_where_the_states_of_three_sources_say(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    xl.write_template("cut-in", tmp_path)
    xl.convert("cut-in.xosc", "lifelike.xosc", ego="none", seed=2)
    states = xl.play("lifelike.xosc", step=STEP)
    states.write("states.csv")
    frame = states.to_frame()
    mine = frame[frame["name"] == "CutIn"]
    along = np.where(mine["lane"] < 0, 1.0, -1.0)  # right-hand traffic: lanes with negative numbers run along s
    played = dict(zip(mine["time"].round(3), along * mine["offset_t"], strict=True))
    time = STEP * np.arange(1200)
    pd.DataFrame({"drive": "CutIn", "time": time, "offset": 0.5 * np.sin(time), "lane_width": 3.5}).to_csv("drive.csv")
    measured = dict(zip(time.round(3), 0.5 * np.sin(time), strict=True))
    wanted = {"lifelike.xosc": played, "states.csv": played, "drive.csv": measured}
    for path, offsets in wanted.items():
        road = Path("cut-in.xodr") if path == "states.csv" else None
        (source,) = sources_of(Path(path), SourceSettings(road=road, ego="none"))
        (one,) = source.scenes()
        views = views_of(one, PERFECT_SENSOR, 0)
        for view, score in zip(views, Command(awk(tmp_path)).scores(one, views), strict=True):
            if view.track.name == "CutIn":
                known = np.array([offsets[moment] for moment in view.track.time.round(3).tolist()])
                sure = np.ones(len(known), dtype=bool)
                if path == "states.csv":  # recordings are thinned to 0.1 s, rows between are interpolated
                    sure = (np.abs(np.abs(known) - 0.3) > 0.01) & (np.abs(known) < 1.7)
                np.testing.assert_array_equal(score[sure] > 0.5, (view.side * known > 0.3)[sure], err_msg=path)
                assert 0 < (score > 0.5).sum() < len(score)


ANSWER = "import sys\nfor line in sys.stdin:\n    print({!r}, flush=True)\n"


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("import sys\nsys.stdin.readline()\nsys.exit(3)\n", "made, 0 s: detector .* ended with exit code 3 before it"),
        ("import sys\nfor k, line in enumerate(sys.stdin):\n    print('{\"vehicles\": {}}', flush=True)\n"
         "    if k == 4: break\n", r"made, 0\.25 s: detector .* ended with exit code 0"),
        ("import time, sys\nfor k, line in enumerate(sys.stdin):\n    print('{\"vehicles\": {}}', flush=True)\n"
         "    if k == 1: time.sleep(60)\n", r"made, 0\.1 s: .* did not answer within 0\.3 s"),
        (ANSWER.format("cut-in!"), "0 s: .* answered 'cut-in!': no JSON"),
        (ANSWER.format("[1]"), "`vehicles` has to be an object by name"),
        (ANSWER.format('{"time": 7, "vehicles": {}}'), "answered for 7 s"),
        (ANSWER.format('{"vehicles": {"Z": {"score": 1}}}'), "vehicle 'Z', which is not there"),
        (ANSWER.format('{"vehicles": {"A": {"score": "high"}}}'), "vehicle 'A': score is \"high\", expected a number"),
        (ANSWER.format('{"vehicles": {"A": {}}}'), "vehicle 'A': score is null, expected a number"),
        (ANSWER.format('{"vehicles": {"A": {"score": NaN}}}'), "score is NaN"),
        (ANSWER.format('{"vehicles": {"A": {"score": 1, "side": "up"}}}'), 'side is "up", expected left or right'),
    ],
)  # fmt: skip
def test_what_a_program_does_wrong_is_one_line_with_the_step(text, what, tmp_path):
    made = made_scene()
    with pytest.raises(SimulationError, match=what) as caught:
        Command(python(tmp_path, text), answer_time=0.3).scores(made, views_of(made, PERFECT_SENSOR, 0))
    assert "\n" not in str(caught.value)


def test_a_name_that_is_neither_built_in_nor_a_program_is_said_in_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    xl.write_template("cut-in", tmp_path)
    assert main(["detect", "cut-in.xosc", "--detector", "lateral-sped", "-o", "t.csv"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert "'lateral-sped' can't be started" in line and "lateral-speed" in line
    assert not Path("t.csv").exists()


def test_a_program_is_told_places_sizes_and_the_ego(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    xl.write_template("cut-in", tmp_path)
    text = "import sys\nout = open('told.jsonl', 'a')\nfor line in sys.stdin:\n    out.write(line)\n    out.flush()\n"
    xl.detect("cut-in.xosc", detectors=python(tmp_path, text + "    print('{\"vehicles\": {}}', flush=True)\n"))
    told = [json.loads(line) for line in Path("told.jsonl").read_text().splitlines()]
    assert told[0]["ego"] == "Ego" and np.diff([one["time"] for one in told]) == pytest.approx(0.05)
    states = xl.play("cut-in.xosc").to_frame()
    row = states[(states["name"] == "CutIn") & np.isclose(states["time"], 10.0)].iloc[0]
    vehicle = next(one for one in told if one["time"] == 10.0)["vehicles"]["CutIn"]
    same = {"x": "x", "y": "y", "heading": "h", "speed": "speed", "s": "s"}
    assert {key: vehicle[key] for key in same} == pytest.approx(
        {key: row[name] for key, name in same.items()}, abs=1e-3
    )
    assert (vehicle["road"], vehicle["lane"]) == (str(row["road"]), row["lane"])
    known = {"length", "width", "center_x", "lane_width", "offset", "lateral_speed"}
    assert all(known <= one.keys() for line in told for one in line["vehicles"].values())  # of the ego, too
