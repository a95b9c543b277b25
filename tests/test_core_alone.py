"""The core works, and says the same, where its extras are not there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import xosc_lateral as xl
from xosc_lateral.base.plugins import offered
from xosc_lateral.cli import VERBS

PACKAGE = Path(xl.__file__).parent


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder to import from in which the package has all but its extras."""
    folder = tmp_path_factory.mktemp("core")
    (folder / "xosc_lateral").mkdir()
    for path in PACKAGE.iterdir():
        if path.name != "extras":
            (folder / "xosc_lateral" / path.name).symlink_to(path)
    return folder


def run(core: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", "import sys; from xosc_lateral.cli import main; sys.exit(main(sys.argv[1:]))"]
    environment = os.environ | {"PYTHONPATH": str(core)}
    return subprocess.run([*command, *words], cwd=core, env=environment, capture_output=True, text=True, check=False)


@pytest.mark.pages
def test_the_core_alone_converts_to_the_same_bytes(core: Path) -> None:
    scenario, _ = xl.write_template("cut-in", core)
    done = run(core, "convert", scenario.name, "-o", "alone.xosc", "--seed", "3", "--time-limit", "12")
    assert done.returncode == 0, done.stderr
    xl.convert(scenario, core / "with.xosc", seed=3, time_limit=12.0)
    assert (core / "alone.xosc").read_bytes() == (core / "with.xosc").read_bytes().replace(b"with.xosc", b"alone.xosc")


def test_the_core_alone_has_its_own_verbs(core: Path) -> None:
    shown = run(core, "--help")
    assert shown.returncode == 0, shown.stderr
    listed = {line.split()[0] for line in shown.stdout.partition("Commands:")[2].splitlines() if line.strip()}
    assert listed == VERBS.keys() - offered("VERBS").keys()
    assert "No such command 'close-loop'" in run(core, "close-loop").stderr
