"""Bus logs through asammdf; the log is written by asammdf itself."""

from __future__ import annotations

import sys
import warnings
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.extras.recordings.importers.mf4 import channel_names, import_mf4, read_channels


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """50 Hz distances to the markings in cm, 10 Hz speed in km/h, with a camera dropout of 3 s."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # asammdf's own imports
        asammdf = pytest.importorskip("asammdf", reason="extra `mdf` is not installed")
    fast, slow = np.arange(0, 60, 0.02), np.arange(0, 60, 0.1)
    fast = fast[(fast < 30) | (fast > 33)]
    sway = 0.3 * np.sin(2 * np.pi * fast / 10)
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append(
            [
                asammdf.Signal(100 * (1.8 - sway), fast, name="LnLeft"),
                asammdf.Signal(100 * (1.8 + sway), fast, name="LnRight"),
            ]
        )
        mdf.append([asammdf.Signal(np.full(len(slow), 108.0), slow, name="VehSpd")])
        mdf.save(tmp_path / "drive7.mf4", overwrite=True)
    return tmp_path / "drive7.mf4"


MAP = ["distance_left=LnLeft:cm", "distance_right=LnRight:cm", "speed=VehSpd:km/h"]


@pytest.mark.filterwarnings("default")
def test_channels_come_back_in_standard_units(log):
    table = import_mf4(log, MAP, step=0.04).table
    assert table["speed"].to_numpy() == pytest.approx(30.0)
    assert (table["distance_left"] + table["distance_right"]).to_numpy() == pytest.approx(3.6)
    offset = 0.5 * (table["distance_right"] - table["distance_left"])
    assert offset.to_numpy() == pytest.approx(0.3 * np.sin(2 * np.pi * table["time"].to_numpy() / 10), abs=1e-3)
    assert not table["time"].between(30.1, 32.9).any(), "a dropout is a gap, not a straight line"
    assert set(table["drive"]) == {"drive7"}


@pytest.mark.filterwarnings("default")
def test_a_channel_that_is_not_there_is_named(log):
    with pytest.raises(FormatError, match=r"drive7\.mf4: speed: no channel V"):
        import_mf4(log, [*MAP[:2], "speed=V"])


@pytest.mark.filterwarnings("default")
def test_without_a_channel_map_the_verb_says_what_to_map_and_which_channels_there_are(log, capsys):
    assert main(["import", "mf4", str(log), "-o", str(log.with_name("t.csv"))]) == 2
    said = " ".join(capsys.readouterr().err.replace("│", " ").split())
    assert "--map distance_left=CHANNEL[:UNIT]" in said
    assert "drive7.mf4 has 3 channels: LnLeft, LnRight, VehSpd" in said
    assert not log.with_name("t.csv").exists()


@pytest.mark.filterwarnings("default")
def test_half_a_channel_map_is_told_what_it_lacks(log):
    with pytest.raises(
        FormatError, match=r"distance_right=CHANNEL.* 3 channels: LnLeft.*; mapped: distance_left, speed"
    ):
        import_mf4(log, [MAP[0], MAP[2]])


@pytest.mark.filterwarnings("default")
def test_a_file_that_is_no_log_is_refused_with_and_without_a_map(log, capsys):
    bad = log.with_name("bad.mf4")
    for content in (b"", b"no log at all"):
        bad.write_bytes(content)
        for channels in ([], [word for name in MAP for word in ("--map", name)]):
            assert main(["import", "mf4", str(bad), *channels, "-o", str(log.with_name("t.csv"))]) == 1
            assert "not an MDF file" in capsys.readouterr().err


def test_without_asammdf_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(FormatError, match=r"xosc-lateral\[mdf\]"):
        read_channels.__wrapped__(tmp_path / "a.mf4", {}, None)


@pytest.mark.filterwarnings("default")
@pytest.mark.parametrize(
    ("formula", "what"),
    [
        ("2*X1+1", ""),
        ("__import__('os').system('touch planted')+X1*0", "not known"),
        ("X1*0+9**9**9**9", "has 0 values"),
        ("X1.__class__", "not known"),
    ],
)
def test_formulas_of_a_log_are_arithmetic_or_refused(formula, what, tmp_path, monkeypatch):
    asammdf = pytest.importorskip("asammdf", reason="extra `mdf` is not installed")
    monkeypatch.chdir(tmp_path)
    time = np.arange(0, 60, 0.04)
    with asammdf.MDF(version="4.10") as mdf:
        off = asammdf.Signal(0.1 * np.sin(time), time, name="Off", unit="m", conversion={"formula": formula})
        mdf.append([off, asammdf.Signal(3.5 + 0 * time, time, name="Wid", unit="m")])
        mdf.save(tmp_path / "log.mf4", overwrite=True)
    read = partial(import_mf4, tmp_path / "log.mf4", ["offset=Off", "lane_width=Wid"])
    if what:
        with pytest.raises(FormatError, match=what):
            read()
    else:
        table = read().to_frame()
        np.testing.assert_allclose(table["offset"], 1 + 0.2 * np.sin(table["time"]), atol=1e-9)
    assert not (tmp_path / "planted").exists()


@pytest.mark.filterwarnings("default")
def test_a_log_whose_blocks_unpack_without_bound_is_refused(tmp_path):
    asammdf = pytest.importorskip("asammdf", reason="extra `mdf` is not installed")
    time = np.arange(10_000_000) * 1e-3
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([asammdf.Signal(0.0 * time, np.zeros(len(time)), name="Off")])
        mdf.save(tmp_path / "bomb.mf4", overwrite=True, compression=2)
    assert (tmp_path / "bomb.mf4").stat().st_size < 700_000
    with pytest.raises(FormatError, match="decompression bomb"):
        channel_names(tmp_path / "bomb.mf4")


@pytest.fixture
def bus(tmp_path: Path) -> Path:
    """Distances in cm, speed in km/h (units in the file), lane index and flag at 2 Hz, road state in words."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # asammdf's own imports
        asammdf = pytest.importorskip("asammdf", reason="extra `mdf` is not installed")
    fast, slow = np.arange(0, 60, 0.02), np.arange(0, 60, 0.5)
    with asammdf.MDF(version="4.10") as mdf:
        for name, values, unit in (("LnMrkLe_Dist", 180.0, "cm"), ("LnMrkRi_Dist", 170.0, "cm")):
            mdf.append([asammdf.Signal(np.full(len(fast), values), fast, name=name, unit=unit)])
        mdf.append([asammdf.Signal(np.full(len(slow), 108, dtype=np.uint8), slow, name="VehSpd", unit="Km/h")])
        mdf.append([asammdf.Signal(np.full(len(slow), 12.0), slow, name="Strg", unit="°")])
        mdf.append([asammdf.Signal((slow >= 30).astype(np.uint8), slow, name="LaneIdx")])
        mdf.append([asammdf.Signal(slow >= 20.25, slow, name="Rain_Flg")])
        words = np.where(slow < 40, b"DRY", b"WET")
        mdf.append([asammdf.Signal(words, slow, name="RoadState", encoding="utf-8")])
        mdf.save(tmp_path / "bus.mf4", overwrite=True)
    return tmp_path / "bus.mf4"


BUS = ["distance_left=LnMrkLe_Dist", "distance_right=LnMrkRi_Dist", "speed=VehSpd"]


@pytest.mark.filterwarnings("default")
def test_units_in_the_file_count_unless_the_map_names_another(bus):
    table = import_mf4(bus, [*BUS, "steering_wheel_angle=Strg"]).table
    assert table["distance_left"].to_numpy() == pytest.approx(1.8)
    assert table["speed"].to_numpy() == pytest.approx(30.0)
    assert table["steering_wheel_angle"].to_numpy() == pytest.approx(np.radians(12.0))
    assert import_mf4(bus, [*BUS[:2], "speed=VehSpd:mph"]).table["speed"].to_numpy() == pytest.approx(108 * 0.44704)


@pytest.mark.filterwarnings("default")
def test_a_unit_of_something_else_is_refused_with_what_to_write(bus):
    with pytest.raises(FormatError, match=r"Strg is in '°': speed is held in m/s.*--map speed=Strg:UNIT"):
        import_mf4(bus, [*BUS[:2], "speed=Strg"])


@pytest.mark.filterwarnings("default")
def test_indices_flags_and_words_keep_their_values(bus, tmp_path):
    from xosc_lateral.files.drives import read_drives

    imported = import_mf4(bus, [*BUS, "lane_index=LaneIdx", "wiper=Rain_Flg", "surface=RoadState"])
    table = imported.table
    assert set(table["lane_index"]) == {0.0, 1.0} and set(table["wiper"]) == {0.0, 1.0}
    assert set(table["surface"]) == {"DRY", "WET"}
    assert table.loc[table["lane_index"] == 1, "time"].min() == pytest.approx(29.76, abs=0.021), "half a sample before"
    replace(imported, sources=(bus,)).write(tmp_path / "t.parquet")
    (drive,) = read_drives(tmp_path / "t.parquet")
    assert {"lane_index", "wiper", "surface=DRY", "surface=WET"} <= drive.levels
    assert drive.context["surface=WET"][drive.time > 40].min() == 1.0


@pytest.mark.filterwarnings("default")
def test_a_missing_channel_brings_up_the_like_of_it(bus):
    with pytest.raises(FormatError, match=r"no channel lnmrkle_dst; like it are LnMrkLe_Dist"):
        import_mf4(bus, ["distance_left=lnmrkle_dst", *BUS[1:]])


@pytest.mark.filterwarnings("default")
def test_several_logs_in_one_call_are_several_drives(bus, tmp_path, capsys):
    other = tmp_path / "second.mf4"
    other.write_bytes(bus.read_bytes())
    words = [word for name in BUS for word in ("--map", name)]
    assert main(["import", "mf4", str(bus), str(other), *words, "-o", str(tmp_path / "t.parquet")]) == 0
    import pandas as pd

    table = pd.read_parquet(tmp_path / "t.parquet")
    assert table.groupby("drive").size().to_dict() == {"bus": 1500, "second": 1500}
    assert main(["import", "mf4", str(bus), str(bus), *words, "-o", str(tmp_path / "t.parquet")]) == 1
    assert "named twice" in capsys.readouterr().err
