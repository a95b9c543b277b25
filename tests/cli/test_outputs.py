"""Outputs that can't be meant, and numbers out of range: refused before anything is written."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from xosc_lateral.cli import main


@pytest.fixture
def scenario(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert main(["template", "write", "cut-in", "-o", str(tmp_path)]) == 0
    capsys.readouterr()
    return tmp_path / "cut-in.xosc"


def _files(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize(
    ("verb", "options", "what"),
    [
        ("convert", ["-o", "cut-in.xosc"], "cut-in.xosc: is an input"),
        ("convert", ["-o", "cut-in.xodr"], "cut-in.xodr: is an input"),
        ("convert", ["-o", "out.xosc", "--report", "cut-in.xosc"], "cut-in.xosc: is an input"),
        ("convert", ["-o", "out.xosc", "--report", "out.xosc"], "out.xosc: is named for two outputs"),
        ("convert", ["-o", "out.xosc", "--report", "cut-in.xodr"], "cut-in.xodr: is an input"),
        ("convert", ["-o", "out.xosc", "--report", "."], "is a folder"),
        ("convert", ["-o", "out.xosc", "--report", "cut-in.xodr/r.html"], "cut-in.xodr/r.html: can't be written: "),
        ("convert", ["-o", "cut-in.xodr/out.xosc"], "cut-in.xodr/out.xosc: can't be written: "),
        (
            "convert",
            ["-o", "v.xosc", "--report", "cut-in.xodr/r.html", "--variants", "2"],
            "r_01.html: can't be written",
        ),
        ("convert", ["-o", "out.xosc", "--allow", "nowhere"], "nowhere: no such folder to allow"),
        ("convert", ["-o", "out.xosc", "--profile", "none.json"], "none.json: no such file"),
        ("convert", ["-o", "out.xosc", "--context", "none.csv"], "none.csv: no such file or directory"),
        ("play", ["-o", "cut-in.xosc"], "cut-in.xosc: is an input"),
        ("play", ["-o", "cut-in.xodr"], "cut-in.xodr: is an input"),
    ],
)
def test_no_verb_writes_over_its_inputs(
    scenario: Path,
    verb: str,
    options: list[str],
    what: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(scenario.parent)
    before = _files(scenario.parent)
    assert main([verb, "cut-in.xosc", *options]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert what in line
    assert _files(scenario.parent) == before


@pytest.mark.parametrize(
    "words",
    [
        ["fit", "t.csv", "-o", "t.csv"],
        ["close-loop", "t.csv", "-o", "t.csv", "--report", "loop"],
        ["sample", "--profile", "motorway-car", "--like", "t.csv", "--seed", "1", "-o", "t.csv"],
        ["evaluate", "t.csv", "--profile", "motorway-car", "--report", "t.csv"],
    ],
)
def test_no_verb_writes_over_measured_drives(
    tmp_path: Path, words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "t.csv").write_text("time,offset,lane_width\n")
    assert main(words) == 1
    assert "t.csv: is an input" in capsys.readouterr().err
    assert _files(tmp_path) == {tmp_path / "t.csv": b"time,offset,lane_width\n"}


@pytest.mark.parametrize("limit", ["nan", "-1", "inf"])
@pytest.mark.parametrize("verb", ["segments", "play", "convert"])
def test_a_time_limit_that_is_none_is_wrong_usage(
    scenario: Path, verb: str, limit: str, capsys: pytest.CaptureFixture[str]
) -> None:
    output = [] if verb == "segments" else ["-o", str(scenario.parent / "out")]
    assert main([verb, str(scenario), *output, "--time-limit", limit]) == 2
    assert "--time-limit" in capsys.readouterr().err
    assert not (scenario.parent / "out").exists()


def test_an_allowed_folder_that_is_not_there_stops_a_batch_at_once(
    scenario: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["convert", str(scenario.parent), "-o", str(scenario.parent / "out"), "--allow", "nowhere"]
    assert main(words) == 1
    assert capsys.readouterr().err == "xosc-lateral: nowhere: no such folder to allow\n"
    assert not (scenario.parent / "out").exists()


@pytest.mark.parametrize("jobs", ["0", "-2"])
def test_a_batch_needs_workers(scenario: Path, jobs: str) -> None:
    assert main(["convert", str(scenario.parent), "-o", str(scenario.parent / "out"), "--jobs", jobs]) == 2
    assert not (scenario.parent / "out").exists()


def test_a_lane_without_width_is_refused_by_name(scenario: Path, capsys: pytest.CaptureFixture[str]) -> None:
    road = scenario.with_suffix(".xodr")
    text = road.read_text(encoding="utf-8")
    assert ' a="3.' in text
    road.write_text(re.sub(r'(<width [^>]*)a="[^"]*"', r'\1a="0"', text), encoding="utf-8")
    before = _files(scenario.parent)
    assert main(["convert", str(scenario), "-o", str(scenario.parent / "out.xosc")]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("cut-in.xodr: road '1': lane -2 has no width where 'Ego' follows it")
    assert _files(scenario.parent) == before
