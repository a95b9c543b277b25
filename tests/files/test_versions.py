"""Other versions of the standard: valid by their schemas, played alike, and every loss named."""

from __future__ import annotations

import os
import re
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from tests.files.test_openscenario_write import CUSTOM, LIGHT, STOP_AND_GO, VISIBLE, nominal, played
from tests.kit.scenario_files import (
    action,
    declarations,
    entity,
    event,
    parameter,
    private,
    scenario_text,
    speed_action,
    story,
    teleport,
    time_condition,
    vehicle,
    write_scenario,
)
from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write.draft import WrittenScenario, target
from xosc_lateral.files.openscenario.write.fit import write_converted
from xosc_lateral.files.openscenario.write.literal import name_literally
from xosc_lateral.files.openscenario.write.versions import additions as table_of_additions
from xosc_lateral.world.scenario.parameters import Scope

XSD = Path(__file__).parents[1] / "data" / "xsd"
FILES = {0: "1.0.0", 1: "1.1.1", 2: "1.2.0", 3: "1.3.0"}
NAMESPACE = "{http://www.w3.org/2001/XMLSchema}"
OFFICIAL_1_4 = os.environ.get("OPENSCENARIO_1_4_XSD", "")
"""The schema of 1.4 is not part of the project: name a copy to have it compared and used."""

ENVIRONMENT = (
    '<GlobalAction><EnvironmentAction><Environment name="{name}"><Weather fractionalCloudCover="threeOktas">'
    '<Sun illuminance="20000" azimuth="1" elevation="0.5"/>'
    '<Precipitation precipitationType="rain" precipitationIntensity="5"/>'
    '<Wind direction="0" speed="9"/></Weather></Environment></EnvironmentAction></GlobalAction>'
)
VARIABLE = '<GlobalAction><VariableAction variableRef="v"><SetAction value="2"/></VariableAction></GlobalAction>'
MONITOR = '<GlobalAction><SetMonitorAction monitorRef="m" value="true"/></GlobalAction>'
PROFILE = (
    '<PrivateAction><LongitudinalAction><SpeedProfileAction followingMode="position">'
    '<SpeedProfileEntry time="3" speed="20"/></SpeedProfileAction></LongitudinalAction></PrivateAction>'
)
CONTROLLER = (
    '<ObjectController name="c{n}"><Controller name="d" controllerType="all"><Properties/></Controller>'
    "</ObjectController>"
)
CONSTRAINT = ' <!-- not more --> <ConstraintGroup><ValueConstraint rule="lessThan" value="50"/></ConstraintGroup>'
RICH = {
    "parameters": declarations(parameter("fast", "33", constraints=CONSTRAINT), parameter("lane", "-1", "int"))
    + '<VariableDeclarations><VariableDeclaration name="v" variableType="int" value="1"/></VariableDeclarations>'
    + '<MonitorDeclarations><MonitorDeclaration name="m" value="false"/></MonitorDeclarations>',
    "entities": entity("Ego", vehicle(attributes=' mass="1500" role="civil" model3d="x"'))
    + entity("Other", controller=CONTROLLER.format(n=1) + CONTROLLER.format(n=2)),
    "init": ENVIRONMENT.format(name="first")
    + private("Ego", teleport(), speed_action("${$fast - 3}"), LIGHT)
    + private("Other", teleport(s="100", lane="$lane"), speed_action()),
    "stories": story(
        event("slower", action("slower", PROFILE), time=1),
        event("light", action("light", LIGHT), time=2),
        event("seen", action("seen", VISIBLE), time=3),
        event("variable", action("variable", VARIABLE), time=4),
        event("monitor", action("monitor", MONITOR), time=5),
        event("custom", action("custom", CUSTOM), time=6),
        event("rain", action("rain", ENVIRONMENT.format(name="second")), time=7),
    ),
    "stop": time_condition(9, "greaterOrEqual"),
}


def tree(folder: Path, minor: int = 3, **parts: str) -> Path:
    return write_scenario(folder, scenario_text(minor=minor, **parts))  # type: ignore[arg-type]


Written = tuple[WrittenScenario, etree._Element]


def written(source: Path, version: str | None, player: str = "standard") -> Written:
    scenario = read_scenario(source)
    motion = played(scenario)
    output = source.with_name(f"out_{version}_{player}.xosc")
    made_for = target(player, version)
    found = write_converted(scenario, motion, nominal(motion), output, provenance={}, summary="", target=made_for)
    return found, etree.parse(str(output)).getroot()


def schema_of(minor: int) -> etree.XMLSchema:
    """Of 1.4: the official one if it is named, else that of 1.3 with the change to vertices that we write."""
    if minor == 4 and OFFICIAL_1_4:
        return etree.XMLSchema(etree.parse(OFFICIAL_1_4))
    document = etree.parse(str(XSD / f"OpenSCENARIO-{FILES[min(minor, 3)]}.xsd"))
    if minor == 4:
        vertex = next(item for item in document.iter(f"{NAMESPACE}complexType") if item.get("name") == "Vertex")
        inside = vertex[0]
        etree.SubElement(inside, f"{NAMESPACE}element", {"name": "Motion", "type": "Motion", "minOccurs": "0"})
        motion = etree.SubElement(document.getroot(), f"{NAMESPACE}complexType", {"name": "Motion"})
        for name in ("speed_longitudinal", "acceleration_longitudinal"):
            etree.SubElement(motion, f"{NAMESPACE}attribute", {"name": name, "type": "Double"})
    return etree.XMLSchema(document)


@pytest.mark.parametrize("minor", range(5))
def test_what_newer_versions_have_is_valid_in_every_version(tmp_path: Path, minor: int) -> None:
    source = tree(tmp_path, **RICH)
    schema_of(3).assertValid(etree.parse(str(source)))
    found, root = written(source, f"1.{minor}")
    schema_of(minor).assertValid(root)
    assert root.find("FileHeader").get("revMinor") == str(minor)
    lacking = [note for note in found.notes if "follows a trajectory" not in note.what]
    assert bool(lacking) == (minor < 3)


@pytest.mark.parametrize("minor", range(4))
@pytest.mark.parametrize("old", range(4))
def test_every_version_becomes_every_other(tmp_path: Path, old: int, minor: int) -> None:
    _, root = written(tree(tmp_path, old, stories=STOP_AND_GO), f"1.{minor}")
    schema_of(minor).assertValid(root)


def test_what_is_left_out_is_named(tmp_path: Path) -> None:
    source = tree(tmp_path, **RICH)
    named = " ".join(map(str, written(source, "1.0")[0].notes))
    words = ("Wind", "AppearanceAction", "VariableAction", "SetMonitorAction", "MonitorDeclarations", "ConstraintGroup")
    for word in (*words, "Vehicle/@mass", "VariableDeclarations", "TimeOfDay", "RoadCondition"):
        assert word in named, word
    assert "Wind" not in " ".join(map(str, written(source, "1.2")[0].notes))


def test_weather_keeps_its_meaning_under_its_former_names(tmp_path: Path) -> None:
    weather = written(tree(tmp_path, **RICH), "1.0")[1].find(".//Weather")
    assert weather.get("cloudState") == "cloudy"
    assert weather.find("Sun").get("intensity") == "20000"
    assert float(weather.find("Precipitation").get("intensity")) == pytest.approx(0.1)


@pytest.mark.parametrize("version", ["1.0", "1.4"])
def test_another_version_is_played_alike(tmp_path: Path, version: str) -> None:
    source = tree(tmp_path, **RICH)
    before = played(read_scenario(source))
    _, root = written(source, version)
    after = played(read_scenario(Path(root.base)))
    assert after.end_time == pytest.approx(before.end_time, abs=0.02)
    for one, other in zip(before.entities, after.entities, strict=True):
        n = min(len(one.time), len(other.time))
        assert np.hypot(one.x[:n] - other.x[:n], one.y[:n] - other.y[:n]).max() < 0.02


def test_a_vertex_says_how_fast_the_car_is_there_from_1_4_on(tmp_path: Path) -> None:
    source = tree(tmp_path, **RICH)
    assert not written(source, "1.3")[1].findall(".//Motion")
    vertices = written(source, "1.4")[1].find(".//Polyline").findall("Vertex")
    time = np.array([float(vertex.get("time")) for vertex in vertices])
    x = np.array([float(vertex.find(".//WorldPosition").get("x")) for vertex in vertices])
    speed, acceleration = (
        np.array([float(vertex.find("Motion").get(f"{name}_longitudinal")) for vertex in vertices])
        for name in ("speed", "acceleration")
    )
    assert speed[1:-1] == pytest.approx(np.gradient(x, time)[1:-1], abs=0.5)
    # From 30 to 20 m/s within 3 s.
    assert speed[0] == pytest.approx(30.0)
    assert speed[-1] == pytest.approx(20.0, abs=0.01)
    assert np.median(acceleration[(time > 1.2) & (time < 3.8)]) == pytest.approx(-10.0 / 3.0, rel=0.01)


FOLLOWED = (
    '<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" closed="false"><Shape>'
    "<Polyline>{vertices}{more}</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference><None/></TimeReference>"
    '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>'
)


def test_of_what_1_4_adds_all_is_read_or_named(tmp_path: Path) -> None:
    """`pi` and the permanent layer are meant as written; the way between vertices is up to the player."""
    moved = '<Motion speed_longitudinal="9"/>'
    vertices = "".join(
        f'<Vertex><Position><WorldPosition x="{x}" y="-1.5"/></Position>{moved}</Vertex>' for x in (60, 110)
    )
    follow = FOLLOWED.format(vertices=vertices, more="<Interpolation/>")
    where = teleport(s="${10 * pi / pi}")
    placed = {layer: where.replace("roadId", f'layer="{layer}" roadId') for layer in ("permanent", "temporary")}
    entities = entity("Ego") + entity("B")
    scenario = {
        layer: scenario_text(
            minor=4,
            entities=entities,
            init=private("Ego", placed["permanent"], follow) + private("B", placed[layer]),
        )
        for layer in placed
    }
    notes = {layer: read_scenario(write_scenario(tmp_path / layer, text)).notes for layer, text in scenario.items()}
    said = {layer: " ".join(one.what for one in each) for layer, each in notes.items()}
    assert all("Interpolation leaves" in text and "Motion is not read" in text for text in said.values()), said
    assert "layer is not read" in said["temporary"] and "layer is" not in said["permanent"]


def test_an_entry_takes_the_place_of_its_reference(tmp_path: Path) -> None:
    folder = tmp_path / "catalogs"
    folder.mkdir()
    content = vehicle(speed="$top", parameters=declarations(parameter("top", "20")))
    (folder / "cars.xosc").write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2024-01-01T00:00:00" description="" author=""/>'
        f'<Catalog name="cars">{content}</Catalog></OpenSCENARIO>'
    )
    reference = (
        '<CatalogReference catalogName="cars" entryName="car"><ParameterAssignments>'
        '<ParameterAssignment parameterRef="top" value="44"/></ParameterAssignments></CatalogReference>'
    )
    catalogs = '<VehicleCatalog><Directory path="catalogs"/></VehicleCatalog>'
    source = tree(tmp_path, catalogs=catalogs, entities=entity("Ego", reference))
    _, root = written(source, "1.1")
    schema_of(1).assertValid(root)
    assert root.find(".//Performance").get("maxSpeed") == "44"
    assert not root.findall(".//CatalogReference")
    assert len(root.find("CatalogLocations")) == 0
    # The input's own version keeps its catalogs.
    assert written(source, None)[1].findall(".//CatalogReference")


def reactive(source: Path, version: str) -> Written:
    scenario = read_scenario(source)
    output = source.with_name("reactive.xosc")
    found = write_converted(
        scenario,
        played(scenario),
        {},
        output,
        paths=[],
        provenance={},
        summary="",
        target=target(version=version),
    )
    return found, etree.parse(str(output)).getroot()


CLEARANCE = (
    '<ConditionGroup><Condition name="free" delay="0" conditionEdge="none"><ByEntityCondition>'
    '<TriggeringEntities triggeringEntitiesRule="any"><EntityRef entityRef="Ego"/></TriggeringEntities>'
    '<EntityCondition><RelativeClearanceCondition oppositeLanes="false" freeSpace="true"/></EntityCondition>'
    "</ByEntityCondition></Condition></ConditionGroup>"
)


@pytest.mark.parametrize(
    ("parts", "what"),
    [
        ({"stop": CLEARANCE.replace('delay="0"', 'delay="2"')}, "RelativeClearanceCondition"),
        ({"stories": story(event("slower", action("slower", PROFILE)))}, "SpeedProfileAction"),
        ({"stop": time_condition(0, "notEqualTo")}, "notEqualTo"),
    ],
)
def test_what_a_reactive_scenario_hangs_on_is_refused(tmp_path: Path, parts: dict[str, str], what: str) -> None:
    with pytest.raises(FormatError, match=rf"(?s)made\.xosc.*version 1\.0 has no .*{what}.*--mode trajectory"):
        reactive(tree(tmp_path, **parts), "1.0")
    assert not (tmp_path / "reactive.xosc").exists()


@pytest.mark.parametrize("minor", range(4))
def test_a_reactive_scenario_keeps_its_events_for_others_to_refer_to(tmp_path: Path, minor: int) -> None:
    source = tree(
        tmp_path, stories=story(event("light", action("light", LIGHT)), event("go", action("go", speed_action())))
    )
    found, root = reactive(source, f"1.{minor}")
    schema_of(minor).assertValid(root)
    assert {item.get("name") for item in root.iter("Event")} >= {"light", "go"}
    lacking = [note for note in found.notes if "follows a trajectory" not in note.what]
    assert bool(lacking) == (minor < 3)


SPLINE = (
    "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
    '<Trajectory name="way" closed="false"><Shape><ClothoidSpline><ClothoidSplineSegment curvatureStart="0" '
    'curvatureEnd="0.02" length="20"/></ClothoidSpline></Shape></Trajectory>'
    "</TrajectoryRef><TimeReference><None/></TimeReference>"
    '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction></PrivateAction>'
)


@pytest.mark.parametrize("minor", range(3))
def test_a_clothoid_spline_of_a_reactive_scenario_is_refused_before_1_3(tmp_path: Path, minor: int) -> None:
    source = tree(tmp_path, stories=story(event("follow", action("follow", SPLINE))))
    with pytest.raises(FormatError, match=rf"version 1\.{minor} has no ClothoidSpline; use --mode trajectory"):
        reactive(source, f"1.{minor}")
    assert "Polyline" in etree.tostring(written(source, f"1.{minor}")[1], encoding="unicode")


def test_before_1_1_a_trajectory_lies_right_in_its_action(tmp_path: Path) -> None:
    corners = "".join(
        f'<Vertex time="0"><Position><WorldPosition x="{x}" y="0"/></Position></Vertex>' for x in (10, 50)
    )
    shape = f"<Polyline>{corners}</Polyline>"
    way = re.sub("<ClothoidSpline>.*</ClothoidSpline>", shape, SPLINE)
    source = tree(tmp_path, stories=story(event("follow", action("follow", way))))
    for minor in range(2):
        root = reactive(source, f"1.{minor}")[1]
        schema_of(minor).assertValid(root)
        parent = root.find(".//Trajectory[@name='way']").getparent().tag
        assert parent == ("TrajectoryRef" if minor else "FollowTrajectoryAction")


def test_an_orientation_without_a_type_means_what_it_meant(tmp_path: Path) -> None:
    turned = teleport().replace("/></Position>", '><Orientation h="0.1"/></LanePosition></Position>')
    source = tree(tmp_path, 2, init=private("Ego", turned, speed_action()))
    assert reactive(source, "1.3")[1].find(".//Orientation").get("type") == "absolute"


def test_words_that_are_no_version_are_refused() -> None:
    for words in (("standard", "1.5"), ("carla", "1.2")):
        with pytest.raises(ValueError, match="version"):
            target(*words)


def additions(older: Path, newer: Path) -> Iterator[tuple[tuple[str, ...], ...]]:
    """Elements, attributes and values that a schema has and the one before has not, by tags that both know."""
    (parts, attributes, values), (new_parts, new_attributes, new_values) = vocabulary(older), vocabulary(newer)
    known = {child for _, child in parts} | {"OpenSCENARIO"}
    yield tuple(sorted(item for item in new_parts - parts if item[0] in known))
    yield tuple(sorted(item for item in new_attributes - attributes if item[0] in known))
    yield tuple(sorted(item for item in new_values - values if item[:2] in attributes))


def vocabulary(path: Path) -> tuple[set[tuple[str, ...]], set[tuple[str, ...]], set[tuple[str, ...]]]:
    """(tag above, tag), (tag, attribute) and (tag, attribute, value) of everything below the root."""
    document = etree.parse(str(path)).getroot()
    groups = {item.get("name"): item for item in document.findall(f"{NAMESPACE}group")}
    types = {item.get("name"): item for item in document.findall(f"{NAMESPACE}complexType")}
    codes: dict[str, list[str]] = defaultdict(list)
    for item in document.findall(f"{NAMESPACE}simpleType"):
        codes[item.get("name")] = [code.get("value") for code in item.iter(f"{NAMESPACE}enumeration")]
    parts, attributes, values = set(), set(), set()
    seen, left = set(), [("OpenSCENARIO", types["OpenScenario"])]
    while left:
        tag, kind = left.pop()
        if (tag, id(kind)) in seen:
            continue
        seen.add((tag, id(kind)))
        for child in children(kind, groups):
            parts.add((tag, child.get("name")))
            inner = types.get(child.get("type", ""), child.find(f"{NAMESPACE}complexType"))
            if inner is not None:
                left.append((child.get("name"), inner))
        for attribute in own_attributes(kind):
            attributes.add((tag, attribute.get("name")))
            values |= {(tag, attribute.get("name"), code) for code in codes[attribute.get("type", "")]}
    return parts, attributes, values


def children(item: etree._Element, groups: dict[str | None, etree._Element]) -> Iterator[etree._Element]:
    for child in item:
        if child.tag == f"{NAMESPACE}element":
            yield child
        elif child.tag == f"{NAMESPACE}group":
            yield from children(groups[child.get("ref")], groups)
        elif isinstance(child.tag, str) and child.tag != f"{NAMESPACE}attribute":
            yield from children(child, groups)


def own_attributes(item: etree._Element) -> Iterator[etree._Element]:
    for child in item:
        if child.tag == f"{NAMESPACE}attribute":
            yield child
        elif isinstance(child.tag, str) and child.tag.endswith(("Content", "extension")):
            yield from own_attributes(child)


def tables(minor: int) -> Iterator[tuple[tuple[str, ...], ...]]:
    for kind in ("elements", "attributes", "values"):
        table = table_of_additions(minor, kind)
        yield tuple(sorted((*path.split("/"), name) for path, names in table.items() for name in names))


@pytest.mark.parametrize("minor", [1, 2, 3])
def test_the_table_of_additions_is_that_of_the_schemas(minor: int) -> None:
    paths = [XSD / f"OpenSCENARIO-{FILES[number]}.xsd" for number in (minor - 1, minor)]
    assert list(tables(minor)) == list(additions(*paths))


@pytest.mark.skipif(not OFFICIAL_1_4, reason="OPENSCENARIO_1_4_XSD names no copy of the schema of 1.4")
def test_the_table_of_additions_to_1_4_is_that_of_its_schema() -> None:
    assert list(tables(4)) == list(additions(XSD / "OpenSCENARIO-1.3.0.xsd", Path(OFFICIAL_1_4)))


def test_tables_are_checked_by_a_walk_that_sees_everything() -> None:
    parts, attributes, values = vocabulary(XSD / "OpenSCENARIO-1.3.0.xsd")
    assert len(parts) > 300
    assert len(attributes) > 300
    assert ("Event", "priority", "override") in values


TRAILER = (
    '<TrailerHitch dx="-1"/><Trailer><Trailer name="t"><Vehicle name="t" vehicleCategory="trailer">'
    '<BoundingBox><Center x="1" y="0" z="0.5"/><Dimensions width="2" length="3" height="1"/></BoundingBox>'
    '<Performance maxSpeed="70" maxAcceleration="10" maxDeceleration="10"/><Axles>'
    '<RearAxle maxSteering="0" wheelDiameter="0.7" trackWidth="1.6" positionX="0" positionZ="0.35"/></Axles>'
    '<TrailerCoupler dx="2"/></Vehicle></Trailer></Trailer></Vehicle>'
)


@pytest.mark.parametrize("minor", range(4))
def test_a_trailer_follows_by_itself_or_is_an_entity_of_its_own(tmp_path: Path, minor: int) -> None:
    source = tree(tmp_path, entities=entity("Ego", vehicle().replace("</Vehicle>", TRAILER)))
    schema_of(3).assertValid(etree.parse(str(source)))
    found, root = written(source, f"1.{minor}")
    schema_of(minor).assertValid(root)
    assert ("Ego+" in found.converted) == (minor < 3)
    names = [item.get("name") for item in root.iter("ScenarioObject")]
    assert names == (["Ego", "Ego+"] if minor < 3 else ["Ego"])
    before = {one.name: one for one in played(read_scenario(source)).entities}
    for after in played(read_scenario(Path(root.base))).entities:
        one = before[after.name]
        n = min(len(one.time), len(after.time))
        assert np.hypot(one.x[:n] - after.x[:n], one.y[:n] - after.y[:n]).max() < 0.02


def test_an_input_that_goes_beyond_its_version_is_left_as_it_is(tmp_path: Path) -> None:
    source = tree(tmp_path, 1, entities=entity("Ego", vehicle().replace("</Vehicle>", TRAILER)))
    found, root = written(source, None)
    assert found.converted == ("Ego",)
    assert root.find(".//Trailer/Trailer") is not None


@pytest.mark.parametrize("wanted", [{"Egochange"}, {"other"}])
def test_names_by_an_expression_are_written_where_ours_refer_to_them(tmp_path: Path, wanted: set[str]) -> None:
    state = (
        '<ConditionGroup><Condition name="s" delay="0" conditionEdge="none"><ByValueCondition>'
        '<StoryboardElementStateCondition storyboardElementType="action" storyboardElementRef="${$who + change}" '
        'state="completeState"/></ByValueCondition></Condition></ConditionGroup>'
    )
    change = event("first", action("${$who + change}", speed_action()))
    after = event("$who", action("then", speed_action())).replace(time_condition(1.0), state)
    text = story(change, after, parameters=declarations(parameter("who", "Ego", "string")))
    path = tree(tmp_path, stories=text)
    root = etree.parse(str(path)).getroot()
    name_literally(root, path, Scope({}), wanted)
    (reference,) = root.iter("StoryboardElementStateCondition")
    names = [item.get("name") for item in root.iter("Event", "Action")]
    if wanted == {"Egochange"}:
        assert names == ["first", "Egochange", "Ego", "then"]
        assert reference.get("storyboardElementRef") == "Egochange"
    else:
        assert names == ["first", "${$who + change}", "$who", "then"]
        assert reference.get("storyboardElementRef") == "${$who + change}"
