"""A city's recording: lanes where the traffic drives, which light is whose, counts that add up."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral import import_drives, reconstruct
from xosc_lateral.extras.recordings.importers.dlr_ut import CLASSES, COLUMNS, lanes_of_streams, streams

STEP, STOP, CYCLE = 0.1, 80.0, 60.0  # [s], place of the stop line [m], of the light [s]
START = pd.Timestamp("2023-09-24 12:00:00+00:00")
TURN = 100.0  # where those who turn leave the others [m]


def _line(way: np.ndarray, *, turns: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place and direction along a lane that goes east, or turns to the left with 15 m of radius."""
    after = np.clip(way - TURN, 0.0, 0.5 * np.pi * 15.0) if turns else np.zeros(len(way))
    bend, rest = after / 15.0, np.where(turns, np.maximum(way - TURN - 0.5 * np.pi * 15.0, 0.0), 0.0)
    x = np.where(turns, np.minimum(way, TURN) + 15.0 * np.sin(bend), way)
    return x, np.where(turns, 15.0 * (1.0 - np.cos(bend)) + rest, 0.0), bend


def _vehicle(number: int, begin: float, *, turns: bool) -> pd.DataFrame:
    """Comes at 12 m/s, waits at the line while it is red (in the first half of a cycle), then drives on."""
    rng = np.random.default_rng(number)
    way, speed, rows, time = 0.0, 12.0, [], begin
    while way < 190.0:
        is_red = (time % CYCLE) < 0.5 * CYCLE + 1.0
        wanted = 12.0 if way > STOP or not is_red else min(12.0, np.sqrt(2.0 * 2.5 * max(STOP - 1.0 - way, 0.0)))
        speed = float(np.clip(wanted, speed - 4.0 * STEP, speed + 2.0 * STEP))
        way += speed * STEP
        rows.append((time, way, speed))
        time += STEP
    time_of, way_of, speed_of = np.array(rows).T
    x, y, heading = _line(way_of, turns=turns)
    aside = 0.25 * np.sin(way_of / 25.0 + rng.uniform(0.0, 6.0)) + rng.normal(0.0, 0.1)
    x, y = x - aside * np.sin(heading), y + aside * np.cos(heading)
    table = pd.DataFrame({"time": time_of, "center_easting": x + 6e5, "center_northing": y + 5.79e6, "id": number})
    return table.assign(yaw=np.degrees(heading), velocity_magnitude=speed_of, kind="car", aside=aside)


@pytest.fixture(scope="module")
def data_set(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, pd.DataFrame]:
    path = tmp_path_factory.mktemp("city") / "DLR-Urban-Traffic.zip"
    return path, write_city(path)


def write_city(path: Path) -> pd.DataFrame:
    """A data set as it is published, and its rows with the truth."""
    made = [_vehicle(k, 20.0 * k + 3.0, turns=k % 2 == 1) for k in range(24)]
    walker = made[0].assign(id=99, kind="pedestrian", center_northing=5.79e6 + 30.0)
    rows = pd.concat([*made, walker], ignore_index=True)
    table = rows.assign(timestamp=START + pd.to_timedelta(rows["time"], unit="s"))
    table = table.assign(dimension_length=4.5, dimension_width=1.8, dimension_height=1.5)
    for name in CLASSES:
        table[f"classifications_{name}"] = (table["kind"] == name).astype(float)
    clock = np.arange(0.0, 560.0, 0.5)
    lights = [
        pd.DataFrame({"time": clock, "id": name, "state": np.where((clock + late) % CYCLE < 0.5 * CYCLE, 3, 5)})
        for name, late in ((3, 0.0), (8, 17.0))
    ]
    light = pd.concat(lights).assign(timestamp=lambda one: START + pd.to_timedelta(one["time"], unit="s"))
    every = START + pd.to_timedelta(np.arange(0.0, 560.0, 10.0), unit="s")
    weather = pd.DataFrame({"timestamp": every, "wind_speed": 3.0, "visibility": 2e4, "rain_intensity": np.nan})
    with zipfile.ZipFile(path, "w") as archive:
        for kind, part in {
            "trajectories": table[list(COLUMNS)],
            "traffic_lights": light[["timestamp", "id", "state"]],
            "weather": weather,
            "road_condition": pd.DataFrame({"timestamp": every, "surface_grip": 0.8}),
        }.items():
            archive.writestr(f"x/raw_data/{kind}/{kind}_1.csv", part.to_csv(index=False))
    return rows


def test_tracks_lie_in_the_lanes_of_their_traffic_and_know_their_light(data_set: tuple[Path, pd.DataFrame]) -> None:
    path, rows = data_set
    made = import_drives("dlr-ut", path)
    assert sum(made.provenance.rows.values()) == len(rows)
    assert made.provenance.rows["pedestrian"] == (rows["id"] == 99).sum()
    table = made.table
    assert table["speed"].min() < 0.5 and table["speed"].max() > 11.0
    truth = rows.set_index([rows["id"].astype(str), (rows["time"] - 3.0).round(1)])["aside"]
    true = truth.reindex(pd.MultiIndex.from_arrays([table["drive"], table["time"].round(1)])).to_numpy()
    straight = table["curvature"].abs().to_numpy() < 1e-3
    assert (
        np.nanmean(np.abs(table["offset"].to_numpy() - true)[straight]) < 0.1
    )  # the mean of twelve drivers is no line
    known = table["signal_go"].notna()
    assert known.mean() > 0.2
    when = table["time"] + 3.0
    np.testing.assert_array_equal(table["signal_go"][known], (when % CYCLE >= 0.5 * CYCLE)[known].astype(float))
    assert set(table["friction"]) == {0.8} and "rain" not in table


def test_streams_that_part_are_one_lane_till_there(data_set: tuple[Path, pd.DataFrame]) -> None:
    rows = data_set[1]
    rows = rows[rows["id"] < 99].sort_values(["id", "time"])
    found = streams(
        *(rows[name].to_numpy() for name in ("center_easting", "center_northing", "velocity_magnitude", "id"))
    )
    lanes, following = lanes_of_streams(found)
    assert len(found) == 2 and len(lanes) == 3
    (first,) = (k for k, onward in enumerate(following) if len(onward) == 2)
    assert 95.0 < len(lanes[first]) < 125.0


def test_a_city_is_reconstructed(data_set: tuple[Path, pd.DataFrame]) -> None:
    made = reconstruct(data_set[0], format="dlr-ut", begin=100.0, end=200.0).to_dict()
    assert made["summary"]["vehicles"] >= 4 and made["summary"]["along_p95"] < 0.5
