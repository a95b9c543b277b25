"""Variants as a logical scenario: valid, drawn from as any other, each draw what the variant is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lxml import etree

import xosc_lateral as xl
from xosc_lateral.cli import main
from xosc_lateral.formats.openscenario import read_distribution
from xosc_lateral.pipeline.load import play_scenario

XSD = Path(__file__).parents[1] / "data" / "xsd"
SCHEMAS = {"0": "1.0.0", "1": "1.1.1", "2": "1.2.0", "3": "1.3.0"}
END = 6.0
"""Of the runs. [s]"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A scenario, three variants of it, and their set."""
    folder = tmp_path_factory.mktemp("set")
    assert main(["template", "write", "cut-in", "-o", str(folder / "in"), "-q"]) == 0
    words = ["convert", str(folder / "in" / "cut-in.xosc"), "-o", str(folder / "out" / "x.xosc"), "--variants", "3"]
    assert main([*words, "--seed", "4", "--time-limit", str(END), "-q"]) == 0
    return folder


def test_the_files_of_a_set_are_valid(folder: Path) -> None:
    for part in ("set", "trajectories", "distribution"):
        root = etree.parse(str(folder / "out" / f"x_{part}.xosc")).getroot()
        minor = root.find("FileHeader").get("revMinor")
        etree.XMLSchema(etree.parse(str(XSD / f"OpenSCENARIO-{SCHEMAS[minor]}.xsd"))).assertValid(root)


def test_every_draw_is_played_as_the_variant_that_it_stands_for(folder: Path) -> None:
    logical = read_distribution(folder / "out" / "x_distribution.xosc")
    sets = list(logical.parameter_sets())
    assert [values["variant"] for values in sets] == ["1", "2", "3"]
    ends = []
    for values in sets:
        drawn = play_scenario(logical.scenario_file, parameters=values, time_limit=END).motion
        alone = play_scenario(folder / "out" / f"x_0{values['variant']}.xosc", time_limit=END).motion
        for one, other in zip(drawn.entities, alone.entities, strict=True):
            assert np.array_equal(one.x, other.x) and np.array_equal(one.y, other.y)
        ends.append(drawn.entities[0].y[-1])
    assert len({round(float(end), 3) for end in ends}) == 3


def test_converting_the_distribution_makes_the_variants_again_byte_for_byte(folder: Path, tmp_path: Path) -> None:
    words = ["convert", str(folder / "out" / "x_distribution.xosc"), "-o", str(tmp_path / "again"), "--seed", "4"]
    # The road lies beside the source, whose folder is one of those around the set.
    assert main([*words, "--time-limit", str(END), "-q"]) == 0
    for k in range(3):
        again = tmp_path / "again" / f"x_distribution_p0000{k}.xosc"
        first, second = (path.read_bytes() for path in (folder / "out" / f"x_0{k + 1}.xosc", again))
        # The file's references lead to the road from another folder.
        assert _without_road(second) == _without_road(first)


def _without_road(data: bytes) -> list[bytes]:
    return [line for line in data.splitlines() if b"LogicFile" not in line and b"SceneGraphFile" not in line]


def test_a_set_found_in_a_folder_is_left_out_as_what_was_converted(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(xl.FormatError, match="left out"):
        xl.convert_many(folder / "out", tmp_path / "none")


@pytest.mark.parametrize("words", [["--mode", "lane-offset"], ["--for", "carla"]])
def test_there_is_no_set_where_none_can_be_drawn(folder: Path, tmp_path: Path, words: list[str]) -> None:
    source = str(folder / "in" / "cut-in.xosc")
    output = str(tmp_path / "y.xosc")
    assert main(["convert", source, "-o", output, "--variants", "2", "--time-limit", "3", "-q", *words]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["y_01.xosc", "y_02.xosc"]


def test_a_set_replaces_nothing_of_others(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "x_set.xosc").write_text("<theirs/>")
    words = ["convert", str(folder / "in" / "cut-in.xosc"), "-o", str(tmp_path / "x.xosc"), "--variants", "2"]
    assert main(words) == 1
    assert "x_set.xosc: exists and was not written by xosc-lateral" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["x_set.xosc"]


def test_files_of_other_scenarios_are_no_variants(folder: Path, tmp_path: Path) -> None:
    assert main(["template", "write", "braking-leader", "-o", str(tmp_path), "-q"]) == 0
    source = tmp_path / "braking-leader.xosc"
    other = xl.convert(source, folder / "out" / "other.xosc", time_limit=3.0).output
    assert other is not None
    with pytest.raises(xl.FormatError, match="not a variant of the same scenario"):
        xl.variant_set([folder / "out" / "x_01.xosc", other], folder / "out" / "z.xosc", source=source)
    assert not (folder / "out" / "z_set.xosc").exists()
    other.unlink()


def test_a_set_of_version_1_0_has_a_distribution_of_1_1(folder: Path, tmp_path: Path) -> None:
    source = str(folder / "in" / "cut-in.xosc")
    words = ["convert", source, "-o", str(tmp_path / "x.xosc"), "--variants", "2", "--version", "1.0", "-q"]
    assert main([*words, "--time-limit", "3"]) == 0
    for part, version in (("set", "1.0.0"), ("trajectories", "1.0.0"), ("distribution", "1.1.1")):
        schema = etree.XMLSchema(etree.parse(str(XSD / f"OpenSCENARIO-{version}.xsd")))
        schema.assertValid(etree.parse(str(tmp_path / f"x_{part}.xosc")))


def test_a_scenario_may_have_a_parameter_of_that_name(folder: Path, tmp_path: Path) -> None:
    text = (folder / "in" / "cut-in.xosc").read_text(encoding="utf-8")
    own = '<ParameterDeclarations><ParameterDeclaration name="variant" parameterType="string" value="mine"/>'
    source = tmp_path / "in.xosc"
    source.write_text(text.replace("<ParameterDeclarations>", own), encoding="utf-8")
    (tmp_path / "cut-in.xodr").write_bytes((folder / "in" / "cut-in.xodr").read_bytes())
    output = tmp_path / "x.xosc"
    assert main(["convert", str(source), "-o", str(output), "--variants", "2", "--time-limit", "3", "-q"]) == 0
    first, second = read_distribution(tmp_path / "x_distribution.xosc").parameter_sets()
    assert (first["variant_2"], second["variant_2"]) == ("1", "2")
    again = ["convert", str(tmp_path / "x_distribution.xosc"), "-o", str(tmp_path / "again"), "--time-limit", "3", "-q"]
    assert main(again) == 0
