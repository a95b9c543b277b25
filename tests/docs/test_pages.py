"""The documentation is true: pages run as shown from an empty folder, commands exist, links lead somewhere.

Blocks marked ``sh`` and ``python`` of the pages in `RUN` are run in order, as a new user would from the page alone.
What they print is what a block ``output`` after them shows, to the digit. Every other block is in `NOT_RUN`, with the
reason; commands of this project in those, and in the running text, are run up to where the work would begin.
"""

from __future__ import annotations

import argparse
import re
import runpy
import shlex
import sys
from importlib.util import find_spec
from pathlib import Path
from urllib.parse import unquote

import pytest

from tests.docs.pictures import require_pictures
from tests.docs.printed import difference
from xosc_lateral.cli import main, verb

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(
    path.relative_to(ROOT).as_posix()
    for path in [*DOCS.rglob("*.md"), *ROOT.glob("*.md"), *ROOT.glob("laboratory/**/README.md")]
)
RUN = (
    "quickstart.md",
    "gallery.md",
    "tutorials/test_data_engineer.md",
    "tutorials/researcher.md",
    "how_to/detect.md",
    "how_to/effect.md",
    "how_to/importer.md",
    "how_to/carla.md",
    "how_to/derive_a_driver.md",
    "how_to/esmini.md",
    "how_to/from_a_recording.md",
    "live.md",
    "how_to/osi.md",
    "pipeline.md",
    "api.md",
)
RECORDING, SIMULATOR, HOUR = "a recording that is not shipped", "another program", "an hour of work"
EXCERPT = "an excerpt or a drawing: nothing to run"
NOT_RUN = {
    ("docs/closing_the_loop.md", "mean offset by curvature"): "README's own, compared there",
    ("docs/formats.md", "encoding"): EXCERPT,
    ("docs/how_to/carla.md", "python scenario_runner.py"): SIMULATOR,
    ("docs/how_to/detect.md", "xosc-lateral detect recording.csv"): RECORDING,
    ("docs/how_to/detect.md", "xosc-lateral detect out/cut-in.xosc drives.csv"): "a detector of the reader's own",
    ("docs/how_to/detect.md", "xosc-lateral vary cut-in.xosc --like motorway --replace"): RECORDING,
    ("docs/how_to/detect.md", '{"time"'): EXCERPT,
    (
        "docs/how_to/detect.md",
        "xosc-lateral detect dense-traffic.xosc --sight",
    ): "minutes of rays; `test_sight` runs it",
    ("docs/design/offset_chains.md", "<Vertex"): EXCERPT,
    ("docs/how_to/esmini.md", "esmini --window"): SIMULATOR,
    ("docs/how_to/esmini.md", "esmini --headless"): SIMULATOR,
    ("docs/how_to/esmini.md", "ESMINI_LIBRARY="): SIMULATOR,
    ("docs/how_to/esmini.md", "4.0 s: ego"): SIMULATOR,
    ("docs/how_to/from_a_recording.md", "xosc-lateral reconstruct tasi"): RECORDING,
    ("docs/how_to/from_a_recording.md", "xosc-lateral convert a39/"): RECORDING,
    ("docs/how_to/from_a_recording.md", "xosc-lateral fit drives.csv"): RECORDING,
    ("docs/live.md", "once per step"): EXCERPT,
    ("docs/pipeline.md", "scenario,profile"): EXCERPT,
    ("docs/plugins.md", "[project.entry-points"): EXCERPT,
    ("docs/quickstart.md", "pip install"): "an installation, from a registry",
    ("docs/real_data.md", "pip download"): RECORDING,
    ("docs/validation/board.md", "python -m"): HOUR,
    ("docs/validation/detectors.md", "python -m"): HOUR,
    ("docs/validation/phone.md", "python -m"): RECORDING,
}
"""Page and beginning of a block -> why no test runs it."""

BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", flags=re.DOTALL | re.MULTILINE)


def blocks(page: str) -> list[tuple[str, str]]:
    return BLOCK.findall((ROOT / page).read_text(encoding="utf-8"))


def run_line(line: str) -> None:
    program, *arguments = shlex.split(line.split("  #")[0])
    assert program == "xosc-lateral"
    assert main(arguments) == 0, line


@pytest.mark.pages
@pytest.mark.slow
@pytest.mark.parametrize("page", RUN)
def test_page_runs_and_prints_as_shown(page, tmp_path, monkeypatch, capsys):
    if page == "how_to/osi.md":
        pytest.importorskip("osi_utilities", reason="extra `osi` is not installed")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(ROOT / "examples"))  # its driver simulator
    names: dict[str, object] = {"__name__": page}
    shown = [(kind, text) for kind, text in blocks(f"docs/{page}") if kind in ("sh", "python", "output")]
    assert shown
    capsys.readouterr()
    for kind, text in shown:
        if kind == "output":
            printed = capsys.readouterr().out
            assert difference(text, printed) is None, printed
            continue
        capsys.readouterr()
        if kind == "python":
            exec(compile(text, page, "exec"), names)
        else:
            for line in filter(None, map(str.strip, text.splitlines())):
                run_line(line)
    lines = "\n".join(text for kind, text in shown if kind == "sh")
    for target in re.findall(r"(?:-o|--report) (\S+)", lines):
        written = Path(target)
        assert written.exists() or list(written.parent.glob(f"{written.stem}_*{written.suffix}")), target
    require_pictures((DOCS / page).read_text(encoding="utf-8"), tmp_path, DOCS / "figures" / "made")


@pytest.mark.lint
def test_every_block_is_run_or_says_why_not():
    run = {"README.md", *(f"docs/{page}" for page in RUN)}
    rest = [
        (page, text.strip())
        for page in PAGES
        if page == "README.md" or page.startswith("docs/")
        for kind, text in blocks(page)
        if page not in run or kind not in ("sh", "python", "output")
    ]
    reasons = [[key for key in NOT_RUN if key[0] == page and text.startswith(key[1])] for page, text in rest]
    assert [block for block, keys in zip(rest, reasons, strict=True) if len(keys) != 1] == []
    assert set(NOT_RUN) == {key for keys in reasons for key in keys}, "a reason without a block"


RUN_WHOLE = {
    (page, "python examples/simulated_drives.py out/drives") for page in ("README.md", "docs/closing_the_loop.md")
}
"""Scripts without arguments that could be looked at: `make pages` runs them."""


class BegunError(Exception):
    """The arguments are read and checked; the work would begin."""


def begun_commands() -> list[tuple[str, str]]:
    """Commands of this project, in blocks and in the text: `make pages` runs those of `RUN` whole."""
    found = []
    for page in [page for page in PAGES if page != "CHANGELOG.md"]:  # it names commands in short
        lines = [
            line.split("  #")[0]
            for kind, text in blocks(page)
            if kind in ("", "sh", "text")
            for line in text.splitlines()
        ]
        prose = BLOCK.sub("", (ROOT / page).read_text(encoding="utf-8"))
        lines += re.findall(r"`((?:python|make) [^`]+)`", prose)
        found += [(page, line.strip()) for line in lines if re.match(r"(xosc-lateral|python|make) ", line)]
    return sorted(each for each in set(found) if each not in RUN_WHOLE)


@pytest.mark.lint
def test_commands_that_take_long_are_accepted(tmp_path, monkeypatch):
    """Their programs exist and take every option and value; the work itself is left to other tests."""
    refused = []
    for page, line in begun_commands():
        with monkeypatch.context() as patched:
            try:
                begin(line, tmp_path, patched)
            except (Exception, SystemExit, pytest.fail.Exception) as error:
                refused.append(f"{page}: {line}: {error!r}")
    assert not refused, "\n".join(refused)


def begin(line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a command up to where the work would begin."""
    program, *words = shlex.split(re.split(r"\s[|>]\s", line)[0].replace("...", ""))
    if program == "make":
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        assert re.search(rf"^{re.escape(words[0])}:[^\n]*\n\t", makefile, flags=re.MULTILINE), f"no target {words[0]}"
    elif program == "python":
        begin_script(words, monkeypatch)
    else:
        monkeypatch.chdir(tmp_path)
        parse_verb(words)


def begin_script(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a benchmark or an example until its arguments are parsed; of others, look whether they are there."""
    if words[0] == "-m" and not words[1].startswith("laboratory."):
        assert words[1] == "build" or find_spec(words[1])
        assert all((ROOT / word).exists() for word in words if word.startswith("tests/"))
        return
    if words[0] == "scenario_runner.py":  # CARLA's
        return
    parse = argparse.ArgumentParser.parse_args

    def stop(parser, *given, **named):
        parse(parser, *given, **named)
        raise BegunError

    monkeypatch.setattr(argparse.ArgumentParser, "parse_args", stop)
    monkeypatch.setattr(sys, "argv", words[1:] if words[0] == "-m" else words)
    monkeypatch.syspath_prepend(str(ROOT))
    with pytest.raises(BegunError):
        if words[0] == "-m":
            for module in (words[1], f"{words[1]}.__main__"):  # another page's benchmark may have imported it
                monkeypatch.delitem(sys.modules, module, raising=False)
            runpy.run_module(words[1], run_name="__main__")
        else:
            monkeypatch.syspath_prepend(str((ROOT / words[0]).parent))
            runpy.run_path(str(ROOT / words[0]), run_name="__main__")


def parse_verb(words: list[str]) -> None:
    """Let the command line read the words as it would, values and file names included."""
    for word in words:
        if Path(word).suffix and not word.startswith("-"):
            Path(word).parent.mkdir(parents=True, exist_ok=True)
            Path(word).touch()
    command = verb(words.pop(0))
    while hasattr(command, "commands"):
        command = command.commands[words.pop(0)]
    command.make_context(command.name, words)


def test_a_difference_is_the_line_that_is_not_printed():
    assert difference("a 1.0 m\n...\nc (p = 1e-9)", "a 1.03 m\nb\nb\nc (p = 1.4e-9)") is None
    assert difference("a 1.0 m", "a 1.1 m") == "a 1.0 m"
    assert difference("a 1.0 m", "a 1.1 m", last_digit=1) is None
    assert difference("p = 1e-9", "p = 2e-9") == "p = 1e-9"
    assert difference("a\n...\nc", "a\nb") == "c"
    assert difference("lane -1", "lane 1") == "lane -1"
    assert difference("a", "a\nb") == "more is printed: b"


@pytest.mark.lint
def test_links_lead_somewhere():
    texts = {page: BLOCK.sub("", (ROOT / page).read_text(encoding="utf-8")) for page in PAGES}
    links = [
        (page, target)
        for page, text in texts.items()
        for target in re.findall(r"\]\((?!https?:|mailto:)([^)#\s]+)", text)
    ]
    assert len(links) > 100
    assert [link for link in links if not ((ROOT / link[0]).parent / unquote(link[1])).exists()] == []


@pytest.mark.lint
def test_files_that_contributing_names_are_there():
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    named = [name for name in re.findall(r"`([\w./]+(?:\.py|\.md|\.json|/))`", text) if "NAME" not in name]
    found = [ROOT / name if (ROOT / name).exists() else ROOT / "xosc_lateral" / name for name in named]
    assert len(named) > 40
    assert [path for path in found if not path.exists()] == []


@pytest.mark.lint
def test_every_page_is_in_the_menu():
    menu = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    missing = [page for page in PAGES if page.startswith("docs/") and page.removeprefix("docs/") not in menu]
    assert missing == []


@pytest.mark.pages
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
    assert "--attempts" in reference and "close-loop" in reference
    python = (tmp_path / "site" / "reference" / "api.html").read_text(encoding="utf-8")
    assert "convert_many" in python and "time_limit" in python
