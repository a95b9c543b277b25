"""Every benchmark can be begun as its page says, `python -m laboratory.NAME`, and tells what it takes."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from laboratory.markers import show

FOLDER = Path(__file__).resolve().parents[2] / "laboratory"
BEGUN = 'if __name__ == "__main__":'
"""What files that are no benchmark themselves, but help several, don't have."""
BENCHMARKS = sorted(path.stem for path in FOLDER.glob("[a-z]*.py") if BEGUN in path.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", BENCHMARKS)
def test_a_benchmark_begins(name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    module = importlib.import_module(f"laboratory.{name}")
    assert f"python -m laboratory.{name}" in (module.__doc__ or "")
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with pytest.raises(SystemExit) as ended:
        module.main()
    assert ended.value.code == 0
    assert "usage" in capsys.readouterr().out


def test_a_table_is_printed_and_put_between_its_markers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- one: begin -->\nold\n<!-- one: end -->\nafter\n", encoding="utf-8")
    show("| new |", None, "one")
    assert "old" in page.read_text(encoding="utf-8")
    show("| new |", page, "one")
    assert page.read_text(encoding="utf-8") == "before\n<!-- one: begin -->\n| new |\n<!-- one: end -->\nafter\n"
    assert capsys.readouterr().out == "| new |\n| new |\n"
    with pytest.raises(SystemExit, match="no markers"):
        show("| new |", page, "other")
