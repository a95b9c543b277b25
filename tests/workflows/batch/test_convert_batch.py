"""Batches on the real converter, and from the command line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from lxml import etree

import xosc_lateral as xl
from tests.kit.profiles import simulated_profile
from tests.workflows.batch.test_batch import tree
from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.files.profiles import write_profile
from xosc_lateral.files.source import file_hash
from xosc_lateral.files.templates import find_template
from xosc_lateral.workflows.batch.batch import JobState, convert_many
from xosc_lateral.workflows.batch.jobs import plan_batch
from xosc_lateral.workflows.batch.manifest import MANIFEST
from xosc_lateral.workflows.conversion.settings import ConvertSettings


@pytest.fixture(scope="module")
def profile(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("profile") / "simulated.json"
    write_profile(simulated_profile(), path)
    return str(path)


@pytest.fixture
def database(tmp_path: Path) -> Path:
    """Two scenarios in folders of their own, and one that can't be played."""
    for template in ("cut-in", "curves"):
        folder = tmp_path / "db" / template
        folder.mkdir(parents=True)
        for file, text in find_template(template).files({}).items():
            (folder / file).write_text(text, encoding="utf-8")
    (tmp_path / "db" / "broken.xosc").write_text("<OpenSCENARIO>\n<FileHeader/></OpenSCENARIO>")
    return tmp_path / "db"


@pytest.fixture
def run(database: Path, profile: str, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    def convert(*arguments: str) -> tuple[int, str, str]:
        code = main(["convert", *arguments, "--profile", profile, "--seed", "3"])
        return code, *capsys.readouterr()

    return convert


def test_a_folder_becomes_a_folder_with_a_manifest(database: Path, tmp_path: Path, run) -> None:
    code, out, errors = run(str(database), "-o", str(tmp_path / "out"), "--variants", "2")
    assert code == 1  # the broken one
    assert "4 written, 2 failed of 6" in out
    assert errors.count("xosc-lateral: ") == errors.count("broken.xosc") == 1  # one line for both variants
    rows = pd.read_parquet(tmp_path / "out" / MANIFEST).set_index("output")
    assert list(rows.index[rows.error == ""]) == [
        "curves/curves_01.xosc",
        "curves/curves_02.xosc",
        "cut-in/cut-in_01.xosc",
        "cut-in/cut-in_02.xosc",
    ]
    row = rows.loc["cut-in/cut-in_02.xosc"]
    assert row.output_sha256 == file_hash(tmp_path / "out" / "cut-in" / "cut-in_02.xosc")
    assert row.scenario_sha256 == file_hash(database / "cut-in" / "cut-in.xosc")
    assert row.road_sha256 == file_hash(database / row.road)
    assert json.loads(row.inputs)["cut-in/cut-in.xosc"] == row.scenario_sha256
    assert (row.seed, row.variant) == (3, 2)
    assert set(json.loads(row.profiles).values()) == set(json.loads(row.profile_sha256)) == {simulated_profile().name}
    assert len(row.enriched) > 0
    assert row.segment_seconds > 5.0
    assert 0.02 < row.offset_spread < 1.0
    assert row.gap_after > 0.0
    assert rows.output_sha256[rows.error == ""].is_unique
    assert not [path for path in (tmp_path / "out").rglob("*") if path.name.startswith(".")]


def test_roads_and_catalogs_resolve_from_where_the_output_is(database: Path, tmp_path: Path, profile: str) -> None:
    xl.convert_many(database, tmp_path / "else" / "where" / "out", profile=profile, workers=0, time_limit=2.0)
    outputs = sorted((tmp_path / "else").rglob("*.xosc"))
    assert len(outputs) == 2
    for output in outputs:
        road = etree.parse(output).getroot().find(".//LogicFile").get("filepath")
        assert not Path(road).is_absolute()
        assert (output.parent / road).resolve() == next((database / output.stem).glob("*.xodr"))


def test_two_processes_leave_the_same_bytes_as_one_and_a_second_run_nothing(
    database: Path, tmp_path: Path, profile: str, run
) -> None:
    xl.convert_many(database, tmp_path / "one", profile=profile, seed=3, workers=0, time_limit=4.0)
    run(str(database), "-o", str(tmp_path / "two"), "--jobs", "2", "--quiet", "--time-limit", "4")
    one = tree(tmp_path / "one")
    assert one == tree(tmp_path / "two")
    code, out, _ = run(str(database), "-o", str(tmp_path / "one"), "--json", "--time-limit", "4")
    *outputs, summary = map(json.loads, out.splitlines())
    assert code == 1
    assert {(row["kind"], row["output"]) for row in outputs} >= {("output", "broken.xosc")}
    assert (len(outputs), summary["kind"]) == (3, "summary")
    assert (summary["written"], summary["up_to_date"], summary["failed"]) == (0, 2, 1)
    assert summary["failures"][0]["output"] == "broken.xosc"
    assert tree(tmp_path / "one") == one


def test_a_variant_is_what_the_single_conversion_writes(database: Path, tmp_path: Path, profile: str, run) -> None:
    options = {"profile": profile, "seed": 3, "ego": "none", "time_limit": 10.0}
    xl.convert_many(database / "cut-in", tmp_path / "batch", variants=2, workers=0, **options)
    (tmp_path / "single").mkdir()
    source, single_output = database / "cut-in" / "cut-in.xosc", tmp_path / "single" / "cut-in.xosc"
    code, *_ = run(
        str(source), "-o", str(single_output), "--variants", "2", "--ego", "none", "--time-limit", "10", "--quiet"
    )
    assert code == 0
    single = {path.name: path.read_bytes() for path in (tmp_path / "single").glob("*.xosc")}
    batch = {path.name: path.read_bytes() for path in (tmp_path / "batch").glob("*.xosc")}
    assert len(batch) == 2
    assert single == batch


def test_changed_roads_and_catalogs_are_noticed(database: Path, tmp_path: Path, profile: str) -> None:
    def states() -> list[JobState]:
        batch = plan_batch([database / "cut-in"], tmp_path / "out", ConvertSettings(profile=profile))
        return [outcome.state for outcome in convert_many(batch, workers=0)]

    assert states() == [JobState.WRITTEN]
    assert states() == [JobState.UP_TO_DATE]
    road = next((database / "cut-in").glob("*.xodr"))
    road.write_text(road.read_text() + "<!-- surveyed again -->")
    assert states() == [JobState.WRITTEN]


def test_a_context_that_can_not_be_read_costs_one_row(database: Path, tmp_path: Path, profile: str) -> None:
    scenario, name_too_long = str(database / "cut-in" / "cut-in.xosc"), tmp_path / f"{'n' * 300}.csv"
    table = pd.DataFrame({"scenario": [scenario] * 2, "name": ["one", "two"], "context": ["", str(name_too_long)]})
    result = xl.convert_many(table, tmp_path / "out", profile=profile, workers=0)
    assert result.failed == 1 and (tmp_path / "out" / "one.xosc").is_file()


def test_the_log_is_json_and_wrong_usage_is_2(database: Path, tmp_path: Path, run) -> None:
    code, _, errors = run(str(database / "cut-in"), "-o", str(tmp_path / "out"), "--json", "--verbose")
    assert code == 0
    events = [json.loads(line)["event"] for line in errors.splitlines()]
    assert [event for event in events if event != "log"] == ["start", "written", "end"]
    code, _, errors = run(str(database))
    assert code == 2
    assert "several scenarios need a folder" in errors
    code, _, errors = run(str(database / "*.nothing"), "-o", str(tmp_path / "out"))
    assert code == 1
    assert errors.endswith("nothing matches\n")
    assert errors.count("\n") == 1


def test_a_file_in_the_place_of_the_output_folder_is_one_line(database: Path, tmp_path: Path, run) -> None:
    (tmp_path / "out").write_text("mine")
    code, _, errors = run(str(database / "cut-in"), "-o", str(tmp_path / "out"), "--jobs", "2")
    assert code == 1
    assert errors.count("\n") == 1
    assert (tmp_path / "out").read_text() == "mine"


def test_inputs_that_change_during_a_run_are_stated_as_they_were_read(tmp_path: Path, profile: str) -> None:
    source, out = tmp_path / "db", tmp_path / "out"
    source.mkdir()
    for file, text in find_template("cut-in").files({}).items():
        (source / file).write_text(text, encoding="utf-8")
    scenario, road = source / "cut-in.xosc", source / "cut-in.xodr"
    for copy in ("a.xosc", "b.xosc", "c.xosc"):
        (source / copy).write_bytes(scenario.read_bytes())
    scenario.unlink()
    settings = ConvertSettings(profile=profile, time_limit=2.0)
    before = file_hash(road), file_hash(source / "a.xosc")
    outcomes = convert_many(plan_batch([source], out, settings), workers=0)
    for number, outcome in enumerate(outcomes):
        assert outcome.state is JobState.WRITTEN
        if number == 0:  # others look at the same road, and at a scenario that was planned as it was
            road.write_text(road.read_text().replace("<header", "<!-- moved --><header"))
            (source / "c.xosc").write_text(
                (source / "c.xosc").read_text().replace("<FileHeader", "<!-- --><FileHeader")
            )
    rows = pd.read_parquet(out / MANIFEST).set_index("output")
    assert (rows.road_sha256["a.xosc"], rows.scenario_sha256["a.xosc"]) == before
    assert rows.road_sha256["b.xosc"] == rows.road_sha256["c.xosc"] == file_hash(road) != before[0]
    assert rows.scenario_sha256["c.xosc"] == file_hash(source / "c.xosc")
    again = {one.row.output: one.state for one in convert_many(plan_batch([source], out, settings), workers=0)}
    assert again == {"a.xosc": JobState.WRITTEN, "b.xosc": JobState.UP_TO_DATE, "c.xosc": JobState.UP_TO_DATE}


def test_a_result_reads_its_rows_from_the_manifest(database: Path, tmp_path: Path, profile: str) -> None:
    told: list[dict] = []
    options = {"profile": profile, "time_limit": 2.0, "workers": 0}
    result = xl.convert_many(database / "curves", tmp_path / "out", on_outcome=told.append, **options)
    assert result.to_dict()["outputs"] == told
    result = xl.convert_many(database, tmp_path / "out", on_outcome=told.append, **options)
    frame = result.to_frame()
    assert frame["output"].tolist() == ["broken.xosc", "curves/curves.xosc", "cut-in/cut-in.xosc"]
    assert frame["state"].tolist() == ["failed", "written", "written"]
    (tmp_path / "out" / MANIFEST).unlink()
    with pytest.raises(FormatError, match=r"manifest\.parquet: is gone"):
        result.to_frame()


def test_a_profile_for_a_name_counts_where_there_is_one_and_what_is_left_out_is_counted(tmp_path: Path) -> None:
    """The truck of one scenario has another name; two catalogs and an output lie beside them."""
    scenario, _ = xl.write_template("cut-in", tmp_path / "in")
    text = scenario.read_text(encoding="utf-8")
    scenario.with_name("other.xosc").write_text(text.replace("Truck", "Lorry"), encoding="utf-8")
    catalog = (
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2024-01-01T00:00:00" description="" author=""/>'
    )
    for name in ("a", "b"):
        path = scenario.with_name(f"{name}.xosc")
        path.write_text(f'{catalog}<Catalog name="{name}"></Catalog></OpenSCENARIO>', encoding="utf-8")
    xl.convert(scenario, scenario.with_name("made.xosc"), time_limit=1.0)
    options = {"entity": {"Truck": "rural"}, "time_limit": 1.0}
    made = xl.convert_many(tmp_path / "in", tmp_path / "out", workers=0, **options)
    assert made.failed == 0
    rows = pd.read_parquet(tmp_path / "out" / "manifest.parquet").set_index("output")
    drivers = [json.loads(profiles) for profiles in rows.profiles[["cut-in.xosc", "other.xosc"]]]
    assert (drivers[0]["Truck"], drivers[1]["Lorry"]) == ("rural", "motorway")
    assert "; left out: 2 catalogs, 1 converted scenario" in str(made).splitlines()[0]
    with pytest.raises(xl.XoscLateralError, match="Truck"):
        xl.convert(scenario.with_name("other.xosc"), tmp_path / "one.xosc", **options)
