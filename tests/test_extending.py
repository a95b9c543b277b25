"""`examples/extending`: what its pages say is written, in a copy of the tree, and the tests that would notice pass."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.pages

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / "examples" / "extending").glob("[a-z]*.md"))
STEP = re.compile(
    r"`(?P<file>[\w/]+\.\w+)`, (?P<where>new|at the end|(?P<side>above|below|instead of) `(?P<anchor>.+?)`):\n"
    r"```\w+\n(?P<code>.*?)```",
    re.DOTALL,
)
GUARDS = {
    "action": ["tests/world/player/test_documented.py", "tests/world/player/test_one_more.py"],
    "detector": ["tests/extras/detect/test_tuning.py"],
    "effect": ["tests/drivers/model/effects/test_blocks.py", "tests/drivers/model/effects/test_column_effects.py",
               "tests/extras/live/test_c_driver.py::test_at_most_two_kinds_of_effects_are_missing_in_c",
               "tests/extras/live/test_c_driver.py::test_every_effect_that_a_profile_can_hold_acts_as_in_the_batch_call[motorway]"],
    "importer": ["tests/files/test_one_more.py"],
    "setting": ["tests/workflows/test_options.py", "tests/workflows/conversion/test_settings.py"],
}  # fmt: skip
"""Page -> tests of the tree that fail where it forgets something."""


def _write(step: re.Match[str], tree: Path) -> Path:
    path = tree / step["file"]
    if step["where"] == "new":
        assert not path.exists(), path
        path.write_text(step["code"], encoding="utf-8")
        return path
    text = path.read_text(encoding="utf-8")
    if step["where"] == "at the end":
        path.write_text(text + step["code"], encoding="utf-8")
        return path
    anchor = step["anchor"].replace("\\n", "\n")
    assert text.count(anchor) == 1, f"{anchor!r} stands {text.count(anchor)} times in {path}"
    begin = text.index(anchor)
    end = text.index("\n", begin) + 1
    if step["side"] == "instead of":
        changed = text[:begin] + step["code"].strip("\n") + text[begin + len(anchor) :]
    else:
        place = begin if step["side"] == "above" else end
        changed = text[:place] + step["code"] + text[place:]
    path.write_text(changed, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what is run and tested."""
    copy = tmp_path_factory.mktemp("tree")
    leave = shutil.ignore_patterns("__pycache__", "*.pyc", "work", "out")
    for name in ("xosc_lateral", "tests", "docs", "driver_profiles", "templates", "examples"):
        shutil.copytree(ROOT / name, copy / name, ignore=leave)
    shutil.copy(ROOT / "pyproject.toml", copy)
    return copy


def test_pages_are_all_here() -> None:
    assert [page.stem for page in PAGES] == sorted(GUARDS)


SECOND = {"effect": ("Dimming", "Waning"), "importer": ("Zenith",)}
"""Page -> names of what is added after what it adds: before it, and behind it, in the order of imports."""
FIRST = {"effect": "Fading", "importer": "Acme"}


def _renamed(page: Path, name: str) -> str:
    text, first = page.read_text(encoding="utf-8"), FIRST[page.stem]
    for case in (str, str.lower, str.upper):
        text = text.replace(case(first), case(name))
    return text


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_says_is_all_that_is_needed(page: Path, tree: Path) -> None:
    text = page.read_text(encoding="utf-8")
    steps = list(STEP.finditer(text))
    assert len(steps) == text.count("```") / 2
    for name in SECOND.get(page.stem, ()):
        steps += STEP.finditer(_renamed(page, name))
    written = [_write(step, tree) for step in steps]
    sources = [*{str(path) for path in written if path.suffix == ".py"}]
    own = {str(path) for path in written if path.name.startswith("test_")}
    if page.stem in SECOND:  # as the page says
        subprocess.run([sys.executable, "-m", "ruff", "check", "-q", "--select", "I", "--fix", *sources], cwd=tree)
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1"}
    words = ["-q", "-p", "no:xdist", "-p", "no:cacheprovider", "--rootdir", str(tree), *sorted(own), *GUARDS[page.stem]]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words], cwd=tree, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-3000:]
    style = [sys.executable, "-m", "ruff", "check", "-q", *sources]
    done = subprocess.run(style, cwd=tree, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
