"""Every file in examples/ runs as it is and says something."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_example_runs(path, tmp_path, capsys):
    runpy.run_path(str(path))["main"](tmp_path)
    assert len(capsys.readouterr().out.splitlines()) >= 2
    assert any(tmp_path.iterdir())
