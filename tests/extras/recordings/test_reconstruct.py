"""From recordings to scenarios that play as recorded; bad recordings in one line."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lxml import etree

import xosc_lateral as xl
from tests.extras.recordings.test_importers_tracks import (
    WIDTH,
    commonroad_scenario,
    driven,
    two_lanes_each_way,
    world,
)
from tests.kit.jam import LENGTH, RADIUS, ROAD, jam
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.cli import main
from xosc_lateral.extras.recordings.road_file import WrittenLane, WrittenRoad

XSD = Path(__file__).resolve().parents[2] / "data/xsd/OpenSCENARIO-1.2.0.xsd"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("recorded")


@pytest.fixture(scope="module")
def road(folder: Path) -> Path:
    return two_lanes_each_way(folder)


@pytest.fixture(scope="module")
def tracks(folder: Path) -> Path:
    """A cut-in before A; one who changes lanes on the other carriageway; one far away."""
    moving = (
        driven("A", 1, 100.0, 28.0, sway=0.2),
        driven("B", 2, 90.0, 31.0, sway=0.1),
        driven("C", -1, 1900.0, 30.0, sway=0.15, change_at=20.0),
        driven("far", 1, 700.0, 25.0, sway=0.1),
    )
    cut_in = moving[1]
    s = 90.0 + 31.0 * cut_in["time"].to_numpy()
    back = WIDTH / (1.0 + np.exp(-(cut_in["time"].to_numpy() - 18.0) / 0.8))
    sway = 0.1 * np.sin(2 * np.pi * cut_in["time"].to_numpy() / 12)
    cut_in["x"], cut_in["y"] = world(s, -0.5 * WIDTH - back + sway)
    path = folder / "tracks.csv"
    pd.concat(moving).rename(columns={"psi": "psi_deg"}).to_csv(path, index=False)
    return path


COLUMNS = {"heading": "psi_deg:deg"}


def placed(scenario: Path, step: float = 0.02) -> dict[str, pd.DataFrame]:
    rows = xl.play(scenario, step=step).to_frame()
    return {str(name): one.reset_index(drop=True) for name, one in rows.groupby("name")}


@pytest.mark.parametrize("left_hand", [False, True])
@pytest.mark.parametrize("name", ["cut-in", "jam-end"])
def test_a_played_template_comes_back_as_itself(name, left_hand, tmp_path):
    traffic = {"traffic": "left"} if left_hand else {}
    scenario, road = xl.write_template(name, tmp_path / "first", **traffic)
    played = xl.play(scenario)
    states = played.write(tmp_path / "states.csv")
    made = xl.reconstruct(states, tmp_path / "again", road=road)
    before, after = placed(scenario), placed(tmp_path / "again/states.xosc")
    for entity, rows in before.items():
        other = after[entity]
        n = min(len(rows), len(other))
        away = np.hypot(rows["x"][:n] - other["x"][:n], rows["y"][:n] - other["y"][:n])
        assert np.quantile(away, 0.95) < 0.2, entity
    kinds = [(row["entity"], row["kind"], row["side"]) for row in made.to_dict()["maneuvers"]]
    assert kinds == ([("CutIn", "lane change", "left" if left_hand else "right")] if name == "cut-in" else [])


def test_a_recording_plays_as_it_was_driven_and_its_report_says_how_nearly(tracks, road, tmp_path):
    made = xl.reconstruct(tracks, tmp_path, road=road, columns=COLUMNS, host="A")
    facts = json.loads((tmp_path / "report.json").read_text())
    assert facts["summary"]["lane_changes"] == 2
    assert facts["summary"]["along_p95"] < 0.1
    assert facts["host"] == "A"
    sides = {row["entity"]: row["side"] for row in facts["maneuvers"]}
    assert sides == {"B": "right", "C": "left"}
    (cut_in,) = [row for row in facts["encounters"] if row["entity"] == "B"]
    assert cut_in["behind"] == "A"
    # B leads by 3 m/s x 18 s - 10 m at its crossing, less a length of 4.6 m
    assert cut_in["gap_behind"] == pytest.approx(3.0 * 18.0 - 10.0 - 4.6, abs=2.0)
    table = pd.read_csv(tracks)
    for name, rows in placed(tmp_path / "tracks.xosc").items():
        mine = table[table["id"] == name]
        x, y = (np.interp(rows["time"], mine["time"], mine[axis]) for axis in "xy")
        h = rows["h"]
        # recorded are the middles, 0.3 of 4.6 m ahead of the rear axle
        along = (x - rows["x"]) * np.cos(h) + (y - rows["y"]) * np.sin(h) - 0.3 * 4.6
        across = (y - rows["y"]) * np.cos(h) - (x - rows["x"]) * np.sin(h)
        assert np.abs(along).max() < 0.3, name
        assert np.abs(across).max() < 0.7, name
    page = (tmp_path / "report.html").read_text()
    assert "where they were recorded to within" in page and '"views":["Maneuvers","Recorded"]' in page
    assert made.outputs


@pytest.mark.parametrize("version", ["1.0", "1.1", "1.2", "1.3"])
def test_every_version_plays_alike(version, tracks, road, tmp_path):
    xl.reconstruct(tracks, tmp_path, road=road, columns=COLUMNS, version=version, vehicles=["A", "B"])
    scenario = tmp_path / "tracks.xosc"
    root = etree.parse(scenario).getroot()
    header = root.find("FileHeader")
    assert f"{header.get('revMajor')}.{header.get('revMinor')}" == version
    if version == "1.2":
        etree.XMLSchema(etree.parse(XSD)).assertValid(root)
    rows = placed(scenario)["B"]
    assert rows["lane"].iloc[-1] == -2
    assert rows["s"].iloc[-1] == pytest.approx(90.0 + 31.0 * 39.96 - 0.3 * 4.6, abs=0.3)


def test_distances_take_the_place_of_the_clock(tracks, road, tmp_path):
    xl.reconstruct(tracks, tmp_path / "clock", road=road, columns=COLUMNS)
    made = xl.reconstruct(tracks, tmp_path / "relative", road=road, columns=COLUMNS, relative=True)
    (begins,) = [row["begins"] for row in made.to_dict()["maneuvers"] if row["entity"] == "B"]
    assert begins.endswith("m from A")
    one, other = (placed(tmp_path / word / "tracks.xosc")["B"] for word in ("clock", "relative"))
    assert np.abs(one["y"] - other["y"]).max() < 0.1
    text = (tmp_path / "relative/tracks.xosc").read_text()
    assert 'name="B_change1_distance"' in text
    changed = xl.play(tmp_path / "relative/tracks.xosc", parameters={"B_change1_distance": 60}).to_frame()
    moment = [rows[rows["lane"] == -2]["time"].min() for rows in (other, changed[changed["name"] == "B"])]
    assert moment[1] > moment[0] + 3.0  # 3 m/s: it takes longer to be so far ahead


def test_speeds_and_gaps_can_be_varied_by_parameters(tracks, road, tmp_path):
    xl.reconstruct(tracks, tmp_path, road=road, columns=COLUMNS, vehicles=["A", "C"])
    plain = placed(tmp_path / "tracks.xosc")
    varied = xl.play(tmp_path / "tracks.xosc", parameters={"A_faster": 2, "C_ahead": 10}).to_frame()
    a, c = (varied[varied["name"] == name].reset_index(drop=True) for name in ("A", "C"))
    assert (a["speed"] - plain["A"]["speed"]).iloc[5:].to_numpy() == pytest.approx(2.0, abs=1e-6)
    assert (c["s"] - plain["C"]["s"]).to_numpy() == pytest.approx(-10.0, abs=1e-3)  # ahead is towards smaller s


def test_exact_paths_are_the_recorded_ones(tracks, road, tmp_path):
    xl.reconstruct(tracks, tmp_path, road=road, columns=COLUMNS, exact=True, vehicles=["A"])
    rows = placed(tmp_path / "tracks.xosc")["A"]
    t = -0.75 * 0.0 - 1.5 * WIDTH + 0.2 * np.sin(2 * np.pi * rows["time"] / 12)
    x, y = world(np.zeros(len(rows)), t.to_numpy())
    away = -(rows["x"] - x) * np.sin(0.3) + (rows["y"] - y) * np.cos(0.3)
    assert np.abs(away).iloc[5:-5].max() < 0.03


def test_parts_are_chosen_by_time_and_by_company(tracks, road):
    part = xl.reconstruct(tracks, road=road, columns=COLUMNS, begin=10, end=25)
    assert part.to_dict()["window"] == [10, 25] and part.to_dict()["summary"]["duration"] == 15.0
    near = xl.reconstruct(tracks, road=road, columns=COLUMNS, around="A", window=20)
    assert {row["entity"] for row in near.to_dict()["vehicles"]} == {"A", "B", "C"}  # C passes on the other side
    assert near.to_dict()["window"][1] - near.to_dict()["window"][0] == pytest.approx(20.0, abs=0.1)


def test_who_comes_later_and_leaves_is_added_and_taken_out(tracks, road, tmp_path):
    table = pd.read_csv(tracks)
    late = table[(table["id"] == "A") & (table["time"] >= 5.02) & (table["time"] <= 30.0)]
    path = tmp_path / "late.csv"
    pd.concat([late, table[table["id"] == "B"]]).to_csv(path, index=False)
    xl.reconstruct(path, tmp_path / "out", road=road, columns=COLUMNS)
    rows = placed(tmp_path / "out/late.xosc")["A"]
    assert rows["time"].iloc[0] == pytest.approx(5.1, abs=0.021)
    assert rows["time"].iloc[-1] == pytest.approx(30.0, abs=0.05)
    assert rows["s"].iloc[0] == pytest.approx(100.0 + 28.0 * rows["time"].iloc[0] - 0.3 * 4.6, abs=0.3)


def test_the_same_recording_gives_the_same_bytes(tracks, road, tmp_path):
    for word in ("one", "two"):
        xl.reconstruct(tracks, tmp_path / word, road=road, columns=COLUMNS)
    for name in ("tracks.xosc", "road.xodr", "report.json", "report.html", "drivers.csv"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes(), name


@pytest.mark.pages
def test_the_table_of_drivers_makes_a_twin(tracks, road, tmp_path):
    made = xl.reconstruct(tracks, tmp_path / "out", road=road, columns=COLUMNS, host="A")
    profiles = {row["entity"]: row["profile"] for row in made.to_dict()["vehicles"]}
    assert all(profiles.values())
    batch = xl.convert_many([tmp_path / "out/drivers.csv"], tmp_path / "twins", variants=2)
    assert not [row for row in batch.to_frame().to_dict("records") if row["error"]]
    twins = sorted((tmp_path / "twins").rglob("*.xosc"))
    assert len(twins) == 2
    rows, other = (placed(path)["far"]["y"] for path in twins)
    assert np.abs(rows - other).max() > 0.05


def test_bad_vehicles_are_named_and_left_out(tracks, road, tmp_path):
    table = pd.read_csv(tracks)
    one = table[table["id"] == "far"].head(1).assign(id="once")
    beside = table[table["id"] == "A"].assign(id="beside", y=lambda rows: rows["y"] + 500.0)
    gap = table[(table["id"] == "C") & ((table["time"] < 10.0) | (table["time"] > 15.0))].assign(id="gap")
    leap = table[table["id"] == "B"].assign(id="leap")
    leap.loc[leap["time"] > 30.0, "x"] += 300.0
    a = table[table["id"] == "A"]
    x, y = world(np.full(len(a), 500.0), -8.0 + 0.5 * a["time"].to_numpy())
    on_foot = a.assign(id="on_foot", x=x, y=y)
    s = 900.0 + 10.0 * np.minimum(a["time"], 20.0) - 5.0 * np.maximum(a["time"] - 20.0, 0.0)
    x, y = world(s.to_numpy(), np.full(len(a), -0.5 * WIDTH))
    back = a.assign(id="back", x=x, y=y)
    x, y = world(28.0 * a["time"].to_numpy(), np.where(a["time"] < 12.0, -0.5, -1.5) * WIDTH)
    aside = a.assign(id="aside", x=x, y=y)
    x, y = world(np.where(a["time"] < 20.0, 600.0, 604.0), np.full(len(a), -0.5 * WIDTH))
    stood = a.assign(id="stood", x=x, y=y)
    path = tmp_path / "bad.csv"
    pd.concat([a, one, beside, gap, leap, on_foot, back, aside, stood]).to_csv(path, index=False)
    made = xl.reconstruct(path, tmp_path / "out", road=road, columns=COLUMNS)
    said = "\n".join((*made.traffic.notes, *made.left_out))
    assert all(f"{name}:" in said for name in ("once", "beside", "gap", "leap", "on_foot", "back", "aside", "stood"))
    rows = {row["entity"]: row for row in made.to_dict()["vehicles"]}
    assert set(rows) == {"A", "gap", "gap_2", "leap", "back", "aside", "aside_2", "stood", "stood_2"}
    assert rows["back"]["to"] == pytest.approx(20.1, abs=0.11)
    assert (rows["aside_2"]["from"], rows["aside_2"]["lane_changes"]) == (12.0, 0)
    assert rows["gap"]["to"] <= 10.0 and rows["gap_2"]["from"] >= 15.0  # nothing around the gap is lost
    assert rows["leap"]["to"] <= 30.1
    placed(tmp_path / "out/bad.xosc")


@pytest.mark.parametrize("noise", [0.0, 0.02, 0.05])
def test_stop_and_go_is_kept_whole_whatever_the_noise(noise, tmp_path):
    """Noise moves a vehicle that stands across its lane and backwards; where it goes is not told from that."""
    (tmp_path / "road.xodr").write_text(ROAD)
    table, truth = jam(1, noise, vehicles=3)
    table.to_csv(tmp_path / "jam.csv", index=False)
    made = xl.reconstruct(tmp_path / "jam.csv", tmp_path / "out", road=tmp_path / "road.xodr")
    assert not made.left_out
    assert made.to_dict()["summary"]["lane_changes"] == 0
    for name, rows in placed(tmp_path / "out/jam.xosc").items():
        true = truth[truth["id"] == name]
        x, y = (np.interp(rows["time"], true["time"], true[axis]) - rows[axis] for axis in "xy")
        h = rows["h"]
        assert np.abs(x * np.cos(h) + y * np.sin(h) - 0.3 * LENGTH).max() < 0.55, name  # `--error` and a frame
        assert np.abs(y * np.cos(h) - x * np.sin(h)).max() < 0.2, name


def test_a_vehicle_that_never_moves_points_along_its_lane(tmp_path):
    (tmp_path / "road.xodr").write_text(ROAD)
    table, _ = jam(1, 0.02, vehicles=2)
    parked = table[table["id"] == "j0"].assign(id="parked", x=table["x"].iloc[0], y=table["y"].iloc[0])
    noise = np.random.default_rng(5).normal(0.0, 0.02, (len(parked), 2))
    noisy = parked.assign(id="noisy", x=parked["x"] + 30.0 + noise[:, 0], y=parked["y"] + noise[:, 1])
    pd.concat([table, parked, noisy]).to_csv(tmp_path / "jam.csv", index=False)
    xl.reconstruct(tmp_path / "jam.csv", tmp_path / "out", road=tmp_path / "road.xodr")
    for name, rows in placed(tmp_path / "out/jam.xosc").items():
        along = np.arctan2(rows["x"], RADIUS - rows["y"])
        assert np.cos(rows["h"] - along).min() > 0.99, name


def test_a_played_vehicle_may_drive_backwards(tmp_path):
    """Two of three rows contradict their headings, which are those of a table that `play` wrote: no unit is wrong."""
    (tmp_path / "road.xodr").write_text(ROAD)
    table, _ = jam(1, 0.0, vehicles=3, lasting=20.0)
    table["h"] = np.arctan2(table["x"], RADIUS - table["y"])
    back = table["id"] != "j2"
    for axis in "xyh":
        table.loc[back, axis] = table[back].groupby("id")[axis].transform(lambda rows: rows.to_numpy()[::-1])
    played = table.rename(columns={"id": "name"}).assign(z=0.0, speed=1.0, road="1", lane=-1, offset_t=0.0, s=0.0)
    played.to_csv(tmp_path / "states.csv", index=False)
    made = xl.reconstruct(tmp_path / "states.csv", road=tmp_path / "road.xodr")
    assert "j2" in set(made.to_frame()["recorded_as"])
    assert all("backwards" in line for line in made.left_out)
    table.rename(columns={"h": "heading"}).to_csv(tmp_path / "tracks.csv", index=False)
    with pytest.raises(FormatError, match="'heading': contradicts"):
        xl.reconstruct(tmp_path / "tracks.csv", road=tmp_path / "road.xodr")


def test_a_name_that_begins_with_a_dollar_sign_is_no_parameter(tmp_path):
    (tmp_path / "$road.xodr").write_text(ROAD)
    table, _ = jam(1, 0.0, vehicles=2)
    table.replace({"id": {"j0": "$x", "j1": "${y}"}}).to_csv(tmp_path / "$jam.csv", index=False)
    made = xl.reconstruct(tmp_path / "$jam.csv", tmp_path / "out", road=tmp_path / "$road.xodr")
    assert set(made.to_frame()["recorded_as"]) == {"$x", "${y}"}
    assert set(placed(tmp_path / "out/$jam.xosc")) == {"_x", "__y_"}
    batch = xl.convert_many([tmp_path / "out/drivers.csv"], tmp_path / "twins")
    assert not [row for row in batch.to_frame().to_dict("records") if row["error"]]


def test_numbers_that_no_vehicle_has_are_named_or_passed_over(tracks, road, tmp_path):
    table = pd.read_csv(tracks)
    rows = table[table["id"].isin(["A", "B", "C"]) & (table["time"] < 12.0)].assign(length=4.5, width=1.8)
    rows.loc[rows["id"] == "B", "length"] = -3.0
    rows.loc[rows["id"] == "C", "width"] = np.nan
    for row, column, value in ((20, "x", np.inf), (30, "y", 1e300), (40, "time", -np.inf), (50, "psi_deg", np.nan)):
        rows.iloc[row, rows.columns.get_loc(column)] = value
    path = tmp_path / "odd.csv"
    rows.to_csv(path, index=False)
    made = xl.reconstruct(path, tmp_path / "out", road=road, columns=COLUMNS)
    said = "\n".join(made.to_dict()["not_expressed"])
    assert "B: no vehicle has -3 m x 1.8 m" in said
    assert "C: no vehicle has 4.5 m x nan m" in said
    assert set(placed(tmp_path / "out/odd.xosc")) == {"A", "B", "C"}
    rows.assign(time=1e6 * rows["time"]).to_csv(path, index=False)
    with pytest.raises(FormatError, match=r"s apart \(median\)"):
        xl.reconstruct(path, road=road, columns=COLUMNS)
    rows.assign(time=rows["time"] + 1e6 * (rows["id"] == "A")).to_csv(path, index=False)
    with pytest.raises(FormatError, match="`begin` and `end`"):
        xl.reconstruct(path, road=road, columns=COLUMNS)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"road": None}, FormatError, "`road`"),
        ({"host": "Z"}, FormatError, "`host` Z"),
        ({"around": "Z"}, FormatError, "`around` Z"),
        ({"begin": 30.0, "end": 30.2}, FormatError, "no second"),
        ({"format": "video"}, FormatError, "no recording format"),
        ({"vehicles": []}, NotEnoughDataError, "no vehicle"),
        ({"version": "2.0"}, ValueError, "2.0"),
    ],
)
def test_wrong_wishes_are_refused_in_a_line(tracks, road, options, error, message):
    with pytest.raises(error, match=message):
        xl.reconstruct(tracks, **({"road": road, "columns": COLUMNS} | options))


def test_the_verb_refuses_in_one_line_and_writes_nothing(tracks, tmp_path, capsys):
    assert main(["reconstruct", str(tracks), "-o", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "tracks.csv" in said
    assert not (tmp_path / "out").exists()
    empty = tmp_path / "empty.csv"
    empty.write_text("id,time,x,y\n")
    assert main(["reconstruct", str(empty), "-o", str(tmp_path / "out")]) == 1
    assert "Traceback" not in capsys.readouterr().err


def test_json_is_what_its_schema_says(tracks, road, tmp_path, capsys):
    from jsonschema import Draft202012Validator

    words = ["--road", str(road), "--map", "heading=psi_deg:deg", "--to", "20", "-o", str(tmp_path), "--json"]
    assert main(["reconstruct", str(tracks), *words]) == 0
    schema = json.loads((XSD.parents[3] / "docs/schemas/reconstruct.json").read_text())
    Draft202012Validator(schema).validate(json.loads(capsys.readouterr().out))


def test_names_become_names_of_entities_and_parameters():
    from xosc_lateral.extras.recordings.plan import entity_names

    assert entity_names(["17", "a b", "a.b", "ä"]) == ["V17", "a_b", "a_b_2", "_"]


def test_highd_gets_its_road_from_its_markings(tmp_path):
    from tests.extras.recordings.test_importers import _highd

    _highd(tmp_path, lower_offset=0.4, upper_offset=-0.3)
    made = xl.reconstruct(tmp_path, tmp_path / "out")
    assert len(made.to_frame()) == 3
    rows = placed(tmp_path / "out/highd-01.xosc")
    assert {name: int(one["lane"].iloc[0]) for name, one in rows.items()} == {"V1": -3, "V2": -3, "V3": 3}
    one, other = rows["V1"], rows["V3"]
    assert one["y"].to_numpy() == pytest.approx(-25.6, abs=1e-3)  # 0.4 m to the left of y = 26, which points down
    assert other["y"].to_numpy() == pytest.approx(-9.7, abs=1e-3)  # 0.3 m to the right, driving towards -x
    assert (one["x"].iloc[-1] - one["x"].iloc[0]) > 500 > 0 > (other["x"].iloc[-1] - other["x"].iloc[0])


def test_a_saved_mapping_says_the_same_as_its_words(tracks, road, tmp_path):
    saved = tmp_path / "company.toml"
    saved.write_text('[columns]\nheading = "psi_deg:deg"\n')
    for word, options in (("file", ["--mapping", str(saved)]), ("words", ["--map", "heading=psi_deg:deg"])):
        out = ["-o", str(tmp_path / word), "--to", "10", "-q"]
        assert main(["reconstruct", str(tracks), "--road", str(road), *options, *out]) == 0
    one, other = (tmp_path / word / "tracks.xosc" for word in ("file", "words"))
    assert one.read_bytes() == other.read_bytes()


def test_an_osi_trace_of_a_played_scenario_gives_it_back(tmp_path):
    pytest.importorskip("osi_utilities", reason="extra `osi` is not installed")
    scenario, road = xl.write_template("cut-in", tmp_path / "first")
    trace = tmp_path / "trace.osi"
    assert main(["states", str(scenario), "--osi", str(trace), "-q"]) == 0
    made = xl.reconstruct(trace, tmp_path / "again", road=road)
    assert [(row["entity"], row["kind"], row["side"]) for row in made.to_dict()["maneuvers"]] == [
        ("CutIn", "lane change", "right")
    ]
    assert made.to_dict()["host"] == "Ego"  # as the trace says
    assert pd.read_csv(tmp_path / "again/drivers.csv")["ego"].tolist() == ["Ego"]
    assert xl.reconstruct(trace, road=road, host="none").to_dict()["host"] is None
    assert xl.reconstruct(trace, road=road, host="CutIn").to_dict()["host"] == "CutIn"
    assert xl.reconstruct(trace, road=road, vehicles=["CutIn"]).to_dict()["host"] is None
    before, after = placed(scenario), placed(tmp_path / "again/trace.xosc")
    for name, rows in before.items():
        away = np.hypot(rows["x"] - after[name]["x"], rows["y"] - after[name]["y"])
        assert away.max() < 0.01, name


@pytest.mark.parametrize("template", ["cut-in", "curves"])
def test_an_osi_trace_brings_its_road_with_it(template, tmp_path):
    pytest.importorskip("osi_utilities", reason="extra `osi` is not installed")
    scenario, _ = xl.write_template(template, tmp_path / "first")
    trace = tmp_path / "trace.osi"
    assert main(["states", str(scenario), "--osi", str(trace), "-q"]) == 0
    made = xl.reconstruct(trace, tmp_path / "again")
    changes = [row["kind"] for row in made.to_dict()["maneuvers"]]
    assert changes == (["lane change"] if template == "cut-in" else [])
    before, after = placed(scenario), placed(tmp_path / "again/trace.xosc")
    for name, rows in before.items():
        away = np.hypot(rows["x"] - after[name]["x"], rows["y"] - after[name]["y"])
        assert away.max() < 0.05, name


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize("is_given", [True, False])
def test_commonroad_obstacles_drive_on_a_given_road_or_on_their_lanelets(is_given, tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pytest.importorskip("commonroad", reason="extra `commonroad` is not installed")
    path = commonroad_scenario(tmp_path)
    road = bent_road(tmp_path, 0.0, 2 * WIDTH, WIDTH) if is_given else None
    made = xl.reconstruct(path, tmp_path / "out", road=road, host="32")
    vehicles = {row["recorded_as"]: (row["class"], row["lane_changes"]) for row in made.to_dict()["vehicles"]}
    assert vehicles == {"31": ("car", 0), "32": ("truck", 0)}
    rows = placed(tmp_path / "out/made.xosc")
    assert {name: int(one["lane"].iloc[0]) for name, one in rows.items()} == {"V31": -2, "V32": -1}
    assert rows["V32"]["x"].iloc[-1] - rows["V32"]["x"].iloc[0] == pytest.approx(30.0 * 39.9, abs=0.5)


@pytest.mark.parametrize("is_ind", [False, True])
def test_exid_and_its_sisters_drive_on_the_road_that_is_given_with_them(is_ind, tmp_path):
    from tests.extras.recordings.test_importers import _exid

    _exid(tmp_path, True)
    if is_ind:  # inD, rounD and uniD know no lanes
        (tracks,) = tmp_path.glob("*_tracks.csv")
        known = pd.read_csv(tracks)
        known.drop(columns=[name for name in known if "lane" in name.lower()]).to_csv(tracks, index=False)
    with pytest.raises(FormatError, match="`road`"):
        xl.reconstruct(tmp_path)
    road = bent_road(tmp_path, 1.0 / (1500.0 - 5.4), 5.4, 3.6)
    made = xl.reconstruct(tmp_path, tmp_path / "out", road=road)
    facts = made.to_dict()
    assert {row["recorded_as"]: row["class"] for row in facts["vehicles"]} == {"5": "car", "9": "truck"}
    (change,) = facts["maneuvers"]
    assert (change["entity"], change["side"], change["lanes"]) == ("V5", "left", 1)
    # a logistic of scale 0.8 s about 22 s has done 10 and 90 % of its way within 1.76 s
    assert change["start"] < 22.0 - 1.76 < 22.0 + 1.76 < change["start"] + change["duration"]
    assert facts["summary"]["along_p95"] < 0.2


def bent_road(folder: Path, curvature: float, y: float, width: float) -> Path:
    """Two lanes to the right of a line from (0, y) on."""
    lanes = [WrittenLane.even("driving", width), WrittenLane.even("driving", width)]
    plan = np.array([[0.0, 0.0, y, 0.0, 1600.0]])
    text = WrittenRoad("bent", plan, [], lanes).to_xml()
    path = folder / "bent.xodr"
    path.write_text(text.replace("<line/>", f'<arc curvature="{curvature!r}"/>') if curvature else text)
    return path
