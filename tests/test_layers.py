"""The layout of CONTRIBUTING holds: imports point to lower layers only."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "xosc_lateral"

LAYERS = {
    "errors": 0,
    "segment": 0,
    "road": 1,
    "scenario": 1,
    "motion": 2,
    "driver": 2,
    "enrich": 3,
    "loop": 3,
    "formats": 4,
    "templates": 4,
    "pipeline": 5,
    "report": 6,
    "cli": 7,
}
"""Layer of each part; parts of one layer don't know each other."""


def _imports(path: Path) -> set[str]:
    """Parts of the package that a module imports, also inside functions, apart from those for type checking alone."""
    found = set()
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            node.body = []
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        found |= {name.split(".")[1] for name in names if name.startswith("xosc_lateral.")}
    return found


@pytest.mark.parametrize("part", [path.name for path in sorted(PACKAGE.iterdir()) if (path / "__init__.py").exists()])
def test_imports_point_to_lower_layers(part: str) -> None:
    wrong = {
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in (PACKAGE / part).rglob("*.py")
        for name in _imports(path)
        if name != part and LAYERS[name] >= LAYERS[part]
    }
    assert not wrong


def test_every_part_has_its_layer() -> None:
    parts = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert parts - {"__init__", "__main__", "resources"} == set(LAYERS)
