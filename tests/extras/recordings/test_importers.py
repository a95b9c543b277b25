"""Importers on recordings that the tests make in the published layouts, so that the truth is known."""

from __future__ import annotations

import io
import json
import re
import sys
import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from tests.cli.test_json import holds
from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.cli import main
from xosc_lateral.extras.recordings.cuts import CutSettings, lane_changes, long_gaps, name_states, number_runs
from xosc_lateral.extras.recordings.importers import ImportedDrives
from xosc_lateral.extras.recordings.importers.dlr_ht import import_dlr_ht, read_tracks
from xosc_lateral.extras.recordings.importers.levelx import import_levelx
from xosc_lateral.extras.recordings.lane_order import NEIGHBOUR_DISTANCE
from xosc_lateral.extras.recordings.lines_from_tracks import fit_lane_centre, fit_reference_line
from xosc_lateral.extras.recordings.neighbours import find_neighbours
from xosc_lateral.files.output_tables import METADATA_KEY

# ---- neighbours and cuts ---------------------------------------------------------------------------------------------


def test_neighbours_agree_with_a_search_over_all_pairs():
    rng = np.random.default_rng(3)
    n = 400
    frame, lane = rng.integers(0, 8, n), rng.integers(-1, 3, n)
    s, length, truck = rng.uniform(0, 1500, n), rng.uniform(4, 18, n), rng.random(n) < 0.3
    there = {"lead": lane >= 0, "left": (lane >= 0) & (lane < 2), "right": lane > 0}
    near = find_neighbours(frame, lane, s, length, truck, lane_on_left=there["left"], lane_on_right=there["right"])
    for k in range(n):
        for name, step in (("lead", 0), ("left", 1), ("right", -1)):
            others = [
                j
                for j in range(n)
                if j != k
                and min(lane[k], lane[j]) >= 0
                and frame[j] == frame[k]
                and lane[j] == lane[k] + step
                and (step != 0 or s[j] > s[k])
            ]
            nearest = min(others, key=lambda j: abs(s[j] - s[k]), default=None)
            found = near[f"{name}_distance"][k]
            free = np.inf if nearest is None else max(abs(s[nearest] - s[k]) - (length[k] + length[nearest]) / 2, 0.0)
            # with the nearest centre on the other side, a longer vehicle may still be nearer bumper to bumper
            if not there[name][k]:
                assert np.isnan(found), "no such lane"
            else:
                assert (found == np.inf and free > NEIGHBOUR_DISTANCE) or found <= min(free, NEIGHBOUR_DISTANCE)
            if step == 0 and free <= NEIGHBOUR_DISTANCE:
                assert found == pytest.approx(free)
                assert near["lead_is_truck"][k] == truck[nearest]


def test_a_lane_change_is_cut_from_setting_off_to_settling():
    step = 0.04
    time = np.arange(0, 30, step)
    x = 3.75 / (1 + np.exp(-(time - 15) / 0.8))  # a smooth change of about 6 s around 15 s
    lane = (x > 3.75 / 2).astype(np.int64)
    vehicle = np.zeros(len(time), dtype=np.int64)
    cut = lane_changes(x, x - 3.75 * lane, lane, vehicle, step, CutSettings(margin=1.0))
    rate = np.gradient(x, step)
    assert cut[rate > 0.1].all()
    assert not cut[np.abs(time - 15) > 6].any()


def test_a_lane_change_whose_crossing_was_not_seen_is_cut_too():
    step = 0.05
    time = np.arange(0, 40, step)
    x = 3.75 / (1 + np.exp(-(time - 40) / 1.2))  # the track ends as the marking is reached
    zeros = np.zeros(len(time), dtype=np.int64)
    cut = lane_changes(x, x, zeros, zeros, step, CutSettings())
    assert cut[np.gradient(x, step) > 0.1].all() and not cut[time < 30].any()
    swaying = 0.3 * np.sin(2 * np.pi * time / 12)
    assert not lane_changes(swaying, swaying, zeros, zeros, step, CutSettings()).any()


def test_only_long_bridges_count_as_gaps():
    made_up = np.zeros(100, dtype=bool)
    made_up[10:20] = made_up[40:70] = True
    gap = long_gaps(made_up, np.zeros(100, dtype=np.int64), 0.05, 1.0)
    assert not gap[10:20].any() and gap[40:70].all() and gap.sum() == 30


def test_crumbs_between_cuts_are_named_short():
    reasons = {"gap": np.isin(np.arange(300), [100, 140])}
    zeros = np.zeros(300, dtype=np.int64)
    state = name_states(reasons, zeros, zeros, 0.05 * np.arange(300), 0.05, CutSettings(edge=0.5, shortest=3.0))
    assert set(state[101:140]) == {"short"} and set(state[10:90]) == {"kept"} and state[140] == "gap"
    assert set(state[:10]) == set(state[90:100]) == {"edge"}
    runs = number_runs(state, zeros, zeros, 0.05 * np.arange(300))
    assert set(runs[10:90]) == {0} and set(runs[151:290]) == {1} and set(runs[state != "kept"]) == {-1}


def test_who_stops_on_the_line_before_moving_over_has_not_changed_lanes_yet():
    step = 0.05
    time = np.arange(0, 40, step)
    offset = np.interp(time, [0, 10, 16, 20, 40], [-2.05, -2.0, -2.0, 0.0, 0.1])
    lane = np.where(time < 8, -1, 0)
    zeros = np.zeros(len(time), dtype=np.int64)
    cut = lane_changes(offset, np.where(lane < 0, np.nan, offset), lane, zeros, step, CutSettings(longest_change=12))
    assert cut[(time > 8.1) & (time < 18.5)].all() and not cut[time > 21].any()


# ---- lane centres ----------------------------------------------------------------------------------------------------


def _drifting(n: int, memory: float, spread: float, rng: np.random.Generator) -> np.ndarray:
    values = np.empty(n)
    values[0] = rng.normal(0, spread)
    for k in range(1, n):
        values[k] = memory * values[k - 1] + rng.normal(0, spread * np.sqrt(1 - memory**2))
    return values


def test_lane_centre_is_recovered_within_its_standard_error():
    rng = np.random.default_rng(5)
    wave = lambda s: 0.3 * np.sin(2 * np.pi * s / 240)  # noqa: E731
    s, d, height, passage = [], [], [], []
    for vehicle in range(150):
        place = np.arange(rng.uniform(0, 600), rng.uniform(1400, 2000), 30.0)
        tall = rng.choice([1.5, 3.5])
        tilt = 0.1 * np.sin(2 * np.pi * place / 400) * (tall - 1.5)
        s.append(place)
        d.append(wave(place) + tilt + _drifting(len(place), 0.9, 0.28, rng))
        height.append(np.full(len(place), tall))
        passage.append(np.full(len(place), vehicle))
    lane = fit_lane_centre(*map(np.concatenate, (s, d, height, passage)))
    at = np.arange(lane.start, lane.end, 5.0)
    low, high = np.full(len(at), 1.5), np.full(len(at), 3.5)
    error = (lane.at(at, low) - wave(at)) / lane.standard_error(at)
    assert np.sqrt((error**2).mean()) < 2.0, "errors far beyond the standard error that is claimed"
    assert np.median(lane.standard_error(at)) < 0.06
    parallax = lane.at(at, high) - lane.at(at, low)
    assert np.corrcoef(parallax, np.sin(2 * np.pi * at / 400))[0, 1] > 0.8


def test_vehicles_of_one_height_are_enough():
    rng = np.random.default_rng(6)
    s = np.tile(np.arange(0, 1000, 30.0), 40)
    passage = np.repeat(np.arange(40), len(s) // 40)
    lane = fit_lane_centre(s, 0.1 + rng.normal(0, 0.1, len(s)), np.full(len(s), 1.5), passage)
    assert lane.at(np.array([500.0]), np.array([1.5])) == pytest.approx(0.1, abs=0.05)


def test_a_lane_without_traffic_is_refused_with_the_count():
    s = np.arange(0, 1000, 30.0)
    with pytest.raises(NotEnoughDataError, match=r"at most 1 drives share 100 m .* 10 are needed"):
        fit_lane_centre(s, np.zeros(len(s)), np.full(len(s), 1.5), np.zeros(len(s), dtype=np.int64))


@pytest.mark.parametrize("turn", [0.0, 100.0, 200.0, 300.0])
def test_reference_line_runs_with_the_first_direction_whatever_its_heading(turn):
    rng = np.random.default_rng(8)
    rows, forward = [], []
    for k in range(40):
        way = 1 if k % 2 else -1
        along = np.arange(rng.uniform(0, 300), rng.uniform(1500, 1800), 1.5)[::way]
        rows.append(np.column_stack([along, np.full(len(along), -4.0 * way)]))
        forward.append(np.full(len(along), way == 1))
    angle = np.radians(turn)
    rotation = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    mine = np.concatenate(forward)
    _, s, d = fit_reference_line(np.concatenate(rows) @ rotation, mine)
    assert np.median(np.diff(s[mine])) > 0 > np.median(np.diff(s[~mine]))
    assert d[mine] == pytest.approx(-4.0, abs=0.01) and d[~mine] == pytest.approx(4.0, abs=0.01)


# ---- DLR HT ----------------------------------------------------------------------------------------------------------

RADIUS, ROAD, WIDTH, TURN = 4000.0, 1600.0, 3.7, np.radians(50.0)


def _dlr_recording(seed: int, per_lane: int = 24) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Traffic on a curved road, two lanes each way, seen by cameras with a calibration wave; and the true offsets."""
    rng = np.random.default_rng(seed)
    rows, truth, number = [], [], 0
    start = pd.Timestamp("2024-10-07 06:00:00+00:00")
    for way in (1, -1):
        for lane in (0, 1):
            for _ in range(per_lane):
                speed = rng.uniform(26, 38)
                time = np.arange(0, ROAD / speed, 0.05)
                along = speed * time
                changes = lane == 0 and rng.random() < 0.2
                slow = _drifting(len(time) // 20 + 2, 0.9, 0.25, rng)
                offset = np.interp(time, np.arange(len(slow)), slow)
                offset = np.convolve(np.pad(offset, 30, mode="edge"), np.hanning(61) / np.hanning(61).sum(), "valid")
                across = (
                    -5.0
                    - WIDTH * (0.5 - lane)
                    + offset
                    - WIDTH / 2
                    + (WIDTH / (1 + np.exp(-(time - time[-1] / 2) / 0.8)) if changes else 0.0)
                )
                s = along if way == 1 else ROAD - along
                t = way * across + 0.3 * np.sin(2 * np.pi * s / 250)
                x, y = (RADIUS - t) * np.sin(s / RADIUS), RADIUS - (RADIUS - t) * np.cos(s / RADIUS)
                truck = rng.random() < 0.25
                made_up = (along > 700) & (along < 700 + 1.5 * speed)
                frame = pd.DataFrame(
                    {
                        "timestamp": start + pd.to_timedelta(np.round(time + rng.integers(0, 200), 3), unit="s"),
                        "id": 1000 + number,
                        "center_easting": 6e5 + x * np.cos(TURN) - y * np.sin(TURN),
                        "center_northing": 5.79e6 + x * np.sin(TURN) + y * np.cos(TURN),
                        "velocity_northing": way * speed * 0.8,
                        "velocity_magnitude": speed,
                        "acceleration_signed": 0.0,
                        "dimension_length": 15.0 if truck else 4.5,
                        "dimension_height": 3.5 if truck else 1.5,
                        "interpolated": made_up,
                        "classifications_car": 0.1 if truck else 0.8,
                        "classifications_van": 0.1,
                        "classifications_truck": 0.8 if truck else 0.1,
                        "classifications_motorbike": 0.0,
                    }
                )
                rows.append(frame)
                truth.append(
                    pd.DataFrame({"drive": f"ht-{1000 + number}", "time": time, "true": offset, "lane": lane + changes})
                )
                number += 1
    return pd.concat(rows), pd.concat(truth)


@pytest.fixture(scope="module")
def dlr_csv(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, pd.DataFrame]:
    tracks, truth = _dlr_recording(seed=11)
    path = tmp_path_factory.mktemp("dlr") / "trajectories_1.csv"
    tracks.sample(frac=1.0, random_state=1).to_csv(path, index=False)
    return path, truth


@pytest.fixture(scope="module")
def dlr_full(dlr_csv: tuple[Path, pd.DataFrame]) -> ImportedDrives:
    """ImportedDrives once, with the rows that would be cut."""
    return import_dlr_ht(dlr_csv[0], keep_cut=True)


@pytest.mark.pages
def test_dlr_offsets_come_back_without_lane_geometry(dlr_csv, dlr_full):
    truth, full = dlr_csv[1], dlr_full.table
    table = full[full["state"] == "kept"]
    assert np.isfinite(table[["time", "offset", "lane_width", "speed", "curvature"]].to_numpy()).all()
    found, known = [], []
    for drive, mine in full.groupby("drive", sort=True):
        real = truth[truth["drive"] == drive]
        assert len(mine) == len(real)
        kept = (mine["state"] == "kept").to_numpy()
        found.append(mine["offset"].to_numpy()[kept])
        known.append(real["true"].to_numpy()[kept])
    found, known = np.concatenate(found), np.concatenate(known)
    assert len(found) > 0.5 * len(truth)
    assert np.corrcoef(found, known)[0, 1] > 0.95, "also fails when left and right are swapped"
    assert np.std(found - known) < 0.1
    assert np.std(found) == pytest.approx(np.std(known), rel=0.05), "the estimate eats the drivers' own variation"
    assert table["lane_width"].median() == pytest.approx(WIDTH, abs=0.15)


def test_dlr_cuts_lane_changes_and_long_bridges_and_says_so(dlr_csv, dlr_full):
    path, imported = dlr_csv[0], dlr_full
    rows = dict(imported.provenance.rows)
    assert rows["gap"] > 0 and rows["lane change"] > 0 and sum(rows.values()) == len(imported.table)
    assert len(imported.provenance.lanes) == 4
    assert all(lane["centre_standard_error_m"]["max"] <= 0.15 for lane in imported.provenance.lanes)
    without = import_dlr_ht(path, CutSettings(max_gap=2.0)).provenance.rows
    assert "gap" not in without, "bridges of 1.5 s stay when 2 s are allowed"


def test_dlr_leaders_and_classes_are_those_of_the_recording(dlr_full):
    table = dlr_full.table
    trucks = set(table.loc[table["vehicle_class"] == "truck", "drive"])
    assert 10 < len(trucks) < 45
    assert table["is_truck"].eq(table["vehicle_class"] == "truck").all(), "as a scenario states it"
    inside = table[table["lane_index"] >= 0]
    lead = inside["lead_distance"].replace(np.inf, NEIGHBOUR_DISTANCE)
    assert lead.between(0, NEIGHBOUR_DISTANCE).all(), "infinite: nobody within reach"
    assert inside["left_distance"].isna().eq(inside["lane_index"] == 1).all(), "no lane beyond the left one"
    assert inside["right_distance"].isna().eq(inside["lane_index"] == 0).all()
    assert set(table["lead_is_truck"].unique()) <= {0.0, 1.0}
    # in left-hand-positive terms the road bends left for one direction and right for the other
    assert table["curvature"].abs().median() == pytest.approx(1 / RADIUS, rel=0.4)


def test_dlr_reads_csv_zip_and_wheel_alike(dlr_csv, tmp_path):
    path, _ = dlr_csv
    inner = io.BytesIO()
    folder = "DLR-Highway-Traffic-dataset_v1-1-0"
    with zipfile.ZipFile(inner, "w") as archive:
        archive.write(path, f"{folder}/raw_data/trajectories/trajectories_1.csv")
    zipped, wheel = tmp_path / f"{folder}.zip", tmp_path / "tasi-0-py3-none-any.whl"
    zipped.write_bytes(inner.getvalue())
    with zipfile.ZipFile(wheel, "w") as archive:
        archive.writestr(f"tasi/dataset/data/{folder}.zip", inner.getvalue())
    tables = [read_tracks(source) for source in (path, zipped, wheel)]
    pd.testing.assert_frame_equal(tables[0], tables[1])
    pd.testing.assert_frame_equal(tables[0], tables[2])


@pytest.mark.pages
def test_import_verb_writes_a_table_with_its_provenance(dlr_csv, tmp_path, capsys):
    path, _ = dlr_csv
    out = tmp_path / "dlr.parquet"
    assert main(["import", "dlr-ht", str(path), "-o", str(out), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    holds(record, "import")
    assert record.pop("output") == str(out)
    assert [one["what"] for one in record.pop("messages")] == record["notes"]
    written = json.loads(pq.read_schema(out).metadata[METADATA_KEY])
    assert written.pop("package").startswith("xosc-lateral ")
    assert written == record
    assert record["vehicles"] == 96 and record["sha256"] and "DLR" in record["licence"]
    again = tmp_path / "again.parquet"
    assert main(["import", "dlr-ht", str(path), "-o", str(again)]) == 0
    assert again.read_bytes() == out.read_bytes()


def test_too_little_traffic_names_the_file(dlr_csv, tmp_path, capsys):
    lines = dlr_csv[0].read_text().splitlines()
    (tmp_path / "few.csv").write_text("\n".join(lines[:60]) + "\n")
    assert main(["import", "dlr-ht", str(tmp_path / "few.csv"), "-o", str(tmp_path / "t.parquet")]) == 1
    assert re.match(r"xosc-lateral: \S*few\.csv: .* are needed\n$", capsys.readouterr().err)


def test_a_foreign_csv_is_refused_in_one_line(tmp_path, capsys):
    path = tmp_path / "other.csv"
    path.write_text("time,x\n0,1\n")
    assert main(["import", "dlr-ht", str(path), "-o", str(tmp_path / "t.parquet")]) == 1
    message = capsys.readouterr().err
    assert "other.csv:1: no column timestamp" in message and message.count("\n") == 1
    assert not (tmp_path / "t.parquet").exists()


def _damaged(dlr_csv: tuple[Path, pd.DataFrame], kind: str) -> bytes:
    text = dlr_csv[0].read_bytes()
    lines = text.split(b"\n")[:200]
    if kind == "missing value":
        cells = lines[5].split(b",")
        cells[2] = b""
        lines[5] = b",".join(cells)
    elif kind == "text":
        lines[7] = lines[7].replace(b"0.8", b"none", 1).replace(b"0.1", b"none", 1)
    elif kind == "ragged":
        lines[9] += b",1,2,3"
    elif kind == "no rows":
        lines = lines[:1]
    elif kind == "few rows":
        pass
    return b"\n".join(lines)


@pytest.mark.parametrize("kind", ["missing value", "text", "ragged", "no rows", "few rows"])
def test_damaged_recordings_are_refused_in_one_line(dlr_csv, tmp_path, capsys, kind):
    path = tmp_path / "trajectories_1.csv"
    path.write_bytes(_damaged(dlr_csv, kind))
    assert main(["import", "dlr-ht", str(path), "-o", str(tmp_path / "t.parquet")]) == 1
    message = capsys.readouterr().err
    assert message.startswith("xosc-lateral: ") and message.count("\n") == 1
    if kind == "missing value":
        assert "trajectories_1.csv:6: center_easting: no number: nan" in message


def test_a_damaged_or_foreign_zip_is_refused(tmp_path, capsys):
    path = tmp_path / "x.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("other.txt", "hello")
    assert main(["import", "dlr-ht", str(path), "-o", str(tmp_path / "t.parquet")]) == 1
    assert "holds no trajectories of DLR Highway Traffic" in capsys.readouterr().err
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a/trajectories/trajectories_1.csv", "timestamp,id\n" * 1000)
    content = bytearray(path.read_bytes())
    content[60:80] = bytes(20)
    path.write_bytes(content)
    assert main(["import", "dlr-ht", str(path), "-o", str(tmp_path / "t.parquet")]) == 1
    assert "damaged zip" in capsys.readouterr().err


# ---- highD -----------------------------------------------------------------------------------------------------------


def _highd(folder: Path, lower_offset: float, upper_offset: float) -> None:
    """Three vehicles: one on each carriageway, keeping an offset to the left, and a leader for the lower one."""
    frames = np.arange(1, 501)
    marks = {"upperLaneMarkings": "8.0;12.0;16.0", "lowerLaneMarkings": "20.0;24.0;28.0"}
    rows = []
    # lower lanes drive towards +x, y points down: the right lane is the one with the larger y, left is smaller y
    for number, x0, centre, way, left, size in (
        (1, 0.0, 26.0, 1, lower_offset, (4.5, 1.8)),
        (2, 60.0, 26.0, 1, 0.0, (12.0, 2.5)),
        (3, 400.0, 10.0, -1, upper_offset, (4.5, 1.8)),
    ):
        middle = centre - left if way == 1 else centre + left
        rows.append(
            pd.DataFrame(
                {
                    "frame": frames,
                    "id": number,
                    "x": x0 + way * 30.0 * frames / 25 - size[0] / 2,
                    "y": middle - size[1] / 2,
                    "width": size[0],
                    "height": size[1],
                    "xVelocity": way * 30.0,
                    "xAcceleration": way * 0.1,
                }
            )
        )
    pd.concat(rows).to_csv(folder / "01_tracks.csv", index=False)
    pd.DataFrame({"id": [1, 2, 3], "class": ["Car", "Truck", "Car"], "drivingDirection": [2, 2, 1]}).to_csv(
        folder / "01_tracksMeta.csv", index=False
    )
    pd.DataFrame({"id": [1], "frameRate": [25], **{k: [v] for k, v in marks.items()}}).to_csv(
        folder / "01_recordingMeta.csv", index=False
    )


def test_highd_offsets_are_left_positive_on_both_carriageways(tmp_path):
    _highd(tmp_path, lower_offset=0.4, upper_offset=-0.3)
    imported = import_levelx(tmp_path)
    table = imported.table.set_index("drive")
    assert table.loc["highd-01-1", "offset"].to_numpy() == pytest.approx(0.4)
    assert table.loc["highd-01-3", "offset"].to_numpy() == pytest.approx(-0.3)
    assert set(table["lane_index"]) == {0}, "outermost lanes, so rightmost ones"
    assert set(table["lane_width"]) == {4.0} and set(table["lane_count"]) == {2}
    follower = table.loc["highd-01-1"]
    assert follower["lead_distance"].to_numpy() == pytest.approx(60.0 - 2.25 - 6.0)
    assert set(follower["lead_is_truck"]) == {1.0}
    assert np.isposinf(table.loc["highd-01-2", "lead_distance"]).all(), "nobody within reach"
    assert table["right_distance"].isna().all() and np.isposinf(table["left_distance"]).all()
    assert table["acceleration"].to_numpy() == pytest.approx(0.1)
    assert imported.provenance.format == "levelx highD"


def test_highd_of_the_other_direction_is_refused(tmp_path):
    _highd(tmp_path, 0.4, -0.3)
    meta = tmp_path / "01_tracksMeta.csv"
    meta.write_text(meta.read_text().replace(",2", ",0").replace(",1", ",2").replace(",0", ",1"))
    with pytest.raises(
        FormatError, match="drive against the direction of their lanes in the recording's drivingDirection"
    ):
        import_levelx(tmp_path)


def test_highd_without_its_meta_file_is_refused(tmp_path, capsys):
    _highd(tmp_path, 0.0, 0.0)
    (tmp_path / "01_recordingMeta.csv").unlink()
    assert main(["import", "levelx", str(tmp_path), "-o", str(tmp_path / "t.csv")]) == 1
    assert "01_recordingMeta.csv: missing" in capsys.readouterr().err


# ---- exiD ------------------------------------------------------------------------------------------------------------


def _exid(folder: Path, positive_left: bool) -> np.ndarray:
    """A car that weaves and changes lanes once behind a truck, on a bend; returns its true offset before the change."""
    frames = np.arange(0, 750)
    time = frames / 25.0
    weave = 0.4 * np.sin(2 * np.pi * time / 9.0)
    change = 3.6 / (1 + np.exp(-(time - 22) / 0.8))
    lateral = weave + change
    lane = (lateral > 1.8).astype(int)
    rows = []
    for number, along0, across in ((5, 0.0, lateral), (9, 40.0, np.zeros(len(time)))):
        s = along0 + 32.0 * time
        course = s / 1500.0
        heading = course + np.gradient(across, time) / 32.0
        own_lane = lane if number == 5 else np.zeros(len(time), dtype=int)
        offset = across - 3.6 * own_lane
        text = [
            f"{value:.4f};9.9" if k % 7 == 0 else f"{value:.4f}"
            for k, value in enumerate(offset if positive_left else -offset)
        ]
        rows.append(
            pd.DataFrame(
                {
                    "trackId": number,
                    "frame": frames,
                    "xCenter": 1500 * np.sin(course) - across * np.sin(course),
                    "yCenter": 1500 * (1 - np.cos(course)) + across * np.cos(course),
                    "heading": np.degrees(heading) % 360.0,
                    "length": 4.6,
                    "lonVelocity": 32.0,
                    "lonAcceleration": 0.0,
                    "latLaneCenterOffset": text,
                    "laneWidth": [f"{3.6:.3f};4.0" if k % 7 == 0 else "3.600" for k in frames],
                    "laneletId": 1500 + own_lane,
                    "laneChange": np.r_[0, np.diff(own_lane)],
                    "leadId": 9 if number == 5 else -1,
                    "leadDHW": 40.0 - 4.6 if number == 5 else -1.0,
                    **{f"{side}{who}Id": -1 for side in ("left", "right") for who in ("Lead", "Rear", "Alongside")},
                }
            )
        )
    tracks = pd.concat(rows, ignore_index=True)
    late = (tracks["trackId"] == 5) & (tracks["laneletId"] == 1501)
    tracks.loc[late, "leadId"], tracks.loc[late, "leadDHW"], tracks.loc[late, "rightLeadId"] = -1, -1.0, 9
    tracks.to_csv(folder / "07_tracks.csv", index=False)
    pd.DataFrame({"trackId": [5, 9], "class": ["car", "truck"]}).to_csv(folder / "07_tracksMeta.csv", index=False)
    pd.DataFrame({"recordingId": [7], "frameRate": [25.0]}).to_csv(folder / "07_recordingMeta.csv", index=False)
    return weave


@pytest.mark.parametrize("positive_left", [True, False])
def test_exid_offsets_are_left_positive_whatever_the_file_says(tmp_path, positive_left):
    weave = _exid(tmp_path, positive_left)
    table = import_levelx(tmp_path / "07_tracks.csv").table
    mine = table[(table["drive"] == "exid-07-5") & (table["time"] < 15)]
    rows = np.round(mine["time"].to_numpy() * 25).astype(int)
    assert len(mine) > 250
    assert mine["offset"].to_numpy() == pytest.approx(weave[rows], abs=1e-3)
    assert mine["lead_distance"].to_numpy() == pytest.approx(35.4)
    assert set(mine["lead_is_truck"]) == {1.0}
    after = table[(table["drive"] == "exid-07-5") & (table["time"] > 27)]
    assert after.empty or after["right_distance"].notna().all()
    assert not table[(table["drive"] == "exid-07-5") & table["time"].between(20, 24)].size


def test_exid_without_lateral_movement_is_refused_rather_than_guessed(tmp_path):
    _exid(tmp_path, True)
    tracks = pd.read_csv(tmp_path / "07_tracks.csv")
    rng = np.random.default_rng(0)
    tracks["heading"] = rng.normal(0, 1e-3, len(tracks))
    tracks.to_csv(tmp_path / "07_tracks.csv", index=False)
    with pytest.raises(FormatError, match="the lane's positive side"):
        import_levelx(tmp_path)


# ---- one more --------------------------------------------------------------------------------------------------------
def import_three_rows(source: Path, *, width: str = "3.5") -> pd.DataFrame:
    """Three rows.

    A format of the package needs this function, a line in `IMPORTERS`, and its test.
    """
    assert source.read_text() == "anything"
    time = [0.0, 0.1, 0.2]
    return pd.DataFrame({"drive": "d", "time": time, "offset": [0.0, 0.1, 0.2], "lane_width": float(width)})


def test_another_format_is_one_function_and_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    import xosc_lateral as xl
    from xosc_lateral.extras.recordings import importers

    monkeypatch.setitem(importers.IMPORTERS, "three-rows", f"{__name__}:import_three_rows")
    monkeypatch.setattr(importers, "import_module", lambda name, _package: sys.modules[name])
    source = tmp_path / "log.bin"
    source.write_text("anything")
    assert xl.import_drives("three-rows", source).to_frame()["offset"].tolist() == [0.0, 0.1, 0.2]
    target = tmp_path / "t.csv"
    assert main(["import", "three-rows", str(source), "-o", str(target), "--set", "width=3.75"]) == 0
    assert pd.read_csv(target)["lane_width"].tolist() == [3.75] * 3
    assert main(["import", "--help"]) == 0
    assert "three-rows" in capsys.readouterr().out
