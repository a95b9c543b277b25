"""`fit` and `sample` as a user calls them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from examples.driver_simulator import simulate_drive
from xosc_lateral.cli import main


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("drives") / "drive.parquet"
    pd.DataFrame(simulate_drive(600.0, 3).table).to_parquet(path)
    return path


@pytest.fixture(scope="module", params=["two-level", "best"])
def profile(request: pytest.FixtureRequest, measured: Path) -> Path:
    path = measured.with_name(f"{request.param}.json")
    assert main(["fit", str(measured), "-o", str(path), "--model", request.param]) == 0
    return path


def test_fit_writes_the_same_bytes_again(measured: Path, profile: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.json"
    assert main(["fit", str(measured), "-o", str(again), "--model", profile.stem, "--name", profile.stem]) == 0
    assert again.read_bytes() == profile.read_bytes()
    provenance = json.loads(profile.read_text())["provenance"]
    assert list(provenance["inputs"]) == ["drive.parquet"]
    assert provenance["hours"] > 0.1


def test_sample_like_gives_a_snippet_for_each_real_one(measured: Path, profile: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.parquet"
    words = ["sample", "--profile", str(profile), "--like", str(measured), "--snippet", "10", "--seed", "1"]
    assert main([*words, "-o", str(out)]) == 0
    rows = pd.read_parquet(out)
    assert list(rows.columns) == [
        "drive",
        "snippet",
        "time",
        "offset",
        "offset_real",
        "lane_width",
        "speed",
        "following_run",
    ]
    assert set(rows.groupby(["drive", "snippet"]).size()) == {51}
    first = rows.groupby(["drive", "snippet"]).first()
    assert np.allclose(first["offset"], first["offset_real"])
    again = tmp_path / "again.parquet"
    assert main([*words, "-o", str(again)]) == 0
    assert again.read_bytes() == out.read_bytes()


def test_sample_context_gives_one_free_run_and_its_provenance(measured: Path, profile: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    assert main(["sample", "-p", str(profile), "--context", str(measured), "--seed", "4", "-o", str(out)]) == 0
    rows = pd.read_csv(out)
    assert list(rows.columns) == ["drive", "time", "offset", "lane_width", "speed", "following_run"]
    assert 2000 < len(rows) <= 3000  # but for lane changes
    known = json.loads(out.with_name("out.csv.json").read_text())
    assert known["seed"] == 4
    assert len(known["profile_sha256"]) == len(known["inputs"]["drive.parquet"]) == 64
    assert list(tmp_path.iterdir()) == [out, out.with_name("out.csv.json")] or len(list(tmp_path.iterdir())) == 2


def test_sample_duration_gives_a_free_run(profile: Path, tmp_path: Path) -> None:
    out = tmp_path / "out.csv"
    assert main(["sample", "-p", str(profile), "--duration", "20", "--speed", "25", "--seed", "0", "-o", str(out)]) == 0
    assert len(pd.read_csv(out)) == 101


def test_exactly_one_way_to_sample_is_asked_for(
    profile: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sample", "-p", str(profile), "--seed", "0", "-o", str(tmp_path / "o.csv")]) == 2
    assert "one of --like, --context, --duration" in capsys.readouterr().err


def test_input_at_fault_is_one_line_and_nothing_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bad, out = tmp_path / "bad.csv", tmp_path / "p.json"
    bad.write_text("time,offset,lane_width\n0,20,3.5\n0.1,20,3.5\n")
    assert main(["fit", str(bad), "-o", str(out)]) == 1
    said = capsys.readouterr().err.strip()
    assert said.startswith(f"xosc-lateral: {bad}: drive bad: offsets of up to 20 m")
    assert "\n" not in said
    assert not out.exists()


def test_neighbours_of_few_drives_are_refused_in_one_line_where_asked_for_and_else_left_out(
    measured: Path, profile: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    without = tmp_path / "without.json"
    kind = ["--model", profile.stem, "--name", profile.stem]
    assert main(["fit", str(measured), "-o", str(without), "--no-neighbours", *kind]) == 0
    assert without.read_bytes() == profile.read_bytes()
    capsys.readouterr()
    assert main(["fit", str(measured), "-o", str(tmp_path / "p.json"), "--neighbours"]) == 1
    said = capsys.readouterr().err.strip()
    assert "what neighbours do takes 30 drives at least, these are " in said
    assert "\n" not in said
