"""Faults that the machine of recordings found: read rightly, or refused with the option that mends them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from tests.kit import recordings as kit
from tests.kit.generated.layouts import LAYOUTS, write
from xosc_lateral import FormatError, import_drives, read_drives

CASE = kit.Case(duration=20.0)


@pytest.fixture(scope="module")
def tracks() -> pd.DataFrame:
    return CASE.tracks().assign(speed=kit.SPEED, width=2.0)


def read(table: pd.DataFrame, folder: Path, **options: object) -> pd.DataFrame:
    table.to_csv(folder / "t.csv", index=False)
    return import_drives("tracks", folder / "t.csv", road=kit.road_file(CASE, folder), **options).table


def test_frames_beside_a_speed_and_headings_of_a_compass_are_named_and_mended(
    tracks: pd.DataFrame, tmp_path: Path
) -> None:
    true = read(tracks, tmp_path)
    compass = (90.0 - np.degrees(tracks["heading"])) % 360.0
    for bent, option in (
        (tracks.assign(time=np.round(25.0 * tracks["time"])), {"time": "time:1/25 s"}),
        (tracks.assign(heading=compass), {"heading": "heading:compass"}),
    ):
        ((name, source),) = option.items()
        with pytest.raises(FormatError, match=f"{name}=COLUMN:{source.partition(':')[2]}"):
            read(bent, tmp_path)
        np.testing.assert_allclose(read(bent, tmp_path, columns=option)["offset"], true["offset"], atol=1e-6)


def test_velocities_are_speeds_where_there_is_none(tracks: pd.DataFrame, tmp_path: Path) -> None:
    noise = 0.05 * np.random.default_rng(1).normal(size=(2, len(tracks)))
    bent = tracks.assign(x=tracks["x"] + noise[0], y=tracks["y"] + noise[1]).drop(columns="speed")
    found = read(
        bent.assign(vx=kit.SPEED * np.cos(tracks["heading"]), vy=kit.SPEED * np.sin(tracks["heading"])), tmp_path
    )
    np.testing.assert_allclose(found["speed"], kit.SPEED, atol=1e-6)


def test_ind_and_its_like_are_read_with_their_road(tracks: pd.DataFrame, tmp_path: Path) -> None:
    path = write(LAYOUTS["rounD"], tracks, tmp_path)
    with pytest.raises(FormatError, match="give its road with `road`"):
        import_drives("levelx", path)
    made = import_drives("levelx", path, road=kit.road_file(CASE, tmp_path))
    car = made.table[made.table["drive"] == "ind-00-1"]
    np.testing.assert_allclose(car["offset"], kit.sway(car["time"].to_numpy()), atol=1e-6)
    assert made.provenance.format == "levelx inD"


def test_a_recording_that_is_mostly_beside_its_lanes_is_told(tracks: pd.DataFrame, tmp_path: Path) -> None:
    tracks.assign(y=tracks["y"] + np.where(tracks["id"] == "car", 0.0, 50.0)).to_csv(tmp_path / "t.csv", index=False)
    made = import_drives("tracks", tmp_path / "t.csv", road=kit.road_file(CASE, tmp_path))
    assert any("of the rows lie in no lane" in note for note in made.notes)


def test_tables_with_decimal_commas_are_imported_and_distances_in_cm_are_no_minutes(tmp_path: Path) -> None:
    table = kit.fleet_table(CASE)
    table.map(lambda one: f"{one:.6f}".replace(".", ",")).to_csv(tmp_path / "t.csv", index=False, sep=";")
    np.testing.assert_allclose(import_drives("table", tmp_path / "t.csv").table["offset"], table["offset"], atol=1e-6)
    fast = kit.fleet_table(kit.Case(rate=50.0))
    side = {"left": -1.0, "right": 1.0}
    cm = {f"distance_{name}": 100.0 * (1.75 + sign * fast["offset"]) for name, sign in side.items()}
    fast.drop(columns=["offset", "lane_width"]).assign(**cm).to_csv(tmp_path / "cm.csv", index=False)
    with pytest.raises(FormatError, match="distance_left=COLUMN:cm distance_right=COLUMN:cm"):
        read_drives(tmp_path / "cm.csv")


def test_one_distance_and_the_width_are_an_offset(tmp_path: Path) -> None:
    table = kit.fleet_table(CASE)
    left = table.assign(distance_left=0.5 * table["lane_width"] - table["offset"]).drop(columns="offset")
    left.to_csv(tmp_path / "t.csv", index=False)
    (drive,) = read_drives(tmp_path / "t.csv")
    np.testing.assert_allclose(drive.offset, table["offset"], atol=1e-9)
