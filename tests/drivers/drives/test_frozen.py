"""Cameras that repeat themselves, distances from the wheels, town speeds: said or refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.drivers.drives.cleaning import frozen_rows
from xosc_lateral.files.drives import drives_of_table, read_drives

WIDTH = 3.5


def measured(seed: int = 1, rate: float = 25.0, digits: int = 9, repeat: int = 1, frozen: float = 0.0) -> pd.DataFrame:
    """5 min; frozen from 100 s on for a while."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 300.0, 1.0 / rate)
    offset = 0.2 * np.sin(2 * np.pi * time / 13.0) + rng.normal(0.0, 0.01, len(time)) + 0.1
    width = WIDTH + rng.normal(0.0, 0.01, len(time))
    table = pd.DataFrame({"time": time, "offset": offset.round(digits), "lane_width": width.round(digits)})
    table = table.iloc[np.arange(len(time)) // repeat * repeat].assign(time=time).reset_index(drop=True)
    held = (time >= 100.0) & (time < 100.0 + frozen)
    if held.any():
        table.loc[held, ["offset", "lane_width"]] = table.loc[
            np.flatnonzero(held)[0], ["offset", "lane_width"]
        ].to_numpy()
    return table


@pytest.mark.parametrize("frozen", [0.0, 3.0, 10.0])
@pytest.mark.parametrize(("digits", "repeat", "rate"), [(9, 1, 25.0), (2, 1, 25.0), (2, 5, 50.0), (1, 1, 25.0)])
def test_a_frozen_stretch_is_found_and_nothing_else(frozen, digits, repeat, rate) -> None:
    table = measured(rate=rate, digits=digits, repeat=repeat, frozen=frozen)
    found = frozen_rows(*(table[name].to_numpy() for name in ("time", "offset", "lane_width")))
    time = table["time"]
    if digits == 1 and frozen < 10.0:  # 10 cm are the same for long, unless it is very long
        assert not found[(time < 90) | (time > 120)].any()
        return
    held = (time > 100.0) & (time < 100.0 + frozen)
    assert found[held].mean() > 0.95 if frozen else not found.any()
    assert not found[(time < 99.0) | (time > 101.0 + frozen)].any()


def test_made_drives_that_stand_still_are_no_frozen_cameras() -> None:
    time = np.arange(0.0, 60.0, 0.1)
    for offset in (0.0 * time, np.where(time < 30.0, 0.0, 0.3)):
        assert not frozen_rows(time, offset, WIDTH + 0.0 * time).any()


@pytest.mark.pages
def test_fit_says_what_was_measured_and_what_it_used(tmp_path: Path, capsys) -> None:
    table = measured(frozen=10.0).assign(speed=np.linspace(25.0, 35.0, 7500), driver="anna")
    for name, sign in (("d", 1.0), ("turned", -1.0)):
        table.assign(offset=sign * table["offset"]).to_csv(tmp_path / f"{name}.csv", index=False)
        assert main(["fit", str(tmp_path / f"{name}.csv"), "-o", str(tmp_path / f"{name}.json")]) == 0
    right, left = capsys.readouterr().err.split("turned: ")[::-1]
    assert "0.10 m left of the lane's centre on average, spread 0.14 m, lanes 3.50 m wide, 92 to 124 km/h" in left
    assert "0.10 m right of the lane's centre" in right
    assert "used: 0.08 of 0.08 h of 1 driver; rows left out: 249 frozen" in left


def test_distances_from_the_wheels_are_refused_or_put_to_the_middle(tmp_path: Path) -> None:
    table = measured()
    sides = pd.DataFrame({"time": table["time"], "distance_left": 0.5 * WIDTH - table["offset"] - 0.8,
                          "distance_right": 0.5 * WIDTH + table["offset"] - 0.8})  # fmt: skip
    sides.to_csv(tmp_path / "d.csv", index=False)
    with pytest.raises(FormatError, match=r"lanes of 1.90 m.*wheels.*wheel_track = 1.6"):
        read_drives(tmp_path / "d.csv")
    (tmp_path / "m.toml").write_text("wheel_track = 1.6")
    (drive,) = read_drives(tmp_path / "d.csv", tmp_path / "m.toml")
    np.testing.assert_allclose(drive.offset, table["offset"], atol=1e-9)
    np.testing.assert_allclose(drive.lane_width, WIDTH)


def test_a_town_in_kilometres_an_hour_is_refused() -> None:
    table = measured().assign(speed=54.0)
    with pytest.raises(FormatError, match=r"speed': is 54 m/s.*if it is in km/h"):
        drives_of_table(table, {})


def test_columns_of_another_rate_are_bridged_and_long_absences_stay() -> None:
    """As bus logs are joined: rows of the camera, and rows of a slower bus in between."""
    table = measured()
    slow = pd.DataFrame({"time": np.arange(0.005, 300.0, 0.1)}).assign(
        speed=lambda rows: 25.0 + 0.01 * rows["time"], lead=lambda rows: 50.0 - 0.1 * rows["time"]
    )
    slow.loc[(slow["time"] > 120.0) & (slow["time"] < 130.0), "lead"] = np.nan
    joined = pd.concat([table, slow]).sort_values("time", kind="stable", ignore_index=True)
    (drive,) = drives_of_table(joined, {})
    assert len(drive) > 0.99 * len(table)
    np.testing.assert_allclose(drive.context["speed"], 25.0 + 0.01 * drive.time, atol=1e-6)
    away = np.isnan(drive.context["lead"])
    assert away[(drive.time > 120.1) & (drive.time < 129.9)].all()
    assert not away[(drive.time > 0.1) & (drive.time < 119.9)].any()


def test_a_distance_that_counts_the_other_way_is_refused_with_the_sign() -> None:
    table = measured()
    sides = pd.DataFrame({"time": table["time"], "distance_left": 1.75 - table["offset"],
                          "distance_right": -1.75 - table["offset"]})  # fmt: skip
    with pytest.raises(FormatError, match="distance_right=COLUMN:-m"):
        drives_of_table(sides, {})
