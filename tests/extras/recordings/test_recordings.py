"""Roads that are made from recordings: lanes where the traffic drives, in the recording's coordinates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.extras.recordings.test_importers import _dlr_recording
from tests.kit.motion import LANE_WIDTH, two_roads
from xosc_lateral.extras.recordings.lines_from_tracks import ReferenceLine
from xosc_lateral.extras.recordings.recorded import RecordedTrack, own_lateral, place_tracks
from xosc_lateral.extras.recordings.recordings import format_of, read_recording
from xosc_lateral.extras.recordings.road_file import WrittenLane, WrittenRoad, curved_plan
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.world.motion.nominal import made_vehicle


@pytest.mark.pages
def test_a_road_out_of_nothing_but_tracks_has_their_lanes(tmp_path):
    tracks, truth = _dlr_recording(seed=11)
    path = tmp_path / "trajectories_1.csv"
    tracks.to_csv(path, index=False)
    traffic = read_recording(path)
    network, shift = traffic.network, traffic.network.header_offset
    assert 6e5 - 2000 < shift.x < 6e5 + 2000
    recording = place_tracks(traffic.tracks, network, *traffic.span)
    true = dict(list(truth.groupby("drive")))
    found, planted = [], []
    for vehicle in recording.vehicles:
        rows = true[f"ht-10{vehicle.name}"] if f"ht-10{vehicle.name}" in true else true[f"ht-1{vehicle.name}"]
        first = {int(lane) for lane in vehicle.lane[:5]}
        right = -3 if network.travel_direction(0, int(vehicle.lane[0])) > 0 else 3
        assert first <= {right, right - int(np.sign(right))}
        if set(rows["lane"]) in ({0}, {1}) and len(set(vehicle.lane.tolist())) == 1:
            middle = slice(len(vehicle.time) // 4, -len(vehicle.time) // 4)
            at = vehicle.time - vehicle.time[0] + 0.05
            found.append(vehicle.offset[middle])
            planted.append(np.interp(at, rows["time"], rows["true"])[middle])
    assert len(found) > 50
    assert np.corrcoef(np.concatenate(found), np.concatenate(planted))[0, 1] > 0.9


def test_a_curve_is_written_to_the_millimetre(tmp_path):
    radius, length = 400.0, 600.0
    line = ReferenceLine(
        length,
        lambda s, order: (
            radius
            * (
                np.column_stack([np.sin(s / radius), 1.0 - np.cos(s / radius)])
                if order == 0
                else np.column_stack([np.cos(s / radius), np.sin(s / radius)]) / radius
            )
        ),
        lambda s: np.full(len(s), 1.0 / radius),
    )
    s = np.linspace(0.0, length, 25)
    width = 3.5 + 0.3 * np.sin(s / 60)
    lanes = [WrittenLane.through("driving", s, width), WrittenLane.even("shoulder", 2.0)]
    road = WrittenRoad("curve", curved_plan(line, (100.0, -50.0)), [], lanes, (100.0, -50.0))
    path = tmp_path / "curve.xodr"
    path.write_text(road.to_xml())
    network = read_opendrive(path)
    at = np.linspace(1.0, length - 1.0, 200)
    poses = network.road_to_world(np.zeros(200, dtype=int), at)
    x, y, *_ = network.header_offset.apply(poses.x, poses.y, poses.z, poses.heading)
    assert np.hypot(x - radius * np.sin(at / radius), y - radius * (1 - np.cos(at / radius))).max() < 1e-3
    there = np.zeros(25, dtype=int), np.full(25, -1), s
    assert network.lane_width(*there) == pytest.approx(width, abs=1e-6)


def test_formats_are_told_from_names(tmp_path):
    for name in ("01_tracks.csv", "01_recordingMeta.csv", "sind_tracks.csv"):
        (tmp_path / name).touch()
    names = {
        "tasi.whl": "dlr-ht", "trajectories_2.csv": "dlr-ht", "01_tracks.csv": "levelx", "sind_tracks.csv": "tracks",
        "a_gt.mcap": "osi",
    }  # fmt: skip
    assert {name: format_of(tmp_path / name) for name in names} == names
    assert format_of(Path("tracks.parquet")) == "tracks"
    assert format_of(tmp_path) == "levelx"


def test_against_its_lane_an_offset_is_left_of_the_lane_and_its_lateral_left_of_its_own_travel(tmp_path):
    network, time = two_roads(tmp_path), np.arange(0.0, 12.0, 0.1)
    columns = {"x": 20.0 + 20.0 * time, "y": np.full(len(time), 0.5 * LANE_WIDTH + 0.3), "heading": np.zeros(len(time))}
    track = RecordedTrack("a", time, columns, np.empty(0, dtype=np.intp), made_vehicle("a", 4.5, 1.8, 1.4), 0.0)
    (vehicle,) = place_tracks([track], network, 0.0, 12.0).vehicles
    assert set(vehicle.lane.tolist()) == {1} and set(vehicle.way().tolist()) == {-1}
    np.testing.assert_allclose(vehicle.offset, -0.3, atol=1e-9)
    np.testing.assert_allclose(own_lateral(vehicle)[0], 0.3, atol=1e-9)


def test_who_comes_back_is_another_entity_and_nothing_around_a_gap_is_lost(tmp_path):
    network, time = two_roads(tmp_path), np.r_[np.arange(0.0, 8.0, 0.1), np.arange(13.0, 24.0, 0.1)]
    columns = {"x": 5.0 + 10.0 * time, "y": np.full(len(time), -0.5 * LANE_WIDTH), "heading": np.zeros(len(time))}
    track = RecordedTrack("a", time, columns, np.empty(0, dtype=np.intp), made_vehicle("a", 4.5, 1.8, 1.4), 0.0)
    recording = place_tracks([track], network, 0.0, 24.0)
    assert [vehicle.name for vehicle in recording.vehicles] == ["a", "a#2"]
    assert sum(map(len, recording.vehicles)) == len(time)
    assert any("comes back" in line for line in recording.left_out)
