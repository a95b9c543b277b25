"""Who is who: every door cuts the same traffic at the same rows, and counts what it leaves out."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.kit.doors import STEP, fcd, highd, osi_trace
from xosc_lateral import XoscLateralError, import_drives, read_drives, reconstruct
from xosc_lateral.drivers.drives.identity import clock_runs, frozen, identify, leaps
from xosc_lateral.extras.detect.sources import SourceSettings, sources_of
from xosc_lateral.extras.recordings.recordings import read_recordings
from xosc_lateral.extras.recordings.road_file import WrittenLane, WrittenRoad
from xosc_lateral.workflows.result import given_drives

COUNT = 600


@pytest.fixture
def road(tmp_path: Path) -> Path:
    plan = np.array([[0.0, 0.0, 0.0, 0.0, 4000.0]])
    lanes = [WrittenLane.even("driving", 3.5), WrittenLane.even("driving", 3.5)]
    path = tmp_path / "road.xodr"
    path.write_text(WrittenRoad("straight", plan, [], lanes).to_xml(), encoding="utf-8")
    return path


def _traffic(seed: int = 1) -> pd.DataFrame:
    """Four vehicles on the right of two lanes each 200 m apart, at 30 m/s, wandering a little."""
    rng = np.random.default_rng(seed)
    time = STEP * np.arange(COUNT)
    parts = []
    for number in range(4):
        wander = 0.2 * np.sin(2 * np.pi * time / 17.0 + rng.uniform(0, 6))
        place = {"x": 200.0 + 200.0 * number + 30.0 * time, "y": (-1.75 if number % 2 else -5.25) + wander}
        parts.append(pd.DataFrame({"id": number, "time": time, **place, "length": 4.5, "width": 1.8, "class": "car"}))
    return pd.concat(parts, ignore_index=True)


def _leaping() -> pd.DataFrame:
    """At 30 s the first identifier goes over to a car that had none."""
    made = _traffic()
    made.loc[(made["id"] == 0) & (made["time"] >= 30.0), "x"] += 1000.0
    return made


def _standing() -> pd.DataFrame:
    """From 20 s the third is at one place for 6 s, then where it should be."""
    made = _traffic()
    rows = (made["id"] == 2) & made["time"].between(20.0, 26.0)
    made.loc[rows, ["x", "y"]] = made.loc[rows, ["x", "y"]].iloc[0].to_numpy()
    return made


def _twice() -> pd.DataFrame:
    return pd.concat([_traffic(1), _traffic(2)], ignore_index=True)


TRAFFIC = {"leaping": _leaping, "standing": _standing, "twice": _twice, "plain": _traffic}
TRUTH = {
    "leaping": {"0", "0#2", "1", "2", "3"},
    "standing": {"0", "1", "2", "3"},
    "twice": {f"{k}{end}" for k in range(4) for end in ("", "#2")},
    "plain": {"0", "1", "2", "3"},
}


PASSAGES = TRUTH | {"standing": {"0", "1", "2", "2#2", "3"}}
"""Entities: who leaps to where he should be is another one from there on."""


@pytest.mark.parametrize("kind", ["leaping", "standing", "plain"])
@pytest.mark.parametrize("door", ["fcd", "osi"])
def test_doors_of_simulators_see_the_same(door: str, kind: str, tmp_path: Path, road: Path) -> None:
    traffic, truth = TRAFFIC[kind](), TRUTH[kind]
    if door == "fcd":
        source, net = fcd(traffic, tmp_path)
        imported, case = import_drives("fcd", source, net=net), {"road": net}
    else:
        source = osi_trace(traffic, tmp_path)
        imported, case = import_drives("osi", source, road=road), {"road": road}
    assert set(imported.table["drive"]) == truth
    assert sum(imported.provenance.rows.values()) == len(traffic)
    assert ("frozen" in imported.provenance.rows) == (kind == "standing")
    tracks = tmp_path / "tracks.csv"
    traffic.to_csv(tracks, index=False)
    other = import_drives("tracks", tracks, road=road)
    assert imported.provenance.rows.get("frozen") == other.provenance.rows.get("frozen")
    made = reconstruct(source, **case).to_dict()
    assert {row["recorded_as"] for row in made["vehicles"]} == PASSAGES[kind]
    assert sum(made["rows"].values()) == len(traffic)


def test_tables_of_drives_are_split_and_counted_at_every_door(tmp_path: Path) -> None:
    time = np.arange(0.0, 60.0, 0.05)
    rng = np.random.default_rng(2)
    one = pd.DataFrame({"time": time, "offset": 0.3 * np.sin(time / 3.0) + rng.normal(0, 0.01, len(time))})
    one = one.assign(lane_width=3.5, speed=30.0)
    made = pd.concat([one, one.iloc[:50].assign(time=59.95), one.assign(offset=-one["offset"])], ignore_index=True)
    made.loc[100:109, "offset"] = np.nan
    made.to_csv(tmp_path / "day.csv", index=False)
    imported = import_drives("table", tmp_path / "day.csv")
    assert set(imported.table["drive"]) == {"day", "day#2"}
    rows = {"kept": 2 * len(time) - 10, "repeated time": 50, "no place in a lane": 10}
    assert imported.provenance.rows == rows
    assert imported.provenance.hours == 0.033  # 2390 rows of 0.05 s are 119.5 s
    imported.write(tmp_path / "again.parquet")
    drives = read_drives(tmp_path / "again.parquet")
    assert [(drive.name, len(drive)) for drive in drives] == [("day", len(time) - 10), ("day#2", len(time))]
    assert given_drives(tmp_path / "day.csv").left_out == {"repeated time": 50, "no place in a lane": 10}


@pytest.mark.parametrize("kind", TRAFFIC)
def test_all_doors_see_the_same_vehicles_and_count_all_rows(kind: str, tmp_path: Path, road: Path) -> None:
    traffic, truth = TRAFFIC[kind](), TRUTH[kind]
    path = tmp_path / "tracks.csv"
    traffic.to_csv(path, index=False)
    imported = import_drives("tracks", path, road=road)
    assert set(imported.table["drive"]) == truth
    assert sum(imported.provenance.rows.values()) == len(traffic)
    other = import_drives("levelx", highd(traffic, tmp_path))
    assert {name.removeprefix("highd-01-") for name in other.table["drive"]} == truth
    assert sum(other.provenance.rows.values()) == len(traffic)
    states = "frozen" in imported.provenance.rows, "frozen" in other.provenance.rows
    assert states == (kind == "standing",) * 2
    every = read_recordings(path, road=road)
    assert {track.name for one in every for track in one.tracks} == truth
    (source,) = sources_of(path, SourceSettings(road=road))
    scenes = list(source.scenes())
    assert {track.name for scene in scenes for track in scene.tracks} == PASSAGES[kind]
    assert len(scenes) == len(every) == (2 if kind == "twice" else 1)
    case = "#2" if kind == "twice" else None
    made = reconstruct(path, road=road, case=case).to_dict()
    held = {name for name in PASSAGES[kind] if kind != "twice" or name.endswith("#2")}
    assert {row["recorded_as"] for row in made["vehicles"]} == held
    if kind != "twice":
        assert sum(made["rows"].values()) == len(traffic)


def test_cases_of_a_file_are_recordings_of_their_own(tmp_path: Path, road: Path) -> None:
    made = pd.concat([_traffic(1).assign(case_id=1.0), _traffic(2).assign(case_id=2.0)], ignore_index=True)
    path = tmp_path / "cases.csv"
    made.rename(columns={"id": "track_id"}).sample(frac=1.0, random_state=1).to_csv(path, index=False)
    imported = import_drives("tracks", path, road=road)
    assert set(imported.table["drive"]) == {f"{case}:{k}" for case in (1, 2) for k in range(4)}
    assert sum(imported.provenance.rows.values()) == len(made)
    with pytest.raises(XoscLateralError, match=r"2 recordings .*: name one with `case`"):
        reconstruct(path, road=road)
    joined = made.assign(x=made["x"] + 5.0 * made["case_id"]).sort_values(["time", "id"])
    joined.drop(columns="case_id").to_csv(path, index=False)
    with pytest.raises(XoscLateralError, match="two places at once"):
        import_drives("tracks", path, road=road)


def test_a_gap_is_bridged_where_the_vehicle_comes_back_as_its_speed_leads(tmp_path: Path, road: Path) -> None:
    traffic = _traffic()
    seen = (traffic["time"] % 20.0 < 18.0) | (traffic["time"] < 5.0)
    path = tmp_path / "gaps.csv"
    traffic[seen].to_csv(path, index=False)
    made = reconstruct(path, road=road, output=tmp_path / "made").to_dict()
    assert [round(row["to"] - row["from"]) for row in made["vehicles"]] == [58] * 4  # the last gap has no other side
    assert {name: len(gaps) for name, gaps in made["inferred"].items()} == {str(k): 2 for k in range(4)}
    assert sum(made["rows"].values()) == seen.sum()
    assert json.loads((tmp_path / "made" / "report.json").read_text())["inferred"] == made["inferred"]


@pytest.mark.parametrize(
    ("word", "outcome"),
    [
        ("Heavy Vehicle", 1.0),
        ("LKW", 1.0),
        ("truck_bus", 1.0),
        ("Passenger Car", 0.0),
        ("Pedestrian", None),
        ("Zeppelin", "asked"),
    ],
)
def test_classes_are_known_by_their_words_or_asked_for(word: str, outcome: object, tmp_path: Path, road: Path) -> None:
    traffic = _traffic()
    traffic.loc[traffic["id"] == 1, "class"] = word
    path = tmp_path / "tracks.csv"
    traffic.to_csv(path, index=False)
    if outcome == "asked":
        with pytest.raises(XoscLateralError, match="'zeppelin' is no known class"):
            import_drives("tracks", path, road=road)
        return
    imported = import_drives("tracks", path, road=road)
    mine = imported.table[imported.table["drive"] == "1"]
    if outcome is None:
        assert mine.empty and imported.provenance.rows["pedestrian"] == COUNT
    else:
        assert set(mine["is_truck"]) == {outcome}


def test_clocks_begin_again_or_rows_are_in_no_order() -> None:
    rng, time = np.random.default_rng(0), np.arange(100.0)
    alone = np.zeros(200, dtype=int)
    assert clock_runs(np.r_[time, time], alone).tolist() == [0] * 100 + [1] * 100
    assert not clock_runs(rng.permutation(np.arange(200.0)), alone).any()
    assert not clock_runs(np.r_[time, time], np.repeat([0, 1], 100)).any()  # one vehicle below the other
    frames = np.tile(np.repeat(time, 2), 2)  # in order of time, two recordings
    assert clock_runs(frames, np.tile([0, 1], 200)).tolist() == [0] * 200 + [1] * 200


def test_noise_braking_and_standing_are_no_leaps() -> None:
    rng, time = np.random.default_rng(3), 0.1 * np.arange(400)
    speed = np.clip(30.0 - 8.0 * np.maximum(time - 10.0, 0.0), 0.0, None)  # full braking to a stand
    x, y = np.cumsum(speed) * 0.1 + rng.normal(0, 0.1, 400), rng.normal(0, 0.1, 400)
    assert not leaps(time, x, y).any() and not frozen(time, x, y).any()
    known = identify(["a"], np.zeros(400, dtype=int), time, x, y)
    assert known.names == ("a",) and not known.dropped
    x[50:52] += 80.0  # two bad rows: the vehicle goes on
    known = identify(["a"], np.zeros(400, dtype=int), time, x, y)
    assert known.names == ("a",) and known.dropped == {"leap": 2}
