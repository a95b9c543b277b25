"""What each verb loads: a verb that needs no scipy, pandas, numba or matplotlib must not wait for them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

import xosc_lateral as xl
from xosc_lateral.base.plugins import offered
from xosc_lateral.cli import VERB_MODULES, VERBS, app, verb

HEAVY = ("matplotlib", "numba", "pandas", "scipy", "scenariogeneration", "pyarrow", "joblib", "sklearn", "rich")

LOADED = """
import json, sys
from xosc_lateral.cli import main
code = main(sys.argv[1:]) if len(sys.argv) > 1 else 0
print(json.dumps([code, sorted(sys.modules)]))
"""


def loaded(words: list[str], folder: Path) -> set[str]:
    """Modules of a process of its own that has run a verb."""
    environment = {"PYTHONPATH": str(Path(xl.__file__).parents[1]), "PATH": ""}
    done = subprocess.run(
        [sys.executable, "-c", LOADED, *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    code, modules = json.loads(done.stdout.splitlines()[-1])
    assert code == 0
    return set(modules)


@pytest.mark.parametrize("words", [["--version"], ["--help"]])
def test_nothing_is_loaded_to_say_what_there_is(words: list[str], tmp_path: Path) -> None:
    modules = loaded(words, tmp_path)
    own = {name for name in modules if name.startswith("xosc_lateral.")}
    light = {
        "base",
        "base.errors",
        "base.plugins",
        "extras",
        *(f"extras.{name}" for name in ("detect", "dossier", "live", "loop", "recordings")),
        "base.limits",
        "base.names",
        "base.signals",
        "base.version",
        "cli",
        "files",
        "files.held",
        "files.source",
    }
    assert own == {f"xosc_lateral.{name}" for name in light}
    assert not modules & {*HEAVY, "numpy", "lxml", "msgspec", "pydantic"}


@pytest.mark.parametrize(
    ("words", "needs"),
    [
        (["convert", "cut-in.xosc", "-o", "-", "--ego", "none", "--time-limit", "3"], set()),
        (["segments", "cut-in.xosc", "--time-limit", "3"], set()),
        (["template", "list"], set()),
        (["profiles", "list"], set()),
    ],
)
def test_heavy_packages_are_loaded_where_they_work(words: list[str], needs: set[str], tmp_path: Path) -> None:
    xl.write_template("cut-in", tmp_path)
    modules = loaded(words, tmp_path)
    assert modules & set(HEAVY) == needs
    assert not [name for name in modules if name.startswith("xosc_lateral.drivers.fitting")], "who drives fits nothing"


@pytest.mark.parametrize("name", VERBS)
def test_the_table_of_verbs_says_what_they_say_themselves(name: str) -> None:
    command: Any = typer.main.get_command(app)
    listed, itself = command.commands[name], verb(name)
    assert (itself.name, itself.get_short_help_str(200)) == (name, listed.get_short_help_str(200))
    assert listed.callback is None


def test_every_module_of_the_command_line_is_a_verb_or_shared() -> None:
    folder = Path(xl.__file__).parent / "cli"
    with_verb = {
        path.stem for path in folder.glob("*.py") if "app = group_of_verbs()" in path.read_text(encoding="utf-8")
    }
    verbs = {verb: VERB_MODULES.get(verb, verb.replace("-", "_")) for verb in VERBS.keys() - offered("VERBS")}
    assert with_verb == set(verbs.values())
