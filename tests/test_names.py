"""Names say what they hold: constants are quantities, functions do something, and names in comments exist."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[1] / "xosc_lateral"

# fmt: off
VAGUE = frozenset([
    "most", "least", "few", "enough", "some", "far", "near", "longest", "shortest", "largest", "smallest",
    "widest", "narrow", "slowest", "fastest", "highest", "sure", "surely", "clear", "perhaps", "hardly",
    "seldom", "never", "nothing", "nobody", "others", "ours", "own", "one", "found", "said", "told", "given",
    "who", "whole", "keep", "kept", "done", "lasting",
])
# fmt: on
"""Words that alone are no name of a constant, a function or a module: an adjective without its noun, a riddle."""

MODULES = sorted(PACKAGE.rglob("*.py"))
pytestmark = pytest.mark.lint


@cache
def tree_of(path: Path) -> ast.Module:
    """A module as Python reads it; not while tests are collected, which every worker does."""
    return ast.parse(path.read_text(encoding="utf-8"))


def _named(tree: ast.Module) -> list[tuple[str, int]]:
    """Constants, functions and classes of a module, with their lines."""
    defined = (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef))
    names = [(node.name, node.lineno) for node in defined]
    for node in tree.body:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        for target in targets:
            each = target.elts if isinstance(target, ast.Tuple) else [target]
            names += [(item.id, node.lineno) for item in each if isinstance(item, ast.Name)]
    return names


def test_the_list_of_vague_names_stays_short() -> None:
    assert len(VAGUE) <= 40


def test_names_are_not_vague() -> None:
    vague = [
        f"{path.name}:{line}: {name}"
        for path in MODULES
        for name, line in [(path.stem, 0), *_named(tree_of(path))]
        if name.strip("_").lower() in VAGUE
    ]
    assert not vague, "\n".join(vague)


# ---- names inside functions ----
RIDDLES = frozenset(["found", "one", "own", "said", "told", "given", "who", "nobody"])
"""Nobody knows what these hold; for the variable of a comprehension they will do."""

STORED = frozenset([("response.py", "given")])
"""Fields that lie in saved states under their names."""


def _local_names(tree: ast.Module) -> list[tuple[str, int]]:
    """Variables, fields and arguments, besides those of comprehensions, with their lines."""
    comprehensions = (node for node in ast.walk(tree) if isinstance(node, ast.comprehension))
    short_lived = {id(name) for node in comprehensions for name in ast.walk(node.target)}
    nodes = [node for node in ast.walk(tree) if id(node) not in short_lived]
    names = [node for node in nodes if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    arguments = [(node.arg, node.lineno) for node in nodes if isinstance(node, ast.arg)]
    return [*((node.id, node.lineno) for node in names), *arguments]


def test_local_names_are_no_riddles() -> None:
    riddles = [
        f"{path.name}:{line}: {name}"
        for path in MODULES
        for name, line in _local_names(tree_of(path))
        if name.strip("_") in RIDDLES and (path.name, name) not in STORED
    ]
    assert not riddles, "\n".join(riddles)


# ---- names in docstrings and comments ----
DOTTED = re.compile(r"`(?:xosc_lateral\.)?((?:[a-z_]+\.)+(?!csv|html|json|toml|xosc)[A-Za-z_]\w*)`")
"""`a.b` or `a.b.C` in backticks."""

EVERYTHING = [path for path in PACKAGE.rglob("*") if "__pycache__" not in path.parts]
FORMER = frozenset(
    ["api", "driver", "enrich", "formats", "identification", "pipeline", "playback", "reconstruction", "report"]
)
ROOMS = frozenset(path.stem for path in EVERYTHING if path.suffix in ("", ".py")) | FORMER


def _exists(dotted: str) -> bool:
    """Whether a dotted name ends in a module of the package, or in something that one defines."""
    *rooms, last = dotted.split(".")
    tail = "/".join(rooms)
    if any(path.as_posix().endswith((f"/{tail}/{last}", f"/{tail}/{last}.py")) for path in EVERYTHING):
        return True
    homes = [path for path in MODULES if path.as_posix().endswith((f"/{tail}.py", f"/{tail}/__init__.py"))]
    return any(re.search(rf"\b{re.escape(last)}\b", path.read_text(encoding="utf-8")) for path in homes)


def test_dotted_names_in_backticks_exist() -> None:
    """Those that begin with a folder or module of the package; others are of other packages, or of a variable."""
    texts = {path.name: path.read_text(encoding="utf-8") for path in MODULES}
    names = {(name, match[1]) for name, text in texts.items() for match in DOTTED.finditer(text)}
    assert not {(path, name) for path, name in names if name.split(".")[0] in ROOMS and not _exists(name)}


# ---- pages in docstrings and comments ----
PAGE = re.compile(r"\bdocs/[\w/]+\.md\b")


def test_pages_that_the_package_refers_to_are_in_the_repository() -> None:
    texts = {path: path.read_text(encoding="utf-8") for path in MODULES}
    pages = {(path.name, page) for path, text in texts.items() for page in PAGE.findall(text)}
    assert pages  # the pattern still matches what the package says
    assert not {(module, page) for module, page in pages if not (PACKAGE.parent / page).is_file()}
    assert not [path.name for path, text in texts.items() if re.search(r"\bDESIGN\b", text)]  # the team's own page


def test_make_lint_knows_every_file_that_holds_lint() -> None:
    tests = PACKAGE.parent / "tests"
    makefile = (PACKAGE.parent / "Makefile").read_text(encoding="utf-8")
    listed = re.search(r"^LINT := \$\(addprefix tests/,(.*)\)$", makefile, flags=re.MULTILINE)
    assert listed is not None
    holds = {path for path in tests.rglob("test_*.py") if "mark.lint" in path.read_text(encoding="utf-8")}
    assert holds == {tests / name for name in listed[1].split()}
