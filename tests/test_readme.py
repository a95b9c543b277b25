"""The README's commands run as printed, one after another, in a new shell, as a reader pastes them."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.docs.printed import difference

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```sh\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)


def commands() -> list[str]:
    """Lines of the shell blocks as printed; `make` is what runs these tests."""
    lines = [line for block in BLOCKS for line in block.splitlines()]
    return [line for line in lines if line.strip() and not line.startswith("make ")]


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What `make demo` leaves: the project's files, and an environment to activate."""
    folder = tmp_path_factory.mktemp("checkout")
    for name in ("examples", "driver_profiles", "templates"):
        (folder / name).symlink_to(ROOT / name)
    activate = folder / ".venv" / "bin" / "activate"
    activate.parent.mkdir(parents=True)
    activate.write_text(f'export PATH="{Path(sys.executable).parent}:$PATH"\n')
    return folder


def test_the_first_commands_set_up_check_and_activate():
    said = [line.split("#")[0].split() for line in BLOCKS[0].splitlines()]
    assert said == [["make", "demo"], ["make", "test"], ["source", ".venv/bin/activate"]]


@pytest.mark.pages
@pytest.mark.slow
def test_every_command_runs_as_printed_in_a_new_shell(checkout):
    lines = commands()
    assert len(lines) > 6
    script = "\n".join(["set -e", *(f"echo '$ {line}'\n{line}" for line in lines)])
    home = {"HOME": str(checkout), "PATH": "/usr/bin:/bin", "LANG": "C.UTF-8", "OMP_NUM_THREADS": "1"}
    cache = {name: os.environ[name] for name in ("NUMBA_CACHE_DIR", "MPLCONFIGDIR", "PYTHONPATH") if name in os.environ}
    run = subprocess.run(
        ["bash", "-c", script], cwd=checkout, env=home | cache, capture_output=True, text=True, timeout=900, check=False
    )
    assert run.returncode == 0, f"{run.stdout}\n{run.stderr}"
    for written in re.findall(r"(?:-o|--report) (\S+)", "\n".join(lines)):
        assert (checkout / written).exists(), written
    report = json.loads((checkout / "out" / "loop" / "report.json").read_text())
    assert "curvature" in {column for finding in report["findings"] for column in finding["columns"]}
    assert report["error"]["after"] < report["error"]["before"]
    shown = re.search(r"^```output\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)
    assert shown is not None, "the README shows what close-loop prints of these drives"
    printed = re.search(r"^\$ xosc-lateral close-loop [^\n]*\n(.*?)^\$ ", run.stdout, flags=re.DOTALL | re.MULTILINE)
    assert printed is not None
    assert difference(shown[1], printed[1], last_digit=1) is None, printed[1]


def test_the_python_lines_are_python():
    for block in re.findall(r"^```python\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE):
        compile(block, "README.md", "exec")


def test_the_page_of_a_package_index_has_only_links_that_work_there():
    """Hatch puts the README through these substitutions; a relative link would lead nowhere."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    text = README
    for change in project["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]["substitutions"]:
        text = re.sub(change["pattern"], change["replacement"], text)
    links = re.findall(r"\]\(([^)]*)\)", text)
    assert links and all(link.startswith("https://") for link in links)
    for target in re.findall(r"\]\((?!https?:)([^)#]+)\)", re.sub(r"!\[.*", "", README)):
        assert f"`{target}" in text, "what a link within the project led to is still named"
