"""The verb `play`."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path

import pytest
from typer.testing import CliRunner

import xosc_lateral as xl
from tests.kit.stage import Stage, after, event, lane_change, maneuvers, to_lane
from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import app
from xosc_lateral.workflows.batch import workers
from xosc_lateral.workflows.batch.manifest import read_manifest

RUN = CliRunner()


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    Stage(tmp_path).play(maneuvers(event(lane_change(to_lane(-9)), trigger=after(1.0))), last=2.0)
    return tmp_path / "scenario.xosc"


def test_it_writes_the_table_and_tells_what_was_not_played(scenario: Path, tmp_path: Path) -> None:
    result = RUN.invoke(app, ["states", str(scenario), "-o", str(tmp_path / "states.csv"), "--step", "0.1"])
    assert result.exit_code == 0
    lines = (tmp_path / "states.csv").read_text().splitlines()
    assert lines[0] == "time,name,x,y,z,h,speed,road,lane,offset_t,s"
    assert len(lines) == 1 + 21
    assert "lane -9" in result.stderr
    assert "scenario.xosc:" in result.stderr


def test_the_time_limit_counts(scenario: Path, tmp_path: Path) -> None:
    result = RUN.invoke(app, ["states", str(scenario), "-o", str(tmp_path / "s.csv"), "--time-limit", "1"])
    assert result.exit_code == 0
    assert (tmp_path / "s.csv").read_text().splitlines()[-1].startswith("1.000,")
    assert "time limit" in result.stderr


@pytest.mark.parametrize("verb", ["states", "convert"])
def test_a_run_that_is_cut_off_warns_unless_quiet_and_fails_when_strict(
    verb: str, scenario: Path, tmp_path: Path
) -> None:
    output = tmp_path / ("s.csv" if verb == "states" else "out.xosc")
    words = [verb, str(scenario), "-o", str(output), "-q"]
    cut = RUN.invoke(app, [*words, "--time-limit", "1"])
    assert cut.exit_code == 0 and not cut.stderr
    assert "time limit of 1 s" in RUN.invoke(app, [*words[:-1], "--time-limit", "1"]).output
    assert RUN.invoke(app, [*words, "--time-limit", "1", "--strict"]).exit_code == 1
    whole = RUN.invoke(app, words)
    assert whole.exit_code == 0 and not whole.stderr


def test_a_batch_says_which_runs_are_cut_off(scenario: Path, tmp_path: Path) -> None:
    words = ["convert", str(scenario), str(scenario), "-o", str(tmp_path / "out"), "--json", "--time-limit", "1"]
    cut = RUN.invoke(app, words)
    assert cut.exit_code == 0 and "1 runs end at the time limit" in cut.stderr
    [row] = read_manifest(tmp_path / "out" / "manifest.parquet")
    assert any("time limit of 1 s" in line for line in row.warnings)
    assert RUN.invoke(app, [*words, "--strict"]).exit_code == 1


def test_a_scenario_that_is_not_there_leaves_no_table(tmp_path: Path) -> None:
    result = RUN.invoke(app, ["states", str(tmp_path / "none.xosc"), "-o", str(tmp_path / "s.csv")])
    assert result.exit_code != 0
    assert not (tmp_path / "s.csv").exists()


def test_a_missing_vehicle_catalog_is_an_error_when_strict(scenario: Path, tmp_path: Path) -> None:
    text = scenario.read_text()
    reference = '<CatalogReference catalogName="Cars" entryName="sports car"/>'
    text, replaced = re.subn(r"<Vehicle .*?</Vehicle>", reference, text, count=1, flags=re.DOTALL)
    assert replaced
    scenario.write_text(text)
    table, enriched = tmp_path / "states.csv", tmp_path / "out.xosc"
    usual = RUN.invoke(app, ["states", str(scenario), "-o", str(table), "--time-limit", "1"])
    assert usual.exit_code == 0
    assert "played as a car of usual size" in usual.stderr
    table.unlink()
    for words in (["states", str(scenario), "-o", str(table)], ["convert", str(scenario), "-o", str(enriched)]):
        refused = RUN.invoke(app, [*words, "--strict"])
        assert isinstance(refused.exception, FormatError)
        assert "catalog 'Cars' not found" in str(refused.exception)
    assert not table.exists()
    assert not enriched.exists()


@pytest.mark.parametrize("words", ["states {} -o {}.csv", "segments {}", "view {} --no-open"])
def test_no_scenario_keeps_a_verb_busy_for_ever(words: str, scenario: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def busy(path: Path, **options: object) -> None:
        while path:
            pass

    monkeypatch.setattr(xl, "play", busy)
    monkeypatch.setattr(workers, "JobLimits", partial(workers.JobLimits, timeout=0.1))
    result = RUN.invoke(app, [word.format(scenario, scenario) for word in words.split()])
    assert isinstance(result.exception, workers.JobLimitError)
    assert str(result.exception) == f"{scenario}: took longer than 0.1 s"
