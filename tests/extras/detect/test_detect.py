"""`detect` from file to table: scenarios, lifelike variants, drive tables, recordings; the same numbers each time."""

from __future__ import annotations

import json
import re
from html import escape
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import xosc_lateral as xl
from tests.kit.lane_tracks import lane_change, weave
from xosc_lateral.cli import main
from xosc_lateral.extras.detect.observation import PERFECT_SENSOR, views_of
from xosc_lateral.extras.detect.page import clip_scene
from xosc_lateral.extras.detect.scoring import Case
from xosc_lateral.extras.detect.sources import SourceSettings, played_scene, sources_of
from xosc_lateral.extras.detect.tracks import STEP, truth_of
from xosc_lateral.workflows.conversion.load import play_scenario


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    xl.write_template("cut-in", tmp_path)
    return tmp_path


def row(result: xl.Detection, source: str, detector: str) -> dict:
    return next(one for one in result.rows() if one["source"] == source and one["detector"].startswith(detector))


def test_nominal_traffic_raises_no_false_alarm_and_the_text_says_what_that_means(folder):
    result = xl.detect("cut-in.xosc", ego="none", variants=2)
    assert result.sources == ("cut-in", "cut-in, motorway")
    assert all(one["false_alarms"] == 0 for one in result.rows() if one["source"] == "cut-in")
    assert result.still == {"cut-in"} and "no false alarm by construction" in str(result)
    nominal, lifelike = (row(result, source, "time-to-line") for source in result.sources)
    assert nominal["cut_ins"] == 1 and lifelike["cut_ins"] == 2
    assert lifelike["hours"] == pytest.approx(2.0 * nominal["hours"], rel=0.2)


def test_a_variant_is_what_convert_writes_and_play_plays(folder):
    result = xl.detect("cut-in.xosc", detectors="wandering-zone:threshold=0.1", ego="none", variants=1, seed=4)
    xl.convert("cut-in.xosc", "lifelike.xosc", ego="none", profile="motorway", seed=4)
    written = xl.detect("lifelike.xosc", detectors="wandering-zone:threshold=0.1", ego="none")
    names = ("hours", "false_alarms", "cut_ins", "lead_median")
    one, other = row(result, "cut-in, motorway", "wandering"), row(written, "lifelike", "wandering")
    assert one["false_alarms"] > 0
    assert [one[name] for name in names] == pytest.approx([other[name] for name in names])


@pytest.mark.parametrize("writer", ["play", "live"])
def test_a_table_of_states_on_its_road_gives_what_the_scenario_gives(writer, folder):
    states = xl.play("cut-in.xosc").to_frame()
    if writer == "live":
        states = states.drop(columns=["z", "offset_t"]).assign(driver="", steered=0)
    states.to_csv("states.csv", index=False)
    one = row(xl.detect("cut-in.xosc", ego="Ego"), "cut-in", "lateral-speed")
    other = row(xl.detect("states.csv", road="cut-in.xodr", ego="Ego"), "states", "lateral-speed")
    assert one["cut_ins"] == other["cut_ins"] == 1
    assert other["lead_median"] == pytest.approx(one["lead_median"], abs=0.11)


def test_a_lane_change_in_a_drive_table_is_found_by_its_markings(folder):
    time = 0.1 * np.arange(1200)
    lateral = weave(120.0, 0.3, 9.0) + lane_change(time, 60.0, 6.0)
    offset = lateral - 3.5 * np.round(lateral / 3.5)
    table = pd.DataFrame({
        "time": time, "distance_left": 1.75 - offset, "distance_right": 1.75 + offset, "speed": 30.0
    })  # fmt: skip
    table.to_csv("drive.csv", index=False)
    result = xl.detect("drive.csv", detectors=["lateral-speed", "fuzzy"])
    found = row(result, "drive", "lateral-speed")
    assert found["cut_ins"] == 1 and found["seen"] == 1.0 and found["lead_median"] > 0.0
    assert "Needs other vehicles, which are not there: fuzzy on drive." in str(result)


def test_the_same_inputs_and_seed_give_the_same_bytes(folder):
    for name in ("a", "b"):
        words = f"cut-in.xosc --sensor usual --ego none --variants 1 -o {name}.csv --report {name}.html -q"
        assert main(["detect", *words.split()]) == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()
    assert Path("a.html").read_bytes() == Path("b.html").read_bytes()


def test_the_page_opens_with_what_the_table_says(folder):
    """The finding's numbers are cells of the table; the colour of a vehicle is that of its place in the scenario."""
    found = xl.detect("cut-in.xosc", ego="none", variants=2)
    found.write_report("finding.html")
    page = Path("finding.html").read_text()
    lead, main = page.split("<main>")
    (sentence,) = re.findall(r"<p>([^<]+ raises false alarms: [^<]+)</p>", lead)
    label = sentence.split(" raises false alarms")[0]
    rows = [row for row in found.rows() if escape(row["detector"]) == label]
    assert len(rows) == 2
    for row in rows:
        minutes = 60.0 * row["hours"]  # of less than six no rate is made
        said = (
            f"{row['false_alarms_per_hour']:.1f} an hour"
            if minutes >= 6
            else f"{row['false_alarms']} in {minutes:.1f} min"
        )
        assert f"{said} on {escape(row['source'])}" in sentence
    every = {row["detector"] for row in found.rows()}
    spread = {
        name: np.ptp([row["false_alarms_per_hour"] for row in found.rows() if row["detector"] == name])
        for name in every
    }
    assert spread[rows[0]["detector"]] == max(spread.values()) > 0.0
    assert main.index("<svg") < main.index("<table"), "the picture comes first"
    order = [entity.name for entity in play_scenario(Path("cut-in.xosc")).motion.entities]
    scene = json.loads(page.split('id="scene-1">')[1].split("</script>")[0])
    assert all(one["number"] == order.index(one["name"]) for one in scene["entities"])


def test_the_page_plays_its_worst_cases(folder):
    xl.detect("cut-in.xosc", ego="none", variants=2).write_report("page.html")
    page = Path("page.html").read_text()
    assert page.count('class="player"') == page.count('href="#case-') > 0
    for number in range(1, 1 + page.count('class="player"')):
        assert f'<h3 id="case-{number}">' in page
        scene = json.loads(page.split(f'id="scene-{number}">')[1].split("</script>")[0])
        assert scene["entities"] and scene["lanes"]
        shown = float(re.search(rf'<h3 id="case-{number}">.* at ([\d.]+) s', page)[1])
        end = scene["start"] + scene["step"] * (scene["frames"] - 1)
        assert scene["start"] <= shown <= end and end - scene["start"] <= 12.0 + 1e-9


def test_a_folder_is_read_without_its_catalogs_and_trains_what_another_source_tests(folder):
    for number in range(3):
        xl.convert("cut-in.xosc", f"many/{number}.xosc", ego="none", seed=number)
    catalog = '<OpenSCENARIO><FileHeader/><Catalog name="c"/></OpenSCENARIO>'
    (folder / "many" / "catalog.xosc").write_text(catalog)
    result = xl.detect("many", detectors="logistic:threshold=0.9", home="cut-in.xosc", ego="none")
    found = row(result, "many", "logistic")
    assert found["cut_ins"] == 3 and found["threshold"] == 0.9 and found["seen"] == 1.0


SETS = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2024-01-01T00:00:00" description="" author=""/>
<ParameterValueDistribution><ScenarioFile filepath="cut-in.xosc"/><Deterministic>
<DeterministicSingleParameterDistribution parameterName="lane_change_time"><DistributionSet>
<Element value="4"/><Element value="8"/></DistributionSet></DeterministicSingleParameterDistribution>
</Deterministic></ParameterValueDistribution></OpenSCENARIO>"""


def test_a_distribution_stands_for_its_scenarios_each_with_offsets_of_its_own(tmp_path):
    xl.write_template("cut-in", tmp_path)
    (tmp_path / "sets.xosc").write_text(SETS)
    settings = SourceSettings(variants=1, profiles=("motorway",), ego="none")
    written, lifelike = (list(source.scenes()) for source in sources_of(tmp_path, settings))
    assert [scene.name for scene in written] == ["sets_p00000", "sets_p00001"]  # the scenario alone is none of them
    lasts = [truth_of(track).changes[0] for scene in written for track in scene.tracks if track.name == "CutIn"]
    assert [round((one.crossing - one.begin) * STEP) for one in lasts] == [1, 2]
    before = [next(track for track in scene.tracks if track.name == "Truck").offset[:200] for scene in lifelike]
    assert np.abs(before[0] - before[1]).max() > 0.01


@pytest.mark.parametrize(
    ("words", "code", "what"),
    [
        (["nowhere.xosc"], 1, "nowhere.xosc: no such file or folder"),
        (["cut-in.xosc", "--detector", "logistic"], 2, "logistic has to be trained: name a source with --home"),
        (["cut-in.xosc", "--detector", "lateral-speed:speed=1"], 2, "lateral-speed has threshold=VALUE, hold=VALUE"),
        (["cut-in.xosc", "--detector", "lateral-speed:hold=x"], 2, "expected a number from 0 to 10"),
        (["cut-in.xosc", "--sensor", "rate=100"], 2, "expected a number from 0.5 to 20"),
        (["cut-in.xosc", "--ego", "Nobody"], 1, "cut-in.xosc: has no vehicle 'Nobody' to be the ego"),
        (["cut-in.xosc", "-o", "cut-in.xosc"], 1, "can't write .xosc"),
        (["cut-in.xosc", "-p", "nobody", "--variants", "1"], 1, "nobody"),
        (["empty.csv"], 1, "empty.csv"),
    ],
)
def test_what_can_t_be_meant_is_one_line(words, code, what, folder, capsys):
    (folder / "empty.csv").write_text("time,offset,lane_width\n")
    before = sorted(folder.iterdir())
    assert main(["detect", *words]) == code
    assert what in " ".join(capsys.readouterr().err.split())
    assert sorted(folder.iterdir()) == before


def test_in_a_clip_a_lane_change_does_not_turn_the_road(folder):
    played = play_scenario(folder / "cut-in.xosc", step=STEP)
    scene = played_scene(played, "cut-in", "none")
    view = next(one for one in views_of(scene, PERFECT_SENSOR, 0) if one.track.name == "CutIn" and one.truth.changes)
    track, moment = view.track, view.truth.changes[0].crossing
    clip = clip_scene(Case("missed", scene, view, float(track.time[moment]), 0.0, np.zeros(len(track)), 1.0))
    shown = json.loads(clip)["entities"][0]
    rows = np.clip(moment + np.arange(-120, 121), 0, len(track) - 1)[:: round(0.1 / STEP)]
    lane = played.network.lane_to_world(track.road[rows], track.lane[rows], track.s[rows]).heading
    course = shown["course"]["r"] * np.cumsum(shown["course"]["d"])
    assert shown["name"] == "CutIn" and np.ptp(track.heading_relative[rows]) > 0.02
    np.testing.assert_allclose(np.exp(1j * course), np.exp(1j * lane), atol=1e-3)
