"""What a pipeline has in memory goes in and comes out as files do, and no file is touched."""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from lxml import etree
from scenariogeneration import xodr, xosc

import xosc_lateral as xl

SUV = b"""<OpenSCENARIO><FileHeader revMajor="1" revMinor="1" date="2026-01-01T00:00:00" description="" author=""/>
<Catalog name="VehicleCatalog"><Vehicle name="suv" vehicleCategory="car">
<BoundingBox><Center x="1.4" y="0" z="0.9"/><Dimensions width="2.0" length="4.9" height="1.8"/></BoundingBox>
<Performance maxSpeed="60" maxAcceleration="8" maxDeceleration="10"/>
<Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.7" trackWidth="1.7" positionX="2.9" positionZ="0.35"/>
<RearAxle maxSteering="0" wheelDiameter="0.7" trackWidth="1.7" positionX="0" positionZ="0.35"/></Axles>
<Properties/></Vehicle></Catalog></OpenSCENARIO>"""


def made(road_file: str = "road.xodr") -> tuple[xosc.Scenario, xodr.OpenDrive]:
    """A car on a straight road, as scenariogeneration's examples make one."""
    road = xodr.OpenDrive("road")
    road.add_road(xodr.create_road(xodr.Line(1500), id=0, left_lanes=0, right_lanes=2))
    road.adjust_roads_and_lanes()
    entities = xosc.Entities()
    entities.add_scenario_object("Car", xosc.CatalogReference("VehicleCatalog", "suv"))
    init = xosc.Init()
    step = xosc.TransitionDynamics(xosc.DynamicsShapes.step, xosc.DynamicsDimension.time, 1)
    init.add_init_action("Car", xosc.TeleportAction(xosc.LanePosition(20, 0, -1, 0)))
    init.add_init_action("Car", xosc.AbsoluteSpeedAction(30, step))
    end = xosc.ValueTrigger(
        "end", 0, xosc.ConditionEdge.none, xosc.SimulationTimeCondition(20, xosc.Rule.greaterThan), "stop"
    )
    catalogs = xosc.Catalog()
    catalogs.add_catalog("VehicleCatalog", "../Catalogs/Vehicles")
    scenario = xosc.Scenario(
        "drive", "me", xosc.ParameterDeclarations(), entities, xosc.StoryBoard(init, end),
        xosc.RoadNetwork(road_file), catalogs, osc_minor_version=1,
    )  # fmt: skip
    return scenario, road


def as_bytes(written) -> bytes:
    return ElementTree.tostring(written.get_element(), encoding="utf-8", xml_declaration=True)


@pytest.fixture(scope="module")
def template(tmp_path_factory) -> tuple[Path, Path]:
    scenario, road = xl.write_template("overtake-truck", tmp_path_factory.mktemp("template"))
    renamed = scenario.rename(scenario.with_name("scenario.xosc"))
    return renamed, road


@pytest.mark.pages
def test_every_kind_gives_the_bytes_that_its_file_gives(template):
    scenario, road = template
    expected = xl.convert(scenario, seed=3).data
    text, data = scenario.read_text(encoding="utf-8"), road.read_bytes()
    with scenario.open("rb") as binary, road.open(encoding="utf-8") as words:
        assert xl.convert(binary, road=words, seed=3).data == expected
    for one in (scenario.read_bytes(), bytearray(scenario.read_bytes()), text, io.StringIO(text)):
        assert xl.convert(one, road=data, seed=3).data == expected
    result = xl.convert(text, road={road.name: data}, seed=3)
    assert (result.data, result.road) == (expected, data)
    assert xl.convert(scenario, road={road.name: road}, seed=3).data == expected
    assert result.output is None
    for tree in (etree.parse(scenario), etree.parse(scenario).getroot(), ElementTree.parse(scenario)):
        frame, usual = xl.convert(tree, road=data, seed=3).to_frame(), result.to_frame()
        assert frame.equals(usual)


def test_a_scenario_just_made_is_converted_and_comes_back_as_such():
    scenario, road = made()
    result = xl.convert(scenario, road={"road.xodr": road, "VehicleCatalog.xosc": SUV}, seed=1)
    assert result.enriched == ("Car",)
    again = result.to_scenariogeneration()
    assert isinstance(again, xosc.Scenario)
    played = xl.play(again, road={"road.xodr": result.road, "VehicleCatalog.xosc": SUV})
    (there,), (wanted,) = (
        frame.loc[(frame["time"] - 10).abs() < 0.01, "y"] for frame in (played.to_frame(), result.to_frame())
    )
    assert there == pytest.approx(wanted, abs=0.02)


@pytest.mark.pages
def test_names_lead_where_the_scenario_says(template):
    text, road = template[0].read_text(encoding="utf-8"), template[1].read_bytes()
    moved = text.replace(f'"{template[1].name}"', '"../xodr/a &amp; b.xodr"')
    assert moved != text
    for given in (road, {"../xodr/a & b.xodr": road}):
        result = xl.convert(moved, road=given)
        assert b'filepath="../xodr/a &amp; b.xodr"' in result.data
        assert set(result.provenance.inputs) == {"scenario.xosc", "../xodr/a & b.xodr"}
    elsewhere = text.replace(f'"{template[1].name}"', '"C:/maps/town.xodr"')
    assert b'filepath="road.xodr"' in xl.convert(elsewhere, road=road).data


def test_other_verbs_take_the_same(template):
    scenario, road = template[0].read_bytes(), template[1].read_bytes()
    played = xl.play(scenario, road=road)
    assert played.to_frame().equals(xl.play(template[0]).to_frame())
    assert "<svg" in played.page() or "<canvas" in played.page()
    assert xl.segments(scenario, road=road).to_frame().equals(xl.segments(template[0]).to_frame())
    lifelike = xl.convert(scenario, road=road).data
    found = xl.detect([scenario, lifelike], road=road, ego="none", detectors="lateral-speed").to_frame()
    on_disk = xl.detect(template[0], ego="none", detectors="lateral-speed").to_frame()
    assert set(found["source"]) == {"scenario", "scenario_2"}
    assert found[found["source"] == "scenario"].reset_index(drop=True).equals(on_disk)


@pytest.mark.parametrize("verb", [xl.convert, xl.play, xl.segments, xl.detect])
@pytest.mark.parametrize("wrong", [42, None, {"a": b""}, object()])
def test_a_wrong_type_is_named_in_a_line(verb, wrong):
    with pytest.raises(TypeError, match=r"scenario: expected a path, bytes, XML text.* not "):
        verb(wrong)
    with pytest.raises(TypeError, match=r"road(\['a'\])?: expected a path, bytes"):
        verb(b"<OpenSCENARIO/>", road={"a": 1} if wrong is None else 7)


def test_what_is_not_given_is_not_looked_for_on_a_disk(template, monkeypatch):
    monkeypatch.chdir(template[1].parent)
    with pytest.raises(xl.FormatError, match=r"road file '.*': no such file or folder"):
        xl.convert(template[0].read_bytes())
    outside = template[0].read_text(encoding="utf-8").replace(f'"{template[1].name}"', f'"{template[1].as_posix()}"')
    with pytest.raises(xl.FormatError, match="outside the scenario's folders"):
        xl.convert(outside)


@pytest.mark.pages
def test_an_output_on_a_disk_keeps_references_and_is_verified_beside_its_files(template, tmp_path):
    scenario, road = (path.read_bytes() for path in template)
    result = xl.convert(scenario, tmp_path / "out.xosc", road=road, seed=2)
    (tmp_path / template[1].name).write_bytes(result.road)
    (tmp_path / "scenario.xosc").write_bytes(scenario)
    assert xl.play(tmp_path / "out.xosc").end_time == pytest.approx(result.end_time)
    assert xl.verify(tmp_path / "out.xosc").failing == ()


def test_two_of_one_name_are_never_mixed_up(template):
    text, road = template[0].read_text(encoding="utf-8"), template[1].read_bytes()
    first = xl.play(text, road=road)
    other = xl.play(text.replace("overtake", "OVERTAKE", 1), road=road)
    assert first.to_dict()["provenance"]["inputs"] != other.to_dict()["provenance"]["inputs"]
    shorter = xl.convert(text, road=road)
    assert shorter.road == road


WATCH = """
import sys
import xosc_lateral as xl
scenario, road = (open(name, "rb").read() for name in sys.argv[1:3])
xl.convert(scenario, road=road)  # modules are imported, profiles read
opened = []
sys.addaudithook(lambda event, args: opened.append(args) if event in ("open", "os.mkdir", "os.rename") else None)
xl.convert(scenario, road=road, seed=9, mode="trajectory").data
xl.convert(scenario, road=road, seed=9).data
xl.play(scenario, road=road).to_frame()
own, system = (".py", ".pyc", ".json", ".toml"), ("/proc/", "/sys/", "/usr/share/zoneinfo")  # free memory, UTC
print([one for one in opened if not str(one[0]).endswith(own) and not str(one[0]).startswith(system)])
print([one for one in opened if len(one) > 1 and isinstance(one[1], str) and set(one[1]) & set("wax+")])
"""


@pytest.mark.pages
def test_no_file_is_touched(template):
    done = subprocess.run([sys.executable, "-c", WATCH, *template], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["[]", "[]"]


def test_errors_call_files_in_memory_by_their_names() -> None:
    with pytest.raises(xl.FormatError) as raised:
        xl.convert(b"<OpenSCENARIO><x></OpenSCENARIO>")
    assert str(raised.value).startswith("scenario.xosc:1: not well-formed XML")
