"""Tables in the layouts that public data sets are published in, two recordings each: all rows are counted."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.extras.recordings.test_agreement import road_file, traffic
from xosc_lateral import import_drives
from xosc_lateral.base.vehicle_classes import class_of
from xosc_lateral.extras.recordings.recordings import read_recordings

FOOT = 0.3048

Layout = Callable[[pd.DataFrame], dict[str, object]]
LAYOUTS: dict[str, tuple[Layout, dict[str, str]]] = {
    "INTERACTION": (
        lambda t: {
            "case_id": t.part + 1.0, "track_id": t.id, "frame_id": t.frame, "timestamp_ms": 100 * t.frame + 100,
            "agent_type": "car", "x": t.x, "y": t.y, "vx": 30.0, "vy": 0.0, "psi_rad": 0.0, "length": t.length,
            "width": t.width,
        },
        {},
    ),
    "Waymo": (
        lambda t: {
            "scenario_id": "s" + t.part.astype(str), "track_id": t.id, "object_type": "TYPE_VEHICLE",
            "timestamp_seconds": t.time, "center_x": t.x, "center_y": t.y, "heading": 0.0, "length": t.length,
            "width": t.width, "velocity_x": 30.0, "velocity_y": 0.0, "valid": True,
        },
        {},
    ),
    "Argoverse 1": (
        lambda t: {
            "TIMESTAMP": 315968000.0 + t.time, "TRACK_ID": t.id.astype(str), "OBJECT_TYPE": "OTHERS", "X": t.x,
            "Y": t.y, "CITY_NAME": "PIT",
        },
        {},
    ),
    "Argoverse 2": (
        lambda t: {
            "observed": True, "track_id": t.id.astype(str), "object_type": "vehicle", "object_category": 3,
            "timestep": t.frame, "position_x": t.x, "position_y": t.y, "heading": 0.0, "velocity_x": 30.0,
            "velocity_y": 0.0, "scenario_id": "s" + t.part.astype(str), "start_timestamp": 315968000000000000,
            "city": "austin",
        },
        {"time": "timestep:1/10 s"},
    ),
    "NGSIM": (
        lambda t: {
            "Vehicle_ID": t.id, "Frame_ID": t.frame, "Total_Frames": 600, "Global_Time": 1118846980000 + 100 * t.frame,
            "Local_X": -t.y / FOOT, "Local_Y": t.x / FOOT, "Global_X": t.x / FOOT, "Global_Y": t.y / FOOT,
            "v_length": t.length / FOOT, "v_Width": t.width / FOOT, "v_Class": 2, "v_Vel": 30.0 / FOOT, "Lane_ID": 1,
            "Location": np.where(t.part == 0, "us-101", "i-80"),
        },
        {"x": "Global_X:ft", "y": "Global_Y:ft", "length": "v_length:ft", "width": "v_Width:ft", "speed": "v_Vel:ft/s"},
    ),
    "nuScenes": (
        lambda t: {
            "scene_token": "s" + t.part.astype(str), "instance_token": "i" + t.id.astype(str),
            "timestamp": 1532402927000000 + 100_000 * t.frame, "category_name": "vehicle.car", "translation_x": t.x,
            "translation_y": t.y, "yaw": 0.0, "length": t.length, "width": t.width,
        },
        {"vehicle": "instance_token", "recording": "scene_token", "x": "translation_x", "y": "translation_y",
         "vehicle_class": "category_name"},
    ),
    "Lyft": (
        lambda t: {
            "scene_index": t.part, "track_id": t.id, "timestamp": 1572643684800000000 + 100_000_000 * t.frame,
            "centroid_x": t.x, "centroid_y": t.y, "yaw": 0.0, "extent_x": t.length, "extent_y": t.width,
            "label": "PERCEPTION_LABEL_CAR",
        },
        {"recording": "scene_index", "x": "centroid_x", "y": "centroid_y", "length": "extent_x", "width": "extent_y",
         "vehicle_class": "label"},
    ),
    "inD": (
        lambda t: {
            "recordingId": t.part, "trackId": t.id, "frame": t.frame, "trackLifetime": t.frame, "xCenter": t.x,
            "yCenter": t.y, "heading": 0.0, "width": t.width, "length": t.length, "xVelocity": 30.0, "yVelocity": 0.0,
        },
        {"time": "frame:1/10 s"},
    ),
}  # fmt: skip


@pytest.mark.parametrize("layout", LAYOUTS)
def test_both_recordings_come_in_whole(layout: str, tmp_path: Path) -> None:
    one = traffic("right")
    rows = pd.concat([one.assign(part=0), one.assign(part=1, x=one["x"] + 7.0)], ignore_index=True)
    rows["frame"] = np.round(rows["time"] * 10).astype(np.int64)
    of, columns = LAYOUTS[layout]
    pd.DataFrame(of(rows)).to_csv(tmp_path / "tracks.csv", index=False)
    road = road_file(tmp_path, "right")
    words = [f"{name}={column}" for name, column in columns.items()]
    imported = import_drives("tracks", tmp_path / "tracks.csv", road=road, columns=words)
    assert sum(imported.provenance.rows.values()) == len(rows)
    assert imported.provenance.rows["kept"] > 0.85 * len(rows)
    assert imported.provenance.vehicles == 10 and imported.table["speed"].between(29.0, 31.0).all()
    every = read_recordings(tmp_path / "tracks.csv", road=road, columns=columns)
    assert [len(recording.tracks) for recording in every] == [5, 5]


CLASSES = {
    "car": "TYPE_VEHICLE, REGULAR_VEHICLE, PERCEPTION_LABEL_CAR, vehicle.emergency.ambulance, parkedVehicle, AGENT",
    "truck": "Heavy Vehicle, BOX_TRUCK, TRUCK_CAB, vehicle.truck, LARGE_VEHICLE",
    "bus": "vehicle.bus.bendy, SCHOOL_BUS, ARTICULATED_BUS",
    "bicycle": "TYPE_CYCLIST, riderless_bicycle, WHEELED_DEVICE, PERCEPTION_LABEL_BICYCLE",
    "pedestrian": "human.pedestrian.adult, human.pedestrian.construction_worker, Person_sitting, OFFICIAL_SIGNALER",
    "thing": "movable_object.trafficcone, static_object.bicycle_rack, PERCEPTION_LABEL_DONTCARE, STOP_SIGN, background",
    "": "TYPE_OTHER, PERCEPTION_LABEL_NOT_SET, other_vehicle, TYPE_UNSET",
}


def test_words_of_public_data_sets_are_known() -> None:
    for name, words in CLASSES.items():
        assert {word: class_of(word) for word in words.split(", ")} == dict.fromkeys(words.split(", "), name)
    assert class_of("Zeppelin") is None
