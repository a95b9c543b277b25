"""Bus logs with known truth: nothing is made up where a channel is not continuous, and nothing folds back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.kit.recordings import WIDTH, write_mf4
from xosc_lateral import import_drives
from xosc_lateral.base.errors import FormatError
from xosc_lateral.drivers.drives.drive import cut_runs
from xosc_lateral.extras.recordings.importers import ImportedDrives
from xosc_lateral.extras.recordings.importers.mf4 import import_mf4
from xosc_lateral.files.drives import drives_of_table

pytest.importorskip("asammdf", reason="extra `mdf` is not installed")
pytestmark = pytest.mark.filterwarnings("default")

OFFSET = ["offset=Lat", "lane_width=Width", "speed=V:m/s"]
SIDES = ["distance_left=L", "distance_right=R", "speed=V:m/s"]


def across(time: np.ndarray) -> np.ndarray:
    """Place from the right lane's centre: sways, and moves over to the left lane at 30 s. [m]"""
    return 0.2 * np.sin(2 * np.pi * time / 9.0) - 0.1 + WIDTH / (1 + np.exp(-(time - 30.0) / 0.7))


def in_lane(time: np.ndarray) -> np.ndarray:
    """Offset in the lane that the vehicle is in. [m]"""
    place = across(time)
    return np.where(place > 0.5 * WIDTH, place - WIDTH, place)


def log(folder: Path, rate: float, kind: str, missing: tuple[float, float] = (-1.0, -1.0), late: float = 0.0) -> Path:
    """60 s of a camera at some rate; the right side comes later by a part of the step."""
    time = np.arange(int(60 * rate)) / rate
    time = time[(time < missing[0]) | (time >= missing[1])]
    steady = np.arange(0.0, 60.0, 0.1)
    speed = {"V": (steady, np.full(len(steady), 30.0), "m/s")}
    if kind == "offset":
        signals = {"Lat": (time, 100 * in_lane(time), "cm"), "Width": (time, np.full(len(time), WIDTH), "m")}
    else:
        second = time + late
        signals = {
            "L": (time, 0.5 * WIDTH - in_lane(time), "m"), "R": (second, 0.5 * WIDTH + in_lane(second), "m"),
        }  # fmt: skip
    return write_mf4(folder / "log.mf4", signals | speed)


@pytest.mark.parametrize("missing", [(-1.0, -1.0), (29.7, 30.5), (12.0, 12.4), (12.0, 14.0)])
@pytest.mark.parametrize("kind", ["offset", "sides", "sides apart"])
@pytest.mark.parametrize("rate", [5.0, 10.0, 12.5, 50.0])
def test_no_row_lies_where_the_vehicle_never_was(rate, kind, missing, tmp_path) -> None:
    late = 0.6 / rate if "apart" in kind else 0.0
    path = log(tmp_path, rate, kind.split()[0], missing, late)
    table = import_mf4(path, OFFSET if kind == "offset" else SIDES).table
    (drive,) = drives_of_table(table, {}, path)
    true = in_lane(drive.time + late)  # the table begins where both sides are known
    aside = np.abs(np.abs(drive.offset - true) - WIDTH) < 0.3  # which of two lanes it is near the marking
    far = np.abs(drive.time + late - 30.0) > 0.5 + 1.0 / rate
    np.testing.assert_allclose(drive.offset[~aside], true[~aside], atol=0.12)
    assert not (aside & far).any()
    assert np.abs(drive.lane_width - WIDTH).max() < 0.13
    runs = cut_runs(drive)
    bridged = missing[1] - missing[0] + 1.0 / rate <= 0.5 + 1e-9
    assert len(runs) == (2 if bridged or missing[0] > 29 else 3)
    for run in runs:
        np.testing.assert_allclose(run.offset, in_lane(run.time + late), atol=0.05)


def test_what_a_channel_never_said_is_not_made_up(tmp_path) -> None:
    time, part = np.arange(0.0, 60.0, 0.04), np.arange(20.0, 40.0, 0.1)
    part = part[(part < 25) | (part > 30)]
    path = write_mf4(tmp_path / "a.mf4", {
        "Lat": (time, 0.0 * time, "m"), "Width": (time, WIDTH + 0.0 * time, "m"),
        "V": (part, 20.0 + part, "m/s"), "T": (np.arange(5.0, 55.0, 10.0), np.arange(5.0), "-"),
    })  # fmt: skip
    found = import_mf4(path, [*OFFSET, "temperature=T"])
    kept = found.table["time"]
    assert kept.min() >= 19.9 - 1e-9 and kept.max() <= 40.0 and not kept.between(25.15, 29.9).any()
    np.testing.assert_allclose(found.table["speed"], 20.0 + kept, atol=0.12)
    assert found.provenance.rows["no speed"] > 1000
    bare = import_mf4(path, [*OFFSET[:2], "temperature=T"])
    known = bare.table["temperature"].notna()
    assert bare.table["time"][known].min() >= 4.4 and bare.table["time"][known].max() <= 45.6
    assert "temperature is known in 68 % of the time" in " ".join(bare.provenance.notes)


def test_what_is_faster_than_the_table_does_not_fold_back(tmp_path) -> None:
    time = np.arange(0.0, 120.0, 0.01)
    signals = {"Width": (time, WIDTH + 0.0 * time, "m")}
    hum = 0.1 * np.sin(2 * np.pi * 41.0 * time)  # 100 Hz into 25 Hz: 9 Hz; into 40 Hz: 1 Hz
    noise = np.random.default_rng(1).normal(0.0, 0.1, len(time))
    for values, spread in ((hum, 0.0005), (noise, 0.1 * np.sqrt(4.0 / 100.0))):
        path = write_mf4(tmp_path / "a.mf4", signals | {"Lat": (time, values, "m")})
        (run,) = cut_runs(drives_of_table(import_mf4(path, OFFSET[:2]).table, {}, path)[0])
        assert run.offset.std() == pytest.approx(spread, rel=0.1, abs=5e-4)


def test_channels_of_one_name_are_named_and_refused_where_they_differ(tmp_path) -> None:
    time = np.arange(0.0, 30.0, 0.04)
    base = {"Lat": (time, 0.1 * np.sin(time), "m"), "Width": (time, WIDTH + 0.0 * time, "m")}

    def read(other: np.ndarray, words: str = "V:m/s") -> ImportedDrives:
        speed = 20.0 + 0.1 * time
        signals = base | {"V": (time, speed, "m/s"), "V#2": (time[::2], other[::2], "m/s")}
        return import_mf4(write_mf4(tmp_path / "a.mf4", signals), [*OFFSET[:2], f"speed={words}"])

    assert "channel V is in several groups (V@2, V@3)" in " ".join(read(20.0 + 0.1 * time).provenance.notes)
    with pytest.raises(FormatError, match="in several groups, which differ: name one of V@2, V@3"):
        read(15.0 + 0.1 * time)
    assert read(15.0 + 0.1 * time, "V@3:m/s").table["speed"].max() < 18.1


def test_markers_and_missing_units_are_said(tmp_path) -> None:
    time = np.arange(0.0, 30.0, 0.04)
    bad = np.where(np.arange(len(time)) % 50 == 7, -9999.0, 0.1 * np.sin(time))
    path = write_mf4(tmp_path / "a.mf4", {
        "Lat": (time, bad, "m"), "Width": (time, WIDTH + 0.0 * time, ""), "V": (time, 30.0 + 0.0 * time, ""),
    })  # fmt: skip
    with pytest.raises(FormatError, match=r"missing = \[-9999\]"):
        import_mf4(path, ["offset=Lat", "lane_width=Width", "speed=V"])
    (tmp_path / "m.toml").write_text("missing = [-9999]")
    found = import_drives(
        "mf4", path, channels=["offset=Lat", "lane_width=Width", "speed=V"], mapping=tmp_path / "m.toml"
    )
    np.testing.assert_allclose(found.table["offset"], 0.1 * np.sin(found.table["time"]), atol=1e-3)
    assert "speed: channel V has no unit, m/s is taken" in found.provenance.notes
