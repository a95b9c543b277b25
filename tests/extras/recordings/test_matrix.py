"""Every importer on recordings with known truth: side, direction, rate, reference point, clock."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.kit.recordings import (
    LEAD,
    LENGTHS,
    REFERENCE,
    SPEED,
    TYPES,
    WIDTH,
    Case,
    commonroad_file,
    fleet_table,
    road_file,
    sumo_files,
    sway,
    write_osi_trace,
)
from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.extras.recordings.importers import import_drives
from xosc_lateral.extras.recordings.recordings import read_recording


def gap(case: Case) -> float:
    """Between the bumpers of the car and of the truck ahead, along their lane. [m]"""
    return LEAD * (1.0 - case.centre("car") / case.radius) - 0.5 * (LENGTHS["car"] + LENGTHS["ahead"])


def holds_truth(
    case: Case, table: pd.DataFrame, *, accuracy: float = 2e-3, share: float = 0.8, rows: int = 1000
) -> None:
    """Side, lane and neighbours of the car and of those about it."""
    found = {name.rpartition(":")[2]: part for name, part in table.groupby("drive")}
    car = found["car"] if "car" in found else found["1"]
    assert len(car) > share * rows
    np.testing.assert_allclose(car["offset"], sway(car["time"].to_numpy()), atol=accuracy)
    np.testing.assert_allclose(car["lane_width"], WIDTH, atol=1e-3)
    np.testing.assert_allclose(car["speed"], SPEED, atol=0.3)
    assert set(car["lane_index"]) == {0} and set(car["lane_count"]) == {2}
    np.testing.assert_allclose(car["lead_distance"], gap(case), atol=0.15)
    assert set(car["lead_is_truck"]) == {1.0}
    np.testing.assert_allclose(car["left_distance"], 0.0, atol=1e-6)
    assert car["right_distance"].isna().all()


SIDES = [Case(hand, against) for hand in ("right", "left") for against in (False, True)]
TRACKS = [
    *SIDES,
    Case("right", True, turned=2.0, rate=10.0),
    Case("left", turned=-1.0, rate=50.0, header=(1000.0, 500.0, 0.5)),
    Case(header=(0.4, 0.5, 0.0)),
    Case(rate=30000 / 1001, digits=3),
    Case("left", True, rate=30.0, digits=3),
    Case(rate=25.0, jitter=0.004),
    Case(rate=10.0, jitter=0.03),
    Case("right", True, radius=800.0),
    Case("left", radius=800.0, rate=12.5),
]


@pytest.mark.parametrize("case", TRACKS, ids=str)
@pytest.mark.parametrize("reference", ["centre", "rear axle"])
def test_tracks(case: Case, reference: str, tmp_path: Path) -> None:
    table = case.tracks(reference)
    table.to_csv(tmp_path / "tracks.csv", index=False)
    (tmp_path / "company.toml").write_text(f'reference = "{reference}"')
    words = ["import", "tracks", str(tmp_path / "tracks.csv"), "--road", str(road_file(case, tmp_path))]
    assert main([*words, "--mapping", str(tmp_path / "company.toml"), "-o", str(tmp_path / "d.parquet")]) == 0
    # who keeps no step of its own is seen at instants that are half a step wide
    holds_truth(case, pd.read_parquet(tmp_path / "d.parquet"), rows=int(case.duration * case.rate), accuracy=5e-3)


@pytest.mark.parametrize("reference", REFERENCE)
def test_reference_points_are_put_to_the_middle(reference: str, tmp_path: Path) -> None:
    case = Case("right", True, turned=0.7)
    case.tracks(reference).to_csv(tmp_path / "tracks.csv", index=False)
    (tmp_path / "company.toml").write_text(f'reference = "{reference}"')
    found = import_drives("tracks", tmp_path / "tracks.csv", road=road_file(case, tmp_path),
                          mapping=tmp_path / "company.toml").to_frame()  # fmt: skip
    holds_truth(case, found)


@pytest.mark.parametrize("missing", [1, 5])
def test_frames_that_are_missing_end_no_run_and_hide_nobody(missing: int, tmp_path: Path) -> None:
    case = Case(rate=10.0)
    rows = case.tracks()
    lost = rows["time"].between(20.0, 19.99 + 0.1 * missing)  # frames without anybody, and some without the truck
    blink = (rows["id"] == "ahead") & (np.round(rows["time"] * 10) % 40 < 4)
    rows[~lost & ~blink].to_csv(tmp_path / "tracks.csv", index=False)
    table = import_drives("tracks", tmp_path / "tracks.csv", road=road_file(case, tmp_path)).to_frame()
    holds_truth(case, table, rows=400 - missing, share=0.75)
    assert table[table["drive"] == "car"]["following_run"].nunique() == (1 if missing == 1 else 2)


@pytest.mark.parametrize("case", SIDES, ids=str)
def test_tracks_of_the_other_side_or_mirrored_are_refused(case: Case, tmp_path: Path) -> None:
    other = replace(case, hand="left" if case.hand == "right" else "right")
    case.tracks().to_csv(tmp_path / "tracks.csv", index=False)
    with pytest.raises(FormatError, match=r"100 % of the moving rows drive against .* road_"):
        import_drives("tracks", tmp_path / "tracks.csv", road=road_file(other, tmp_path))
    with pytest.raises(FormatError, match="100 % of the moving rows drive against"):
        read_recording(tmp_path / "tracks.csv", road=road_file(other, tmp_path))
    mirrored = case.tracks().assign(y=lambda rows: -rows["y"], heading=lambda rows: -rows["heading"])
    mirrored.to_csv(tmp_path / "tracks.csv", index=False)
    with pytest.raises(FormatError, match="y may point down"):
        import_drives("tracks", tmp_path / "tracks.csv", road=road_file(case, tmp_path))


@pytest.mark.parametrize(
    ("column", "change", "cause"),
    [
        ("heading", np.degrees, "in degrees, heading=COLUMN:deg"),
        ("heading", lambda h: h + np.pi, "the opposite direction"),
        ("heading", lambda h: np.pi / 2 - h, "clockwise from north"),
        ("heading", lambda h: np.degrees(np.pi / 2 - h), "in degrees, counted clockwise from north"),
        ("speed", lambda h: 108.0 + 0.0 * h, "in km/h: speed=COLUMN:km/h"),
        ("speed", lambda h: 67.1 + 0.0 * h, "in mph"),
        ("time", lambda t: 1000.0 * t, "may be in ms"),
        ("vehicle_class", lambda t: 2 + 0.0 * t, r"numbers such as 2: \[values.vehicle_class\]"),
        ("length", lambda t: np.where(np.arange(len(t)) % 7, 4.5, -9999.0), r"missing = \[-9999\]"),
    ],
)
def test_columns_that_contradict_the_tracks_are_refused_with_the_likely_cause(column, change, cause, tmp_path) -> None:
    case = Case(turned=0.5)
    rows = case.tracks().assign(speed=SPEED)
    rows[column] = change(rows["heading" if column == "speed" else "time" if column in ("vehicle_class", "length")
                               else column])  # fmt: skip
    rows.to_csv(tmp_path / "tracks.csv", index=False)
    with pytest.raises(FormatError, match=cause) as refused:
        import_drives("tracks", tmp_path / "tracks.csv", road=road_file(case, tmp_path))
    assert f"column '{column}'" in str(refused.value)


@pytest.mark.parametrize("case", [*SIDES, Case("left", rate=2.5), Case(rate=1.0, duration=60.0)], ids=str)
def test_fcd_from_the_command_line(case: Case, tmp_path: Path) -> None:
    fcd, net = sumo_files(case, tmp_path)
    (tmp_path / "types.rou.xml").write_text(TYPES)
    words = ["import", "fcd", str(fcd), "--net", str(net), "--types", str(tmp_path / "types.rou.xml")]
    assert main([*words, "-o", str(tmp_path / "d.parquet")]) == 0
    table = pd.read_parquet(tmp_path / "d.parquet")
    holds_truth(case, table, rows=int(case.duration * case.rate), accuracy=1e-3)
    # from 300 m before the border of two edges to far beyond it: the truck is seen across it
    assert table[table["drive"] == "car"]["time"].max() > 30.0


@pytest.mark.parametrize("case", SIDES, ids=str)
def test_fcd_without_a_network_finds_the_side_by_positions_and_sidewalks_are_no_lanes(
    case: Case, tmp_path: Path
) -> None:
    fcd, net = sumo_files(case, tmp_path, sidewalk=True)
    alone = import_drives("fcd", fcd).to_frame()
    car = alone[alone["drive"] == "car"]
    np.testing.assert_allclose(car["offset"], sway(car["time"].to_numpy()), atol=1e-3)
    holds = import_drives("fcd", fcd, net=net).to_frame()
    car = holds[holds["drive"] == "car"]
    assert set(car["lane_index"]) == {0} and set(car["lane_count"]) == {2}
    other = "false" if case.hand == "left" else "true"
    net.write_text(net.read_text().replace(f'lefthand="{str(case.hand == "left").lower()}"', f'lefthand="{other}"'))
    with pytest.raises(FormatError, match="is it this run's"):
        import_drives("fcd", fcd, net=net)


OSI = [*SIDES, Case("right", True, radius=800.0), Case("left", radius=800.0, rate=10.0, turned=1.0)]


@pytest.mark.parametrize("case", OSI, ids=str)
def test_osi(case: Case, tmp_path: Path) -> None:
    pytest.importorskip("osi_utilities", reason="extra `osi` is not installed")
    case = replace(case, rate=min(case.rate, 12.5))
    table = import_drives("osi", write_osi_trace(case, tmp_path)).to_frame()
    holds_truth(case, table, rows=int(case.duration * case.rate), accuracy=0.02)  # chords of 10 m in the curve: 1.6 cm


@pytest.mark.parametrize("case", [Case(rate=10.0), Case("left", True, rate=10.0, radius=800.0)], ids=str)
def test_osi_lanes_that_are_shown_piece_by_piece_and_without_a_direction(case: Case, tmp_path: Path) -> None:
    pytest.importorskip("osi_utilities", reason="extra `osi` is not installed")
    path = write_osi_trace(case, tmp_path, directions=False, horizon=400.0)
    found = import_drives("osi", path, keep_cut=True).to_frame()
    assert not (found["state"] == "no lane")[found["drive"] != "4"].any()  # the oncoming car comes from beyond
    holds_truth(case, import_drives("osi", path).to_frame(), rows=400, accuracy=0.02)


@pytest.mark.parametrize("case", OSI, ids=str)
@pytest.mark.filterwarnings("default")
def test_commonroad(case: Case, tmp_path: Path) -> None:
    pytest.importorskip("commonroad", reason="extra `commonroad` is not installed")
    case = replace(case, rate=10.0)
    table = import_drives("commonroad", commonroad_file(case, tmp_path)).to_frame()
    holds_truth(case, table.replace({"drive": {"made:901": "car"}}), rows=400, accuracy=0.02)
    mirrored = replace(case, hand="left" if case.hand == "right" else "right")
    lanes, cars = (commonroad_file(one, tmp_path).read_text() for one in (case, mirrored))
    (tmp_path / "mixed.xml").write_text(
        lanes.partition("<dynamicObstacle")[0] + "<dynamicObstacle" + cars.partition("<dynamicObstacle")[2]
    )
    with pytest.raises(FormatError, match="drive against the direction of their lanes in its lanelets"):
        import_drives("commonroad", tmp_path / "mixed.xml")


CLOCKS = {
    "s": lambda t: t,
    "epoch s": lambda t: 1.7e9 + t,
    "ms": lambda t: 1000.0 * t,
    "epoch ms": lambda t: 1.7e12 + 1000.0 * t,
    "utc": lambda t: (pd.Timestamp("2026-10-25T00:59:50Z") + pd.to_timedelta(t, "s")).strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
    "berlin": lambda t: [
        stamp.strftime("%d.%m.%Y %H:%M:%S,%f")
        for stamp in (pd.Timestamp("2026-10-25T00:59:50Z") + pd.to_timedelta(t, "s")).tz_convert("Europe/Berlin")
    ],
}


@pytest.mark.pages
@pytest.mark.parametrize("clock", CLOCKS)
@pytest.mark.parametrize("sign", ["m", "-cm", "distances"])
@pytest.mark.parametrize("rate", [5.0, 30.0, 100.0])
def test_fleet_tables(clock: str, sign: str, rate: float, tmp_path: Path) -> None:
    case = Case(rate=rate)
    true = fleet_table(case)
    time = true["time"].to_numpy()
    raw = pd.DataFrame({"Zeit": CLOCKS[clock](time), "v": 3.6 * SPEED})
    lines = [
        f'time_zone = "Europe/Berlin"\n[columns]\ntime = "Zeit{":ms" if "ms" in clock else ""}"',
        'speed = "v:km/h"',
    ]
    if sign == "distances":
        raw = raw.assign(l=1e3 * (0.5 * WIDTH - true["offset"]), r=1e3 * (0.5 * WIDTH + true["offset"]))
        lines += ['distance_left = "l:mm"', 'distance_right = "r:mm"']
    else:
        raw = raw.assign(lat=true["offset"] if sign == "m" else -100.0 * true["offset"], b=WIDTH)
        lines += [f'offset = "lat:{sign}"', 'lane_width = "b"']
    raw.to_csv(tmp_path / "monday.csv", index=False, sep=";")
    (tmp_path / "company.toml").write_text("\n".join(lines))
    words = ["import", "table", str(tmp_path / "monday.csv"), "--mapping", str(tmp_path / "company.toml")]
    assert main([*words, "-o", str(tmp_path / "d.parquet")]) == 0
    from xosc_lateral.files.drives import read_drives

    (drive,) = read_drives(tmp_path / "d.parquet")
    assert len(drive) == len(true)
    np.testing.assert_allclose(drive.time - drive.time[0], time, atol=1e-5)
    np.testing.assert_allclose(drive.offset, sway(time), atol=1e-6)
    np.testing.assert_allclose(drive.lane_width, WIDTH)
    assert drive.context["speed"] == pytest.approx(SPEED)
