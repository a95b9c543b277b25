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
from xosc_lateral.scenario.stochastic import Stochastic

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
    assert main([*words, "--ego", "none", "--seed", "4", "--time-limit", str(END), "-q"]) == 0
    return folder


def _assert_valid(path: Path, version: str) -> None:
    schema = etree.XMLSchema(etree.parse(str(XSD / f"OpenSCENARIO-{version}.xsd")))
    schema.assertValid(etree.parse(str(path)))


def test_the_files_of_a_set_are_valid(folder: Path) -> None:
    for path in folder.glob("out/x_[!0]*.xosc"), folder.glob("out/x_trajectories/*.xosc"):
        for file in path:
            minor = etree.parse(str(file)).getroot().find("FileHeader").get("revMinor")
            _assert_valid(file, SCHEMAS[minor])


@pytest.mark.parametrize("drawn_by", ["distribution", "stochastic"])
def test_every_draw_is_played_as_the_variant_that_it_stands_for(folder: Path, drawn_by: str) -> None:
    logical = read_distribution(folder / "out" / f"x_{drawn_by}.xosc")
    sets = list(logical.parameter_sets())
    assert len(sets) == 3
    for values in sets:
        assert list(values) == ["variant"]  # one parameter chooses everything: any tool may draw it by itself
        drawn = play_scenario(logical.scenario_file, parameters=values, time_limit=END).motion
        number = values["variant"].removeprefix("variant_")
        alone = play_scenario(folder / "out" / f"x_{number}.xosc", time_limit=END).motion
        for one, other in zip(drawn.entities, alone.entities, strict=True):
            assert np.array_equal(one.x, other.x) and np.array_equal(one.y, other.y)
            assert np.array_equal(one.heading, other.heading)


def test_a_distribution_goes_through_all_variants_and_they_differ(folder: Path) -> None:
    logical = read_distribution(folder / "out" / "x_distribution.xosc")
    sets = list(logical.parameter_sets())
    assert [values["variant"] for values in sets] == ["variant_01", "variant_02", "variant_03"]
    played = [play_scenario(logical.scenario_file, parameters=values, time_limit=END).motion for values in sets]
    for moment in (0, -1):
        assert len({float(motion.entities[0].y[moment]) for motion in played}) == 3


def test_draws_follow_the_weights(folder: Path) -> None:
    paths = [folder / "out" / f"x_0{k}.xosc" for k in (1, 2, 3)]
    source = folder / "in" / "cut-in.xosc"
    output = folder / "out" / "weighted.xosc"
    drawn = xl.variant_set(paths, output, source=source, weights=[3, 0, 1])
    distribution = read_distribution(drawn.stochastic).distribution
    assert isinstance(distribution, Stochastic)
    assert distribution.seed == 4
    rng = np.random.default_rng(1)
    names = [distribution.sample(rng)["variant"] for _ in range(400)]
    assert "variant_02" not in names
    assert names.count("variant_01") == pytest.approx(300, abs=4 * np.sqrt(400 * 0.75 * 0.25))
    for wrong in ([1.0], [-1.0, 1.0, 1.0], [0.0, 0.0, 0.0]):
        with pytest.raises(ValueError, match="one per variant"):
            xl.variant_set(paths, output, source=source, weights=wrong)
    for path in (drawn.logical, drawn.distribution, drawn.stochastic):
        path.unlink()


def test_the_same_seed_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    words = ["convert", str(folder / "in" / "cut-in.xosc"), "-o", str(tmp_path / "x.xosc"), "--variants", "3"]
    assert main([*words, "--ego", "none", "--seed", "4", "--time-limit", str(END), "-q"]) == 0
    for part in ("x_distribution.xosc", "x_stochastic.xosc", "x_trajectories/variant_02.xosc"):
        assert (tmp_path / part).read_bytes() == (folder / "out" / part).read_bytes()


@pytest.mark.parametrize("drawn_by", ["distribution", "stochastic"])
def test_converting_a_distribution_makes_the_variants_again_byte_for_byte(
    folder: Path, tmp_path: Path, drawn_by: str
) -> None:
    path = folder / "out" / f"x_{drawn_by}.xosc"
    words = ["convert", str(path), "-o", str(tmp_path / "again"), "--seed", "4"]
    # The road lies beside the source, whose folder is one of those around the set.
    assert main([*words, "--ego", "none", "--time-limit", str(END), "-q"]) == 0
    for k, values in enumerate(read_distribution(path).parameter_sets()):
        again = tmp_path / "again" / f"x_{drawn_by}_p0000{k}.xosc"
        first = folder / "out" / f"x_{values['variant'].removeprefix('variant_')}.xosc"
        # The file's references lead to the road from another folder.
        assert _without_road(again.read_bytes()) == _without_road(first.read_bytes())


def _without_road(data: bytes) -> list[bytes]:
    return [line for line in data.splitlines() if b"LogicFile" not in line and b"SceneGraphFile" not in line]


def test_a_set_found_in_a_folder_is_left_out_as_what_was_converted(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(xl.FormatError, match="left out"):
        xl.convert_many(folder / "out", tmp_path / "none")


@pytest.mark.parametrize("words", [["--mode", "lane-offset"], ["--for", "carla"]])
def test_there_is_no_set_where_none_can_be_drawn(folder: Path, tmp_path: Path, words: list[str]) -> None:
    source = str(folder / "in" / "cut-in.xosc")
    output = str(tmp_path / "y.xosc")
    assert (
        main(["convert", source, "-o", output, "--variants", "2", "--ego", "none", "--time-limit", "3", "-q", *words])
        == 0
    )
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
    other = xl.convert(source, folder / "out" / "other.xosc", time_limit=3.0, ego="none").output
    assert other is not None
    with pytest.raises(xl.FormatError, match="not a variant of the same scenario"):
        xl.variant_set([folder / "out" / "x_01.xosc", other], folder / "out" / "z.xosc", source=source)
    assert not (folder / "out" / "z_set.xosc").exists()
    other.unlink()


def test_a_set_of_version_1_0_is_one_of_1_1(folder: Path, tmp_path: Path) -> None:
    source = str(folder / "in" / "cut-in.xosc")
    words = ["convert", source, "-o", str(tmp_path / "x.xosc"), "--variants", "2", "--version", "1.0", "-q"]
    assert main([*words, "--ego", "none", "--time-limit", "3"]) == 0
    for part in ("x_set", "x_distribution", "x_stochastic", "x_trajectories/variant_01"):
        _assert_valid(tmp_path / f"{part}.xosc", "1.1.1")


def test_trajectories_that_others_follow_stay_within_reach(folder: Path, tmp_path: Path) -> None:
    source, catalogs = tmp_path / "in.xosc", tmp_path / "paths"
    catalogs.mkdir()
    vertices = "".join(
        f'<Vertex time="{k}"><Position><WorldPosition x="{500 + 20 * k}" y="-2"/></Position></Vertex>' for k in range(9)
    )
    trajectory = f'<Trajectory name="own" closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory>'
    head = '<FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" author="" description=""/>'
    (catalogs / "ways.xosc").write_text(
        f'<OpenSCENARIO>{head}<Catalog name="ways">{trajectory}</Catalog></OpenSCENARIO>'
    )
    follow = """<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>
        <CatalogReference catalogName="ways" entryName="own"/></TrajectoryRef><TimeReference><None/></TimeReference>
        <TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>"""
    tree = etree.parse(str(folder / "in" / "cut-in.xosc"))
    truck = tree.find(".//Private[@entityRef='Truck']")
    truck.append(etree.fromstring(follow))
    locations = tree.find("CatalogLocations")
    locations.append(etree.fromstring('<TrajectoryCatalog><Directory path="paths"/></TrajectoryCatalog>'))
    tree.write(str(source))
    (tmp_path / "cut-in.xodr").write_bytes((folder / "in" / "cut-in.xodr").read_bytes())
    words = ["convert", str(source), "-o", str(tmp_path / "x.xosc"), "--variants", "2", "-q"]
    assert main([*words, "--ego", "none", "--time-limit", "3"]) == 0
    for values in read_distribution(tmp_path / "x_distribution.xosc").parameter_sets():
        motion = play_scenario(tmp_path / "x_set.xosc", parameters=values, time_limit=3.0).motion
        assert next(entity for entity in motion.entities if entity.name == "Truck").y[-1] == pytest.approx(-2)


def test_a_scenario_may_have_a_parameter_of_that_name(folder: Path, tmp_path: Path) -> None:
    text = (folder / "in" / "cut-in.xosc").read_text(encoding="utf-8")
    own = '<ParameterDeclarations><ParameterDeclaration name="variant" parameterType="string" value="mine"/>'
    source = tmp_path / "in.xosc"
    source.write_text(text.replace("<ParameterDeclarations>", own), encoding="utf-8")
    (tmp_path / "cut-in.xodr").write_bytes((folder / "in" / "cut-in.xodr").read_bytes())
    output = tmp_path / "x.xosc"
    assert (
        main(["convert", str(source), "-o", str(output), "--variants", "2", "--ego", "none", "--time-limit", "3", "-q"])
        == 0
    )
    first, second = read_distribution(tmp_path / "x_distribution.xosc").parameter_sets()
    assert (first["variant_2"], second["variant_2"]) == ("variant_01", "variant_02")
    again = ["convert", str(tmp_path / "x_distribution.xosc"), "-o", str(tmp_path / "again"), "--time-limit", "3", "-q"]
    assert main(again) == 0
