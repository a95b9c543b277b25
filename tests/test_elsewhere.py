"""Files for running it elsewhere: what they call is run, and what they promise is in them."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

import xosc_lateral as xl
from xosc_lateral.cli import main

yaml = pytest.importorskip("yaml", reason="comes with dask and mkdocs, not by itself")
ROOT = Path(__file__).resolve().parents[1]


def commands(text: str) -> list[list[str]]:
    return [shlex.split(found.partition(";")[0]) for found in re.findall(r"xosc-lateral ((?:convert|verify) .*)", text)]


@pytest.mark.parametrize("name", ["github", "gitlab"])
def test_a_workflow_is_yaml_and_its_commands_work_in_their_order(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (ROOT / "examples" / "ci" / f"{name}.yml").read_text(encoding="utf-8")
    assert yaml.safe_load(text)
    check, convert = commands(text)
    monkeypatch.chdir(tmp_path)
    xl.write_template("cut-in", "scenarios")
    assert main([*convert, "--time-limit", "3"]) == 0
    assert main(check) == 0, "committed outputs that hold"
    assert {path.name for path in Path().glob("*/*.xosc")} == {"cut-in.xosc"} and list(Path("reports").glob("*.html"))


def test_hooks_name_commands_that_there_are_and_the_files_that_they_are_for(tmp_path: Path) -> None:
    hooks = {one["id"]: one for one in yaml.safe_load((ROOT / ".pre-commit-hooks.yaml").read_text(encoding="utf-8"))}
    scenario, _ = xl.write_template("cut-in", tmp_path)
    xl.convert_many([scenario], tmp_path / "out", time_limit=3.0)
    xl.convert(scenario, tmp_path / "cut-in_lifelike.xosc", time_limit=3.0)
    verify = hooks["xosc-lateral-verify"]
    for path, wanted in (("out/manifest.parquet", True), ("cut-in_lifelike.xosc", True), ("cut-in.xosc", False)):
        assert bool(re.search(verify["files"], path)) is wanted
        assert main([*verify["entry"].split()[1:], str(tmp_path / path)]) == (0 if wanted else 1)
    profiles = hooks["xosc-lateral-profiles"]
    assert main([*profiles["entry"].split()[1:], "--library", str(ROOT / profiles["args"][1])]) == 0


def test_the_container_runs_as_nobody_special_and_copies_files_that_there_are() -> None:
    text = (ROOT / "Containerfile").read_text(encoding="utf-8")
    first, last = text.split("\nFROM ")[1:]
    assert re.search(r"^USER \d{4,}$", last, re.MULTILINE) and "RUN pip" not in last
    for line in re.findall(r"^COPY (?!--from)(.*)$", first, re.MULTILINE):
        assert all((ROOT / source).exists() for source in line.split()[:-1])
