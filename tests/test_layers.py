"""The layout of CONTRIBUTING holds; imports that point up are found by `lint-imports` (pyproject.toml)."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "xosc_lateral"

pytestmark = pytest.mark.lint


# ---- how much there is -----------------------------------------------------------------------------------------------
MOST_STATEMENTS = {"core": 30_193, "extras": 14_396}
"""Statements without docstrings, as counted when these were last set: they only fall. Aimed at: 30,500, 12,800."""


def statements(path: Path) -> int:
    return sum(
        isinstance(node, ast.stmt)
        and not (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
        )
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    )


def test_what_moves_in_is_paid_for() -> None:
    counted = dict.fromkeys(MOST_STATEMENTS, 0)
    for path in PACKAGE.rglob("*.py"):
        counted["extras" if "extras" in path.relative_to(PACKAGE).parts else "core"] += statements(path)
    assert {name: number for name, number in counted.items() if number > MOST_STATEMENTS[name]} == {}


# ---- no circles between modules --------------------------------------------------------------------------------------
def _module_name(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imported_modules(path: Path, modules: set[str]) -> set[str]:
    """Modules that one names anywhere: also inside functions, and for type checking alone.

    Packages that a name lies in count: they are imported first, so that what they import comes along. Packages that the
    module itself lies in don't: they have been begun by then.
    """
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            inner = {f"{node.module}.{alias.name}" for alias in node.names} & modules
            found |= inner or {node.module}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    own = _module_name(path)
    around = {".".join(name.split(".")[:k]) for name in found & modules for k in range(2, name.count(".") + 1)}
    above = {name for name in around if own == name or own.startswith(f"{name}.")}
    return ((found | around - above) & modules) - {own}


def test_no_module_imports_itself_by_a_detour() -> None:
    paths = {_module_name(path): path for path in PACKAGE.rglob("*.py")}
    graph = {name: _imported_modules(path, set(paths)) for name, path in paths.items()}
    left = dict(graph)
    while free := [name for name, wanted in left.items() if not wanted & left.keys()]:
        for name in free:
            del left[name]
    circles = {name: sorted(wanted & left.keys()) for name, wanted in left.items()}
    assert not circles, "modules on a circle of imports, or above one"
