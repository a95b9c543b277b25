"""Planning: which outputs, where, with which settings."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest

from xosc_lateral.base.errors import DriverProfileError, FormatError
from xosc_lateral.files.openscenario.write.draft import Player
from xosc_lateral.files.profiles import SHIPPED
from xosc_lateral.workflows.batch.jobs import Batch, _rounded, plan_batch
from xosc_lateral.workflows.batch.request import DocumentKind, Request, document_kind
from xosc_lateral.workflows.conversion.settings import ConvertSettings

SCENARIO = "<OpenSCENARIO><FileHeader/><RoadNetwork/><Entities/><Storyboard/></OpenSCENARIO>"
CATALOG = '<!-- Storyboard --><OpenSCENARIO><FileHeader/><Catalog name="Vehicles"/></OpenSCENARIO>'
CONVERTED = SCENARIO.replace("<FileHeader/>", '<FileHeader description="Cut-in [xosc-lateral: seed 0]"/>')
VARIED = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="1"/><ParameterDeclarations>
<ParameterDeclaration name="Speed" parameterType="double" value="20"/></ParameterDeclarations>
<RoadNetwork/><Entities/><Storyboard/></OpenSCENARIO>"""
DISTRIBUTION = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="1"/><ParameterValueDistribution>
<ScenarioFile filepath="x.xosc"/><Deterministic><DeterministicSingleParameterDistribution parameterName="Speed">
<DistributionSet><Element value="10"/><Element value="30"/></DistributionSet>
</DeterministicSingleParameterDistribution></Deterministic></ParameterValueDistribution></OpenSCENARIO>"""


@pytest.fixture
def database(tmp_path: Path) -> Path:
    folder = tmp_path / "db"
    for name in ("a/x.xosc", "a/b/y.xosc", "z.XOSC"):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(SCENARIO)
    (folder / "Catalogs").mkdir()
    (folder / "Catalogs" / "Vehicles.xosc").write_text(CATALOG)
    (folder / ".hidden").mkdir()
    (folder / ".hidden" / "h.xosc").write_text(SCENARIO)
    (folder / "notes.txt").write_text("no scenario")
    return folder


def names(batch: Batch) -> list[str]:
    return [job.name for job in batch.jobs]


def test_the_output_tree_mirrors_a_folder(database: Path, tmp_path: Path) -> None:
    batch = plan_batch([database], tmp_path / "out")
    assert names(batch) == ["a/b/y.xosc", "a/x.xosc", "z.XOSC"]
    assert [job.scenario for job in batch.jobs] == names(batch)
    assert batch.jobs[0].output == tmp_path / "out" / "a" / "b" / "y.xosc"
    assert [(path.name, kind) for path, kind in batch.left_out] == [("Vehicles.xosc", DocumentKind.CATALOG)]


def test_what_was_converted_before_is_left_out_where_it_is_found(database: Path, tmp_path: Path) -> None:
    (database / "z_lifelike.xosc").write_text(CONVERTED)
    batch = plan_batch([database], tmp_path / "out")
    assert names(batch) == ["a/b/y.xosc", "a/x.xosc", "z.XOSC"]
    assert DocumentKind.CONVERTED in {kind for _, kind in batch.left_out}
    assert names(plan_batch([database / "z_lifelike.xosc"], tmp_path / "out")) == ["z_lifelike.xosc"]


def test_outputs_inside_the_input_folder_are_no_inputs_of_the_next_run(database: Path) -> None:
    for folder in ("out", "other"):
        (database / folder).mkdir()
        (database / folder / "x.xosc").write_text(SCENARIO)
    (database / "other" / "manifest.parquet").write_text("of another batch")
    assert names(plan_batch([database], database / "out")) == ["a/b/y.xosc", "a/x.xosc", "z.XOSC"]


def test_globs_keep_their_layout_and_files_their_names(
    database: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert names(plan_batch([f"{database}/**/?.xosc"], tmp_path / "out")) == ["a/b/y.xosc", "a/x.xosc"]
    assert names(plan_batch([database / "a/b/y.xosc"], tmp_path / "out")) == ["y.xosc"]
    assert names(plan_batch([database / "a/b/y.xosc", database / "z.XOSC"], tmp_path / "out")) == [
        "a/b/y.xosc",
        "z.XOSC",
    ]
    monkeypatch.chdir(database)
    assert names(plan_batch(["a/*.xosc"], tmp_path / "out")) == ["x.xosc"]


def test_an_input_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match=r"gone: no such file or folder"):
        plan_batch([tmp_path / "gone"], tmp_path / "out")
    with pytest.raises(FormatError, match=r"\*\.xosc: nothing matches"):
        plan_batch([f"{tmp_path}/*.xosc"], tmp_path / "out")
    with pytest.raises(DriverProfileError, match="nobody"):
        plan_batch([], tmp_path / "out", ConvertSettings(profile="nobody"))


def test_an_output_never_replaces_an_input(database: Path) -> None:
    with pytest.raises(FormatError, match=r"x\.xosc: is an input: choose another output folder"):
        plan_batch([database / "a" / "x.xosc"], database / "a")


def test_variants_are_numbered_and_their_fingerprints_differ(database: Path, tmp_path: Path) -> None:
    batch = plan_batch([database / "z.XOSC"], tmp_path / "out", variants=3)
    assert names(batch) == ["z_01.XOSC", "z_02.XOSC", "z_03.XOSC"]
    assert [job.variant for job in batch.jobs] == [0, 1, 2]
    assert not any(job.labels or job.page for job in batch.jobs), "unless asked for"
    assert len({job.fingerprint for job in batch.jobs}) == 3


def test_what_is_named_twice_is_converted_once_unless_settings_differ(database: Path, tmp_path: Path) -> None:
    assert len(plan_batch([database, database / "a" / "x.xosc"], tmp_path / "out").jobs) == 3
    requests = [Request(database / "z.XOSC", ConvertSettings(seed=seed), label=f"_{seed}") for seed in (1, 2, 1)]
    batch = plan_batch(requests, tmp_path / "out")
    assert [(job.name, job.settings.seed) for job in batch.jobs] == [("z_1.XOSC", 1), ("z_2.XOSC", 2)]
    unnamed = [Request(database / "z.XOSC", ConvertSettings(seed=seed)) for seed in (1, 2)]
    with pytest.raises(FormatError, match=r"written twice: .* with other settings; a column `name` tells them apart"):
        plan_batch(unnamed, tmp_path / "out")


def test_one_more_row_renames_no_other_output_and_a_name_is_taken_as_it_is(database: Path, tmp_path: Path) -> None:
    table = database / "t.csv"
    rows = ["z.XOSC,,,", "z.XOSC,motorway-vehicle-1,,", "z.XOSC,motorway-vehicle-1,2,", "z.XOSC,,3,own"]

    def outputs(*lines: str) -> dict[tuple[str, int], str]:
        table.write_text("\n".join(["scenario,profile,seed,name", *lines]) + "\n")
        jobs = plan_batch([table], tmp_path / "out").jobs
        return {(str(job.settings.profile), job.settings.seed): job.name for job in jobs}

    named = outputs(*rows)
    assert named["auto", 0] == "z.XOSC" and named["motorway-vehicle-1", 0] == "z_motorway-vehicle-1.XOSC"
    assert named["auto", 3] == "own.XOSC"
    assert re.fullmatch(r"z_motorway-vehicle-1_[0-9a-f]{8}\.XOSC", named["motorway-vehicle-1", 2])
    assert outputs("z.XOSC,,9,", *reversed(rows)).items() > named.items()
    for row in rows:
        assert outputs(row).items() <= named.items()
    with pytest.raises(FormatError, match=r"t\.csv:2: name '\.\./evil': expected the name of a file"):
        outputs("z.XOSC,,1,../evil")


def test_a_distribution_stands_for_its_scenarios(tmp_path: Path) -> None:
    (tmp_path / "x.xosc").write_text(VARIED)
    (tmp_path / "speeds.xosc").write_text(DISTRIBUTION)
    batch = plan_batch([tmp_path / "speeds.xosc"], tmp_path / "out")
    assert [(job.name, job.scenario, dict(job.settings.parameters)) for job in batch.jobs] == [
        ("speeds_p00000.xosc", "x.xosc", {"Speed": "10"}),
        ("speeds_p00001.xosc", "x.xosc", {"Speed": "30"}),
    ]


def test_a_distribution_that_can_not_be_read_costs_one_row(tmp_path: Path) -> None:
    (tmp_path / "speeds.xosc").write_text(DISTRIBUTION)
    batch = plan_batch([tmp_path / "speeds.xosc"], tmp_path / "out")
    assert "scenario file 'x.xosc' does not exist" in batch.jobs[0].error


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_a_table_gives_each_scenario_its_settings(database: Path, tmp_path: Path, suffix: str) -> None:
    (database / "mine.json").write_text("{}")
    table = pd.DataFrame(
        {
            "scenario": ["a/x.xosc", "z.XOSC"],
            "profile": ["mine.json", None],
            "profile:Ego": [None, "mine.json"],
            "seed": [None, 7],
            "variants": [2, None],
            "parameter:Speed": [None, 33.5],
            "parameters": ['{"Gap": 2, "Name": "x"}', None],
            "only": [None, "Ego; Truck"],
            "user:tag": ["cut-in", "jam"],
        }
    )
    path = database / f"table{suffix}"
    table.to_csv(path, index=False) if suffix == ".csv" else table.to_parquet(path)
    jobs = plan_batch([path], tmp_path / "out", ConvertSettings(seed=5)).jobs
    assert [re.sub("_[0-9a-f]{8}", "_#", job.name) for job in jobs] == [
        "a/x_mine_#_01.xosc",
        "a/x_mine_#_02.xosc",
        "z_#.XOSC",
    ]
    first, last = jobs[0].settings, jobs[2].settings
    assert (first.profile, first.seed, first.only) == (str(database / "mine.json"), 5, None)
    assert first.parameters == {"Gap": "2", "Name": "x"}
    assert (last.profile, last.seed, last.only) == ("auto", 7, {"Ego", "Truck"})
    assert last.entity == {"Ego": str(database / "mine.json")}
    assert last.parameters == {"Speed": "33.5"}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("file,seed\nx.xosc,1\n", r"t\.csv:1: no column 'scenario'; there are file, seed"),
        (
            "scenario,output\nx.xosc,y\n",
            r"t\.csv:1: unknown column 'output'; there are scenario, profile, seed",
        ),
        ("scenario,seed\nx.xosc,1\ny.xosc,one\n", r"t\.csv:3: seed 'one' is not a whole number"),
        ("scenario,variants\nx.xosc,0\n", r"t\.csv:2: variants 0, at least 1"),
        ("scenario,seed\n,1\n", r"t\.csv:2: no scenario"),
        ("scenario,parameters\nx.xosc,fast\n", r"t\.csv:2: parameters 'fast' is not a JSON object"),
    ],
)
def test_a_table_that_is_wrong_is_said_with_its_line(tmp_path: Path, table: str, message: str) -> None:
    (tmp_path / "t.csv").write_text(table)
    with pytest.raises(FormatError, match=message):
        plan_batch([tmp_path / "t.csv"], tmp_path / "out")


def test_the_fingerprint_follows_a_profiles_bytes_not_its_place(database: Path, tmp_path: Path) -> None:
    def fingerprint(profile: Path, **settings: object) -> str:
        made = ConvertSettings(profile=str(profile), **settings)  # type: ignore[arg-type]
        return plan_batch([database / "z.XOSC"], tmp_path / "out", made).jobs[0].fingerprint

    here, there = tmp_path / "here.json", tmp_path / "there.json"
    here.write_text("{}")
    there.write_text("{}")
    assert fingerprint(here) == fingerprint(there)
    assert fingerprint(here) != fingerprint(here, seed=1)
    assert fingerprint(here) != fingerprint(here, parameters={"Speed": "1"})
    targets = ((Player.ESMINI, None), (Player.CARLA, None), (Player.ESMINI, "1.2"))
    assert len({fingerprint(here, player=player, version=version) for player, version in targets}) == 3
    roads = [tmp_path / "a.xodr", tmp_path / "b.xodr"]
    for road in roads:
        road.write_text(road.name)
    assert len({fingerprint(here, road=road) for road in (None, *roads)}) == 3, "another road is another output"
    before = fingerprint(here)
    here.write_text('{"changed": true}')
    assert fingerprint(here) != before


def test_kinds_of_documents_are_told_by_their_elements(tmp_path: Path) -> None:
    path = tmp_path / "x.xosc"
    for text, kind in (
        (SCENARIO, DocumentKind.SCENARIO),
        (CATALOG, DocumentKind.CATALOG),
        (DISTRIBUTION, DocumentKind.DISTRIBUTION),
        (CONVERTED, DocumentKind.CONVERTED),
        ("no xml", DocumentKind.SCENARIO),
        ("", DocumentKind.SCENARIO),
        (DISTRIBUTION[:30], DocumentKind.SCENARIO),
    ):
        path.write_text(text)
        assert document_kind(path) is kind


def test_a_profile_that_hides_a_shipped_one_is_said_and_makes_other_outputs(database: Path, tmp_path: Path) -> None:
    team = tmp_path / "team"
    team.mkdir()
    settings = ConvertSettings(library=(team,))
    before = plan_batch([database], tmp_path / "out", settings)
    assert before.notes == ()
    shutil.copy(SHIPPED / "motorway-vehicle-1.json", team)  # auto does not choose this one
    assert plan_batch([database], tmp_path / "out", settings).jobs == before.jobs
    shutil.copy(SHIPPED / "rural.json", team / "motorway.json")
    after = plan_batch([database], tmp_path / "out", settings)
    assert after.notes == (f"{team}/motorway.json hides the shipped profile 'motorway': auto takes it",)
    assert after.jobs[0].fingerprint != before.jobs[0].fingerprint
    named = replace(settings, profile="motorway-vehicle-1")
    assert plan_batch([database], tmp_path / "out", named).notes == ()


def test_cells_that_name_no_file_are_refused_in_a_line(database: Path, tmp_path: Path) -> None:
    table = tmp_path / "rows.csv"
    table.write_bytes(b"scenario,profile\ndb/a/x.xosc,\ndb/a/\0y.xosc,\n")
    with pytest.raises(FormatError, match=r"rows\.csv:3: .*zero byte"):
        plan_batch([table], tmp_path / "out")
    table.write_text(f"scenario,profile\ndb/a/x.xosc,{'p' * 5000}\n")
    assert len(names(plan_batch([table], tmp_path / "out"))[0]) < 30  # the conversion says what is wrong


def test_numbers_of_a_manifest_are_to_a_millionth() -> None:
    assert (_rounded(1.23456749), _rounded(-0.00000051)) == (1.234567, -0.000001)
