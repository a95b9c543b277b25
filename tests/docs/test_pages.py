"""The documentation is true: pages run as shown from an empty folder, commands exist, links lead somewhere.

Blocks marked ``sh`` and ``python`` of the pages in `RUN` are run in order, as a new user would from the page alone.
Blocks marked ``text`` are for other programs, or take too long; their commands are only looked up.
"""

from __future__ import annotations

import re
import shlex
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote

import pytest
from typer.main import get_command

from xosc_lateral.cli import app, main

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path.relative_to(ROOT).as_posix() for path in [*DOCS.rglob("*.md"), ROOT / "README.md"])
RUN = (
    "quickstart.md",
    "tutorials/scenario_engineer.md",
    "tutorials/test_data_engineer.md",
    "tutorials/pipeline_owner.md",
    "tutorials/researcher.md",
    "how_to/effect.md",
    "how_to/importer.md",
)
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)


def blocks(page: str) -> list[tuple[str, str]]:
    return BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))


def commands(page: str) -> list[str]:
    """Lines that call the command line, in blocks of any kind but Python's."""
    lines = [line for kind, text in blocks(page) if kind != "python" for line in text.replace("\\\n", " ").splitlines()]
    lines = [line.split("  #")[0].strip() for line in lines]
    return [line for line in lines if line.startswith("xosc-lateral ")]


def run_line(line: str) -> None:
    program, *arguments = shlex.split(line.split("  #")[0])
    assert program == "xosc-lateral"
    assert main(arguments) == 0, line


@pytest.mark.slow
@pytest.mark.parametrize("page", RUN)
def test_page_runs_as_shown(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {"__name__": page}
    shown = [(kind, text) for kind, text in blocks(f"docs/{page}") if kind in ("sh", "python")]
    assert shown
    for kind, text in shown:
        if kind == "python":
            exec(compile(text, page, "exec"), names)
        else:
            for line in filter(None, map(str.strip, text.splitlines())):
                run_line(line)
    lines = "\n".join(text for kind, text in shown if kind == "sh")
    for target in re.findall(r"(?:-o|--report) (\S+)", lines):
        written = Path(target)
        assert written.exists() or list(written.parent.glob(f"{written.stem}_*{written.suffix}")), target


@pytest.mark.parametrize("page", PAGES)
def test_commands_and_options_exist(page):
    root = get_command(app)
    for line in commands(page):
        words = shlex.split(re.split(r"\s[|>]\s", line)[0])[1:]
        if words[0].isupper() or words[0].startswith("-"):
            continue  # `xosc-lateral VERB --help`
        command = root.commands[words.pop(0)]
        if hasattr(command, "commands") and words and not words[0].startswith("-"):
            command = command.commands[words.pop(0)]
        known = {name for option in command.params for name in (*option.opts, *option.secondary_opts)} | {
            "--help",
            "-h",
        }
        assert {word.split("=")[0] for word in words if re.match(r"--?[a-z]", word)} <= known, line


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    path = ROOT / page
    text = BLOCK.sub("", path.read_text(encoding="utf-8"))
    for target in re.findall(r"\]\((?!https?:|mailto:)([^)#\s]+)", text):
        assert (path.parent / unquote(target)).exists(), f"{page}: {target}"


def test_every_page_is_in_the_menu():
    menu = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    missing = [page for page in PAGES if page.startswith("docs/") and page.removeprefix("docs/") not in menu]
    assert missing == []


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path, monkeypatch):
    if find_spec("mkdocs") is None or find_spec("material") is None or find_spec("mkdocstrings") is None:
        pytest.skip("mkdocs-material and mkdocstrings are not installed (extra docs)")
    import subprocess
    import sys

    monkeypatch.setenv("NO_MKDOCS_2_WARNING", "1")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    reference = (tmp_path / "site" / "reference" / "cli.html").read_text(encoding="utf-8")
    assert "--resample" in reference and "close-loop" in reference
    python = (tmp_path / "site" / "reference" / "api.html").read_text(encoding="utf-8")
    assert "convert_many" in python and "time_limit" in python
