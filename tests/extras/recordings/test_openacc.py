"""OpenACC's AstaZero files: cars with known offsets on a known oval."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from xosc_lateral.base.errors import FormatError, NotEnoughDataError
from xosc_lateral.cli import main
from xosc_lateral.extras.recordings.importers.openacc import import_openacc
from xosc_lateral.files.drives import read_drives

LONG, RADIUS = 600.0, 150.0
LAP = 2.0 * LONG + 2.0 * np.pi * RADIUS


def oval(s: np.ndarray, offset: np.ndarray, turn: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Two straights and two bends, driven counter-clockwise (`turn` 1) or clockwise; offset to the left of travel."""
    s = s % LAP
    bend = np.pi * RADIUS
    first, second = s < LONG, (s >= LONG + bend) & (s < 2 * LONG + bend)
    angle = np.where(s < LONG + bend, (s - LONG) / RADIUS, np.pi + (s - 2 * LONG - bend) / RADIUS)
    angle = np.where(first, 0.0, np.where(second, np.pi, angle))
    x = np.where(first, s, np.where(second, LONG - (s - LONG - bend), np.where(s < LONG + bend, LONG, 0.0)))
    x = x + np.where(first | second, 0.0, RADIUS * np.sin(angle))
    y = np.where(first, 0.0, np.where(second, 2 * RADIUS, RADIUS - RADIUS * np.cos(angle)))
    x, y = x - offset * np.sin(angle), y + offset * np.cos(angle)
    return x, turn * y


def platoon(path: Path, *, turn: int = 1, laps: float = 5.2, head: str = "", phase: float = 0.0) -> np.ndarray:
    """Two cars at 20 m/s that weave with 0.1 Hz and 0.2 m; the offset of the first, to the left of travel."""
    time = np.arange(1.0, laps * LAP / 20.0, 0.1)
    columns: dict[str, np.ndarray] = {"Time": time}
    offsets = []
    for k in (1, 2):
        s = 20.0 * time - 40.0 * k
        offset = 0.2 * np.sin(2.0 * np.pi * (0.1 * time + 0.37 * k) + phase) + 0.1 * (-1) ** k
        x, y = oval(s, turn * offset, turn)
        columns |= {f"Speed{k}": 20.0 + 1e-3 * np.sin(0.7 * np.arange(len(time))), f"E{k}": x, f"N{k}": y}
        offsets.append(offset)
    columns["IVS1"] = np.full(len(time), 35.0)
    text = head + pd.DataFrame(columns).to_csv(index=False)
    path.write_text(text)
    return offsets[0]


@pytest.mark.parametrize("turn", [1, -1])
def test_offsets_are_from_the_mean_path_and_positive_to_the_left(tmp_path: Path, turn: int) -> None:
    head = "Date,04,07,2019\nVehicle_order,a,b\nNumber_of_vehicles,2\nACC,0\nDistance_setting,none\n"
    planted = platoon(tmp_path / "one.csv", turn=turn, head=head)
    platoon(tmp_path / "two.csv", turn=turn, phase=1.5)
    imported = import_openacc([tmp_path / "one.csv", tmp_path / "two.csv"])
    table = imported.table
    assert sorted(table["drive"].unique()) == ["one:1", "one:2", "two:1", "two:2"]
    mine = table[table["drive"] == "one:1"]
    # four cars on twenty passes: the mean path keeps a twentieth of the weave's power, and corners of the oval some mm
    error = mine["offset"].to_numpy() - planted
    assert abs(error.mean()) < 0.01 and error.std() < 0.06
    assert np.corrcoef(mine["offset"], planted)[0, 1] > 0.95
    assert mine["lead_distance"].isna().all()
    assert (table[table["drive"] == "one:2"]["lead_distance"] == 35.0).all()
    bends = np.abs(mine["curvature"].to_numpy())
    assert np.sign(mine["curvature"].to_numpy()[bends > 5e-3]).mean() == turn
    assert np.quantile(bends, 0.9) == pytest.approx(1.0 / RADIUS, rel=0.05)
    assert "CC BY 4.0" in imported.provenance.licence


def test_a_table_says_what_it_shows_and_is_fitted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    platoon(tmp_path / "one.csv")
    table = tmp_path / "drives.csv"
    assert main(["import", "openacc", str(tmp_path / "one.csv"), "-o", str(table), "--lane-width", "3.25"]) == 0
    drives = read_drives(table)
    assert [(drive.valid_below, drive.resolution, drive.lane_width[0]) for drive in drives] == [(1.5, 0.001, 3.25)] * 2
    assert main(["fit", str(table), "-o", str(tmp_path / "p.json")]) == 0
    assert "valid: 0 to 1.5 Hz" in capsys.readouterr().err


def test_files_of_something_else_are_refused_with_their_line(tmp_path: Path) -> None:
    path = tmp_path / "x.csv"
    path.write_text("a,b\n1,2\n")
    with pytest.raises(FormatError, match=r"x.csv:1: no header that begins with Time"):
        import_openacc(path)
    path.write_text("Time,E1,N1\n1,2,3\n")
    with pytest.raises(FormatError, match=r"x.csv:1: no column Speed1"):
        import_openacc(path)
    path.write_text("ACC,1\nTime,Speed1,E1,N1\n1,20,2,3\n2,20,north,3\n")
    with pytest.raises(FormatError, match=r"x.csv:4: column 'E1': no number: 'north'"):
        import_openacc(path)


def test_a_road_without_a_loop_is_refused(tmp_path: Path) -> None:
    platoon(tmp_path / "half.csv", laps=0.6)
    with pytest.raises(NotEnoughDataError, match=r"never comes back to where it was: no closed loop"):
        import_openacc(tmp_path / "half.csv")


def test_rows_whose_speed_stands_frozen_are_left_out_and_counted(tmp_path: Path) -> None:
    platoon(tmp_path / "one.csv")
    frame = pd.read_csv(tmp_path / "one.csv")
    frame.loc[500:599, "Speed1"] = 20.0  # 9.9 s: by chance
    frame.loc[900:1199, "Speed1"] = 20.0
    frame.to_csv(tmp_path / "one.csv", index=False)
    imported = import_openacc(tmp_path / "one.csv")
    assert imported.provenance.rows["speed frozen"] == 300
    first = imported.table[imported.table["drive"] == "one:1"]
    missing = set(frame["Time"].round(6)) - set(first["time"])
    assert missing == set(frame["Time"][900:1200].round(6))
