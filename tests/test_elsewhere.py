"""Files for running it elsewhere: what they call is run, and what they promise is in them."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
import tomllib
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


@pytest.mark.pages
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


def test_the_conda_recipe_says_what_pyproject_says() -> None:
    recipe = yaml.safe_load((ROOT / "packaging" / "recipe.yaml").read_text(encoding="utf-8"))
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert recipe["package"] == {"name": project["name"], "version": project["version"]}
    python, *needed = (one.replace(" ", "") for one in recipe["requirements"]["run"])
    assert (python, needed) == (f"python{project['requires-python']}", project["dependencies"])
    entries = [f"{name} = {target}" for name, target in project["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == entries


@pytest.mark.pages
def test_the_action_runs_as_bash_runs_it(tmp_path: Path) -> None:
    """Its steps but for the installation, in their order, with their environment; no input becomes code."""
    action = yaml.safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
    stated = {"scenarios": "in", "output": "out it", "options": "--seed 2 --variants 2 --time-limit 3", "shard": "1/1"}
    assert stated.keys() <= action["inputs"].keys() and action["runs"]["using"] == "composite"
    xl.write_template("cut-in", tmp_path / "in")
    environment = {"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin", "GITHUB_OUTPUT": str(tmp_path / "said")}
    steps = [step for step in action["runs"]["steps"] if "pip install" not in step.get("run", "pip install")]
    for step in (*steps, *steps):  # on the second run there is something to verify
        assert "${{" not in step["run"]
        names = {name: re.findall(r"inputs\.(\w+)", value)[0] for name, value in step["env"].items()}
        subprocess.run(
            ["bash", "-e", "-o", "pipefail", "-c", step["run"]], cwd=tmp_path, check=True,
            env=environment | {name: stated[wanted] for name, wanted in names.items()},
        )  # fmt: skip
    assert len(list((tmp_path / "out it").glob("*.xosc"))) == 2
    assert (tmp_path / "said").read_text().splitlines() == ["manifest=out it/manifest.parquet"] * 2


def test_a_wheel_has_every_folder_that_the_package_asks_for() -> None:
    build = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]
    packed = build["targets"]["wheel"]["force-include"]
    sources = [path.read_text(encoding="utf-8") for path in (ROOT / "xosc_lateral").rglob("*.py")]
    asked = {name for text in sources for name in re.findall(r'shipped_folder\("(\w+)"\)', text)}
    assert {Path(path).parts[0] for path in packed} == asked >= {"docs", "driver_profiles", "templates"}
    assert all((ROOT / path).exists() and place.endswith(path) for path, place in packed.items())
