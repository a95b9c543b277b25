"""The board on what a user has: other recordings through the importers, openpilot-like tables; small made files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from laboratory.board.__main__ import main as board
from tests.kit.runs import smooth_runs
from xosc_lateral.cli import main

MODELS = ["--model", "lane-centre", "--model", "gaussian-process", "--no-classify", "--resamples", "10"]


def _board(table: Path, out: Path, *more: str) -> dict:
    board([str(table), "-o", str(out), *MODELS, *more])
    return json.loads((out / "board.json").read_text())


def test_a_highd_recording_goes_through_the_importer_onto_the_board(tmp_path: Path) -> None:
    folder = tmp_path / "highd"
    folder.mkdir()
    runs, time = smooth_runs(16, 40.0), np.arange(0.0, 40.0, 0.04)
    tracks = [
        pd.DataFrame(
            {
                "frame": np.arange(1, len(time) + 1),
                "id": number,
                "x": 90.0 * number + 30.0 * time,
                "y": 26.0 - np.interp(time, run.time, run.offset) - 0.9,  # y points down, travel is along +x
                "width": 4.5,
                "height": 1.8,
                "xVelocity": 30.0,
                "xAcceleration": 0.0,
            }
        )
        for number, run in enumerate(runs, start=1)
    ]
    numbers = range(1, len(runs) + 1)
    pd.concat(tracks).to_csv(folder / "01_tracks.csv", index=False)
    meta = pd.DataFrame({"id": numbers, "class": "Car", "drivingDirection": 2})
    meta.to_csv(folder / "01_tracksMeta.csv", index=False)
    marks = {"upperLaneMarkings": ["8.0;12.0;16.0"], "lowerLaneMarkings": ["20.0;24.0;28.0"]}
    pd.DataFrame({"id": [1], "frameRate": [25], **marks}).to_csv(folder / "01_recordingMeta.csv", index=False)
    table = tmp_path / "highd.parquet"
    assert main(["import", "levelx", str(folder), "-o", str(table), "-q"]) == 0
    record = _board(table, tmp_path / "out")
    assert record["data"]["drives"] == 16
    assert [one["name"] for one in record["models"]] == ["gaussian-process", "lane-centre"]


def test_an_openpilot_like_table_is_mapped_and_one_long_drive_is_enough(tmp_path: Path) -> None:
    """Distances to both lane lines as a camera gives them, speed in km/h, a flag for the assist."""
    (run,) = smooth_runs(1, 1500.0)
    table = tmp_path / "route.csv"
    pd.DataFrame(
        {
            "time": run.time,
            "laneLineLeft": 1.85 - run.offset,
            "laneLineRight": 1.85 + run.offset,
            "vEgo": 108.0,
            "latActive": (run.time % 300.0 < 150.0).astype(int),
        }
    ).to_csv(table, index=False)
    words = ["--map", "distance_left=laneLineLeft", "--map", "distance_right=laneLineRight", "--map", "speed=vEgo:km/h"]
    record = _board(table, tmp_path / "out", *words)
    assert record["data"]["unit"] == "block of 120 s"
    assert record["models"][0]["name"] == "gaussian-process"
    assert record["data"]["variance_m2"]["inside"] == pytest.approx(0.15**2, rel=0.5)
