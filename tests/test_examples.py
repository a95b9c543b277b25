"""Every file in examples/ runs as it is and says something, and uses nothing but what is promised."""

from __future__ import annotations

import ast
import json
import runpy
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))
NOTEBOOK = EXAMPLES[0].parent / "tour.ipynb"

PROMISED = ("xosc_lateral", "xosc_lateral.drivers.model.effects")
"""Modules that docs/api.md and docs/plugins.md name."""


def notebook_code() -> str:
    """Code of all cells, one after another."""
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")


@pytest.mark.parametrize("path", EXAMPLES, ids=[path.stem for path in EXAMPLES])
def test_example_runs(path, tmp_path, capsys, monkeypatch):
    monkeypatch.syspath_prepend(str(path.parent))  # as `python examples/NAME.py` does
    runpy.run_path(str(path))["main"](tmp_path)
    assert len(capsys.readouterr().out.splitlines()) >= 2
    assert any(tmp_path.iterdir())


@pytest.mark.slow
def test_the_notebook_runs_from_top_to_bottom(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(str(NOTEBOOK.parent))
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(notebook_code(), "tour.ipynb", "exec"), names)
    assert "curvature" in capsys.readouterr().out
    assert (tmp_path / "out" / "tour" / "lifelike.xosc").exists()


@pytest.mark.parametrize("path", [*EXAMPLES, NOTEBOOK], ids=lambda path: path.stem)
def test_nothing_but_what_is_promised_is_used(path):
    code = notebook_code() if path == NOTEBOOK else path.read_text(encoding="utf-8")
    used = {
        name
        for node in ast.walk(ast.parse(code))
        for name in (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else []
        )
        if name.split(".")[0] == "xosc_lateral"
    }
    assert used <= set(PROMISED)
