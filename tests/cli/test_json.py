"""Every `--json` is what its schema in the docs says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from examples.driver_simulator import simulate_drive, simulate_population
from tests.kit.profiles import REFINED
from xosc_lateral.cli import main
from xosc_lateral.extras.dossier import measures

SCHEMAS = Path(__file__).resolve().parents[2] / "docs" / "schemas"
LISTED = (SCHEMAS.parent / "json.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("json")
    assert main(["template", "write", "cut-in", "-o", str(folder / "in"), "-q"]) == 0
    (folder / "in" / "broken.xosc").write_text("<a")
    simulate_population(3, duration=300.0, seed=2).to_csv(folder / "drives.csv", index=False)
    short = simulate_drive(200.0, seed=3).table
    short[["time", "distance_left", "distance_right", "speed", "curvature"]].to_csv(folder / "short.csv", index=False)
    return folder


def objects(capsys: pytest.CaptureFixture[str], code: int, *words: str) -> list[dict[str, Any]]:
    capsys.readouterr()
    assert main([*words, "--json"]) == code
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def holds(value: dict[str, Any], name: str) -> None:
    Draft202012Validator(json.loads((SCHEMAS / f"{name}.json").read_text(encoding="utf-8"))).validate(value)


def test_every_schema_is_one_and_is_listed():
    found = sorted(SCHEMAS.glob("*.json"))
    assert len(found) >= 20
    for path in found:
        Draft202012Validator.check_schema(json.loads(path.read_text(encoding="utf-8")))
        assert f"schemas/{path.name}" in LISTED


@pytest.mark.pages
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("convert", "convert in/cut-in.xosc -o one.xosc --report one.html --time-limit 5"),
        (
            "convert",
            f"convert in/cut-in.xosc -o two.xosc --ego none --enrich Ego --profile {REFINED} --time-limit 5",
        ),
        ("play", "states in/cut-in.xosc -o states.csv --time-limit 1"),
        ("segments", "segments in/cut-in.xosc"),
        ("dossier", "dossier motorway -o dossier.html"),
        ("sample", "sample -p motorway --duration 20 -o offsets.csv"),
        ("sample", "sample -p motorway --like drives.csv -o snippets.parquet"),
        ("check", "check short.csv"),
        ("fit", "fit drives.csv -o fitted.json"),
        ("evaluate", "evaluate drives.csv -p motorway --no-classify"),
        ("detect", "detect in/cut-in.xosc drives.csv --variants 1 --report detection.html -o detection.csv"),
        ("close-loop", "close-loop short.csv -o refined.json --report loop"),
        ("template-list", "template list"),
        ("template-write", "template write curves -o written --set radius=800"),
        ("profiles-list", "profiles list"),
        ("profiles-show", f"profiles show {REFINED}"),
        ("profiles-compare", "profiles compare motorway motorway-vehicle-1"),
        ("profiles-derive", "profiles derive motorway-vehicle-1 --preset drowsy -o derived.json"),
    ],
    ids=lambda value: value.replace(" ", "_")[:40],
)
def test_output_is_what_its_schema_says(name, words, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(measures, "COMPUTED", ())  # half a minute of a dossier: its own tests look at that
    (value,) = objects(capsys, 0, *words.split())
    holds(value, name)


def test_what_works_on_what_was_written_before_is_what_its_schema_says(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    for name, words in [
        ("convert", "convert in/cut-in.xosc -o written.xosc --time-limit 5"),
        ("verify", "verify written.xosc"),
        ("verify", "reproduce written.xosc -o again.xosc"),
        ("profiles-add", "profiles add motorway --library lib --name mine"),
        ("profiles-list", "profiles list --library lib"),
        ("profiles-tag", "profiles tag mine --library lib --tag night --set country=DE"),
        ("profiles-export", "profiles export mine motorway --library lib -o exported/"),
        ("profiles-check", "profiles check --library lib"),
        ("profiles-rename", "profiles rename mine ours --library lib"),
        ("profiles-remove", "profiles remove ours --library lib"),
    ]:
        (value,) = objects(capsys, 0, *words.split())
        holds(value, name)


def test_a_batch_is_json_lines(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    *outputs, summary = objects(capsys, 1, "convert", "in", "-o", "batch", "--time-limit", "5")
    assert len(outputs) == 2
    for value in outputs:
        holds(value, "batch-output")
    holds(summary, "batch-summary")
    assert (summary["failed"], summary["written"]) == (1, 1)
    (value,) = objects(capsys, 0, "profiles", "uses", "motorway", "batch")
    holds(value, "profiles-uses")
    assert [use["is_current"] for use in value["outputs"]] == [True]


@pytest.mark.parametrize(
    "words",
    ["segments in/broken.xosc", "segments nowhere.xosc", "profiles show nobody", "fit in/cut-in.xosc -o x.json"],
    ids=["broken", "missing", "unknown", "no_table"],
)
def test_errors_are_objects(words, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    (value,) = objects(capsys, 1, *words.split())
    holds(value, "error")
