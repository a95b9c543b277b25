"""One scenario through the whole chain: template in, trajectories out, played again."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from tests.kit.profiles import simulated_profile
from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import main
from xosc_lateral.files.profiles import write_profile
from xosc_lateral.files.templates import TEMPLATES, find_template
from xosc_lateral.workflows.conversion.conversion import Conversion
from xosc_lateral.workflows.conversion.convert import convert, convert_scenario
from xosc_lateral.workflows.conversion.load import play_scenario
from xosc_lateral.workflows.conversion.settings import ConvertSettings
from xosc_lateral.world.motion.nominal import Activity

FIELD = Path(__file__).resolve().parents[4] / "shared" / "corpus" / "esmini" / "xosc"


@pytest.fixture(scope="module")
def profile(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("profile") / "simulated.json"
    write_profile(simulated_profile(), path)
    return str(path)


def _template(folder: Path, name: str, **settings: str) -> Path:
    for file, text in find_template(name).files(settings).items():
        (folder / file).write_text(text, encoding="utf-8")
    return folder / f"{name}.xosc"


def _convert(folder: Path, name: str, profile: str, **settings: str) -> Conversion:
    source = _template(folder, name, **settings)
    return convert_scenario(source, folder / "out.xosc", ConvertSettings(profile=profile, seed=7, ego=frozenset()))


@pytest.mark.parametrize("traffic", ["right", "left"])
@pytest.mark.parametrize("name", [template.name for template in TEMPLATES])
def test_the_output_played_again_is_where_it_was_written_to_5_cm(
    tmp_path: Path, profile: str, name: str, traffic: str
) -> None:
    conversion = _convert(tmp_path, name, profile, traffic=traffic)
    again = {entity.name: entity for entity in play_scenario(conversion.output).motion.entities}
    assert any(entity.is_enriched for entity in conversion.movement.entities)
    for entity in conversion.movement.entities:
        path, replay = entity.trajectory, again[entity.name]
        assert replay.time[-1] == pytest.approx(path.time[-1], abs=0.03)
        n = min(len(path.time), len(replay.time))
        there = (entity.motion.activity[:n] & Activity.ACTIVE) != 0
        apart = np.hypot(replay.x[:n] - path.x[:n], replay.y[:n] - path.y[:n])
        assert apart[there].max() < 0.0501  # mostly along the road, in the last moment before a stop


def test_same_inputs_and_seed_give_the_same_bytes_and_another_seed_does_not(tmp_path: Path, profile: str) -> None:
    source = _template(tmp_path, "cut-in")
    first = convert_scenario(source, tmp_path / "out.xosc", ConvertSettings(profile=profile, seed=1)).sha256
    again = convert_scenario(source, tmp_path / "out.xosc", ConvertSettings(profile=profile, seed=1)).sha256
    other = convert_scenario(source, tmp_path / "out.xosc", ConvertSettings(profile=profile, seed=2)).sha256
    variant = convert_scenario(source, tmp_path / "out.xosc", ConvertSettings(profile=profile, seed=1), variant_index=1)
    assert first == again
    assert len({first, other, variant.sha256}) == 3
    assert variant.sha256 == hashlib.sha256((tmp_path / "out.xosc").read_bytes()).hexdigest()


def test_a_converted_file_is_not_converted_again(tmp_path: Path, profile: str) -> None:
    conversion = _convert(tmp_path, "cut-in", profile)
    with pytest.raises(FormatError, match=r"converted by xosc-lateral already; convert cut-in\.xosc instead"):
        convert_scenario(conversion.output, tmp_path / "twice.xosc", ConvertSettings(profile=profile))
    assert not (tmp_path / "twice.xosc").exists()


def test_entities_are_chosen_and_driven_as_the_user_says(tmp_path: Path, profile: str) -> None:
    source = _template(tmp_path, "cut-in")
    names = [entity.name for entity in play_scenario(source).scenario.entities]
    settings = ConvertSettings(entity={names[0]: profile}, only=frozenset({names[0]}), ego=frozenset())
    conversion = convert_scenario(source, tmp_path / "out.xosc", settings)
    enriched = {entity.name: entity.is_enriched for entity in conversion.movement.entities}
    assert enriched == {name: name == names[0] for name in names}
    with pytest.raises(FormatError, match="no such entity"):
        convert_scenario(source, tmp_path / "out.xosc", ConvertSettings(profile=profile, only=frozenset({"nobody"})))


def test_provenance_names_seed_profile_version_and_the_hash_of_every_input(tmp_path: Path, profile: str) -> None:
    conversion = _convert(tmp_path, "curves", profile)
    text = conversion.output.read_text(encoding="utf-8")
    for path in tmp_path.glob("*.xodr"):
        assert hashlib.sha256(path.read_bytes()).hexdigest() in text
    assert conversion.provenance.options["seed"] == 7
    assert all(digest in text for _, digest in conversion.provenance.profiles.values())


@pytest.mark.pages
def test_the_command_line_writes_variants_and_reports_and_says_where(
    tmp_path: Path, profile: str, capsys: pytest.CaptureFixture[str]
) -> None:
    source = _template(tmp_path, "braking-leader")
    arguments = ["convert", str(source), "-o", str(tmp_path / "v.xosc"), "--profile", profile, "--variants", "2"]
    assert main([*arguments, "--report", str(tmp_path / "r.html"), "--json"]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [Path(line["output"]).name for line in lines] == ["v_01.xosc", "v_02.xosc"]
    assert (tmp_path / "v_01.xosc").read_bytes() != (tmp_path / "v_02.xosc").read_bytes()
    assert (tmp_path / "r_01.html").exists()
    assert (tmp_path / "r_02.html").exists()


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("", "empty"),
        ("this is no XML", "xml"),
        ('<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "b">]><OpenSCENARIO>&a;</OpenSCENARIO>', "entit"),
        ("<OpenSCENARIO/>", "FileHeader"),
    ],
    ids=["empty", "no XML", "entities", "bare"],
)
def test_bad_input_is_one_line_and_exit_1_and_nothing_is_written(
    tmp_path: Path, profile: str, capsys: pytest.CaptureFixture[str], content: str, words: str
) -> None:
    source = tmp_path / "bad.xosc"
    source.write_text(content, encoding="utf-8")
    assert main(["convert", str(source), "-o", str(tmp_path / "out.xosc"), "--profile", profile]) == 1
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert "bad.xosc" in said
    assert words.lower() in said.lower()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.xosc"]


def test_segments_are_listed_with_reasons(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = _template(tmp_path, "cut-in")
    assert main(["segments", str(source), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)["segments"]
    assert any(row["road_following"] for row in rows)
    assert any(row["why"] == "lateral action" for row in rows)


@pytest.mark.skipif(not FIELD.is_dir(), reason="the reference player's scenarios are not beside the checkout")
def test_a_truck_whose_trailers_come_from_a_catalog_follows_a_trajectory() -> None:
    """Their places are in the catalog's file, and nothing of the scenario's is taken out there."""
    made = convert(FIELD / "lane_change.xosc", mode="trajectory", time_limit=3.0, neighbours="none")
    assert made.modes == {"Truck": "trajectory"}
    assert made.to_scenariogeneration() is not None
