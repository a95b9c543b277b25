"""Events that run again and again: what follows them is bounded, and said."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from pathlib import Path

import pytest

import xosc_lateral as xl
from xosc_lateral.base.limits import REPEATED_RUNS
from xosc_lateral.cli import main
from xosc_lateral.files.openscenario.write.reactive import SPARE_ACTS
from xosc_lateral.workflows.conversion import equivalent_paths


@pytest.fixture
def endless(tmp_path: Path) -> Path:
    """The template, in which everything may run two thousand million times, and is as short as shows it."""
    xl.write_template("cut-in", tmp_path)
    path = tmp_path / "cut-in.xosc"
    path.write_text(path.read_text().replace('maximumExecutionCount="1"', 'maximumExecutionCount="2000000000"'))
    return path


@pytest.mark.pages
def test_offsets_follow_so_many_runs_of_an_action(endless: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(equivalent_paths, "MOST_TRIALS", 1)  # more would make the moves smaller
    result = xl.convert(endless, time_limit=24.0)
    acts = result.data.count(b'<Act name="xosc-lateral offsets')
    assert REPEATED_RUNS.value < acts <= REPEATED_RUNS.value + SPARE_ACTS + 2
    assert any(warning.endswith(f"at most {REPEATED_RUNS}") for warning in result.warnings)


@pytest.fixture
def nobody_hears_of_garbage() -> Iterator[None]:
    """No callbacks of the collector, as hypothesis leaves one: what is raised within them is only printed."""
    listening, gc.callbacks[:] = gc.callbacks[:], []
    yield
    gc.callbacks[:] = listening


@pytest.mark.usefixtures("nobody_hears_of_garbage")
def test_a_single_conversion_ends_within_its_limit(endless: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = endless.with_name("out.xosc")
    assert main(["convert", str(endless), "-o", str(output), "--job-limit", "1s"]) == 1
    line = f"xosc-lateral: {endless}: took longer than 1 s; --job-limit raises the limit"
    assert capsys.readouterr().err.strip() == line
    assert {path.suffix for path in endless.parent.iterdir()} == {".xosc", ".xodr"} and not output.exists()
