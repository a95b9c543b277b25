"""The layout of CONTRIBUTING holds: imports point to lower ranks only."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "xosc_lateral"

RANKS = {"base": 0, "world": 1, "drivers": 1, "files": 2, "workflows": 3, "cli": 4, "extras": 5}
"""Rank of each top folder; those of one rank do not know each other."""

pytestmark = pytest.mark.lint


def imports_of(path: Path) -> set[str]:
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


def test_imports_point_to_lower_ranks() -> None:
    parts = [path.name for path in sorted(PACKAGE.iterdir()) if (path / "__init__.py").exists()]
    wrong = {
        f"{path.relative_to(PACKAGE)} imports {name}"
        for part in parts
        for path in (PACKAGE / part).rglob("*.py")
        for name in imports_of(path)
        if name != part and RANKS[name] >= RANKS[part]
    }
    assert not wrong


def test_every_part_has_its_rank() -> None:
    parts = {path.stem for path in PACKAGE.iterdir() if path.suffix == ".py" or (path / "__init__.py").exists()}
    assert parts - {"__init__", "__main__", "resources"} == set(RANKS)


def test_extras_know_each_other_as_little_as_possible() -> None:
    allowed = {"detect": {"recordings"}, "dossier": {"detect"}}
    wrong = set()
    for path in (PACKAGE / "extras").glob("*/**/*.py"):
        own = path.relative_to(PACKAGE / "extras").parts[0]
        met = set(re.findall(r"xosc_lateral\.extras\.(\w+)", path.read_text(encoding="utf-8")))
        wrong |= {f"{path} imports {name}" for name in met - {own} - allowed.get(own, set())}
    assert not wrong


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
