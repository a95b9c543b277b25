"""The README's commands run as shown, one after another, from an empty folder beside the project's files."""

from __future__ import annotations

import re
import runpy
import shlex
from pathlib import Path

import pytest

from xosc_lateral.cli import main

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def commands() -> list[str]:
    """Lines of the shell blocks, without comments; `make` is what runs these tests."""
    blocks = re.findall(r"^```sh\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)
    lines = [line.split("  #")[0].strip() for block in blocks for line in block.splitlines()]
    return [line for line in lines if line and not line.startswith("make ")]


def test_the_first_two_commands_are_make_demo_and_make_test():
    first_block = re.search(r"^```sh\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)
    assert first_block is not None
    assert [line.split("#")[0].split() for line in first_block[1].splitlines()] == [["make", "demo"], ["make", "test"]]


@pytest.mark.slow
def test_every_command_runs_as_shown(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert len(commands()) > 8
    for line in commands():
        program, *arguments = shlex.split(line)
        if program == "python":
            runpy.run_path(str(ROOT / arguments[0]))["main"](*map(Path, arguments[1:]))
        else:
            assert program == "xosc-lateral"
            assert main(arguments) == 0, f"{line}\n{capsys.readouterr().err}"
    for written in re.findall(r"(?:-o|--report) (\S+)", "\n".join(commands())):
        assert Path(written).exists(), written


@pytest.mark.parametrize("target", sorted(set(re.findall(r"\]\((?!https?:)([^)#]+)\)", README))))
def test_links_lead_somewhere(target):
    assert (ROOT / target).exists()
