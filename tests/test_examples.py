"""Every file in examples/ runs as it is and says something, and uses nothing but what is promised."""

from __future__ import annotations

import ast
import inspect
import json
import runpy
from contextlib import chdir, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

import xosc_lateral as xl
from tests.docs.printed import difference

EXAMPLES = sorted((Path(__file__).resolve().parents[1] / "examples").glob("*.py"))
NOTEBOOK = EXAMPLES[0].parent / "tour.ipynb"

PROMISED = ("xosc_lateral", "xosc_lateral.drivers.model.effects")
"""Modules that docs/api.md and docs/plugins.md name."""


def notebook_code() -> str:
    """Code of all cells, one after another."""
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    return "\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")


@pytest.mark.pages
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(path, tmp_path, capsys, monkeypatch):
    monkeypatch.syspath_prepend(str(path.parent))  # as `python examples/NAME.py` does
    runpy.run_path(str(path))["main"](tmp_path)
    assert len(capsys.readouterr().out.splitlines()) >= 2
    assert any(tmp_path.iterdir())


def run_notebook() -> dict[str, Any]:
    """The notebook as Jupyter would leave it after a run from top to bottom."""
    notebook = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    names: dict[str, Any] = {}
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for number, cell in enumerate(cells, start=1):
        *statements, last = ast.parse("".join(cell["source"])).body
        printed, value = StringIO(), None
        with redirect_stdout(printed):
            exec(compile(ast.Module(statements, []), "tour.ipynb", "exec"), names)
            if isinstance(last, ast.Expr):
                value = eval(compile(ast.Expression(last.value), "tour.ipynb", "eval"), names)
            else:
                exec(compile(ast.Module([last], []), "tour.ipynb", "exec"), names)
        cell["execution_count"] = number
        cell["outputs"] = [{"name": "stdout", "output_type": "stream", "text": _lines(printed.getvalue())}]
        cell["outputs"] = cell["outputs"] if printed.getvalue() else []
        if value is not None:
            data = {"text/plain": _lines(repr(value))}
            for kind, method in (("text/html", "_repr_html_"), ("image/svg+xml", "_repr_svg_")):
                if hasattr(value, method):
                    data[kind] = _lines(getattr(value, method)())
            result = {"data": data, "execution_count": number, "metadata": {}, "output_type": "execute_result"}
            cell["outputs"].append(result)
    return notebook


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


def shown_texts(notebook: dict[str, Any]) -> list[str]:
    """What the cells print and return, as text."""
    outputs = [output for cell in notebook["cells"] for output in cell.get("outputs", [])]
    return ["".join(output.get("text") or output["data"]["text/plain"]) for output in outputs]


@pytest.mark.pages
@pytest.mark.slow
def test_the_notebook_runs_from_top_to_bottom_and_shows_what_came_out(tmp_path, monkeypatch):
    """`PYTHONPATH=examples python -m tests.test_examples` runs it anew and keeps the outputs."""
    monkeypatch.syspath_prepend(str(NOTEBOOK.parent))
    monkeypatch.chdir(tmp_path)
    stored = shown_texts(json.loads(NOTEBOOK.read_text(encoding="utf-8")))
    texts = shown_texts(run_notebook())
    assert len(stored) == len(texts) > 8
    for shown, printed in zip(stored, texts, strict=True):
        assert difference(shown, printed, last_digit=1) is None, printed
    assert any("curvature" in text for text in texts)
    assert (tmp_path / "out" / "tour" / "lifelike.xosc").exists()


@pytest.mark.lint
def test_nothing_but_what_is_promised_is_used():
    codes = {path.name: path.read_text(encoding="utf-8") for path in EXAMPLES} | {NOTEBOOK.name: notebook_code()}
    used = {
        (path, name)
        for path, code in codes.items()
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
    assert {name for _, name in used} >= {PROMISED[0]}
    assert not {(path, name) for path, name in used if name not in PROMISED}


@pytest.mark.lint
def test_what_the_notebook_calls_is_there():
    """It is run by `make pages`; here, its names and their arguments."""
    calls = [node for node in ast.walk(ast.parse(notebook_code())) if isinstance(node, ast.Call)]
    ours = [one for one in calls if isinstance(one.func, ast.Attribute) and ast.unparse(one.func.value) == "xl"]
    assert len(ours) > 5
    for call in ours:
        given = inspect.signature(getattr(xl, call.func.attr)).bind_partial
        given(*call.args, **{word.arg: word.value for word in call.keywords})


if __name__ == "__main__":
    with TemporaryDirectory() as folder, chdir(folder):
        NOTEBOOK.write_text(json.dumps(run_notebook(), indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
