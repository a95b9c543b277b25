from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from laboratory.board.__main__ import main
from laboratory.board.models import calibration
from tests.kit.runs import smooth_runs
from xosc_lateral.base.errors import NotEnoughDataError


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("board") / "drives.parquet"
    runs = smooth_runs(24, 45.0)
    frames = [
        pd.DataFrame({"drive": run.drive, "time": run.time, "offset": run.offset, "lane_width": 3.75, "speed": 30.0})
        for run in runs
    ]
    pd.concat(frames).to_parquet(path)
    return path


def test_a_board_is_written_for_machines_and_documents(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(calibration, "FIRST_POINTS", 8)  # what is tested is what is written
    monkeypatch.setattr(calibration, "DESCENTS", 1)
    monkeypatch.setattr(calibration, "FIRST_STEPS", 5)
    monkeypatch.setattr(calibration, "STEPS", 5)
    words = [str(table), "-o", str(tmp_path / "out"), "--no-classify", "--resamples", "10"]
    main([*words, "--model", "lane-centre", "--model", "gaussian-process", "--profile", "motorway"])
    assert "Gaussian process" in capsys.readouterr().out
    written = json.loads((tmp_path / "out" / "board.json").read_text())
    assert [one["name"] for one in written["models"]] == ["gaussian-process", "profile motorway", "lane-centre"]
    assert "not fitted on these drives" in written["models"][1]["departures"]
    numbers = written["models"][0]["numbers"]
    assert sum(one["ranked"] for one in numbers.values()) == 5
    assert all(one["floor"] is not None for one in numbers.values())
    document = (tmp_path / "out" / "board.md").read_text()
    assert "| 1 | Gaussian process |" in document and "Rasmussen" in document


def test_an_unknown_model_is_wrong_usage(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        main([str(table), "-o", "nowhere", "--model", "magic"])
    assert "magic" in capsys.readouterr().err


def test_a_table_with_too_little_is_named(tmp_path: Path) -> None:
    run = smooth_runs(1, 30.0)[0]
    path = tmp_path / "short.csv"
    pd.DataFrame({"time": run.time, "offset": run.offset, "lane_width": 3.75, "speed": 30.0}).to_csv(path, index=False)
    with pytest.raises(NotEnoughDataError, match="are needed to fit on one half"):
        main([str(path), "-o", str(tmp_path / "out")])
