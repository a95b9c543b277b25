"""Broken input on purpose: whatever is done to a scenario, catalog or distribution, it loads or is refused in one line.

Bounded and repeatable: hypothesis draws the same mutations on every run. Time per file is bounded: nothing hangs.
"""

from __future__ import annotations

import shutil
import time
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import etree

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
    write_scenario,
)
from xosc_lateral.base.errors import FormatError, XoscLateralError
from xosc_lateral.files.opendrive.reader import read_opendrive
from xosc_lateral.files.openscenario.distribution import read_distribution
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write.fit import write_converted
from xosc_lateral.world.player.player import play

DATA = Path(__file__).parents[1] / "data" / "xosc"
SLOWEST = 5.0
"""A file of a few kilobytes that takes longer hangs. [s]"""

CATALOG = (
    '<?xml version="1.0"?><OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="" author="" description=""/>'
    '<Catalog name="Cars"><Vehicle name="car" vehicleCategory="car"><ParameterDeclarations>'
    '<ParameterDeclaration name="Top" parameterType="double" value="${30 + 2}"/></ParameterDeclarations><BoundingBox>'
    '<Center x="1.4" y="0" z="0.9"/><Dimensions width="1.9" length="4.8" height="1.6"/></BoundingBox>'
    '<Performance maxSpeed="$Top" maxAcceleration="5" maxDeceleration="9"/><Axles>'
    '<RearAxle maxSteering="0" wheelDiameter="0.7" trackWidth="1.6" positionX="0" positionZ="0.35"/></Axles>'
    "</Vehicle></Catalog></OpenSCENARIO>"
)
SCENARIO = scenario_text(
    parameters=declarations(parameter("Speed", "${108 / 3.6}"), parameter("Lane", "-2", "int")),
    catalogs='<VehicleCatalog><Directory path="."/></VehicleCatalog>',
    entities=entity("Ego") + entity("B", '<CatalogReference catalogName="Cars" entryName="car"/>'),
    init=private("Ego", teleport(), speed_action("$Speed")) + private("B", teleport("90", "$Lane"), speed_action()),
    stories=story(event("e", action("a", speed_action("${$Speed * 2}")))),
)
DISTRIBUTION = (
    '<?xml version="1.0"?><OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="" author="" description=""/>'
    '<ParameterValueDistribution><ScenarioFile filepath="made.xosc"/><Stochastic numberOfTestRuns="3" randomSeed="1">'
    '<StochasticDistribution parameterName="Speed"><NormalDistribution expectedValue="30" variance="4">'
    '<Range lowerLimit="20" upperLimit="40"/></NormalDistribution></StochasticDistribution></Stochastic>'
    "</ParameterValueDistribution></OpenSCENARIO>"
)

WORDS = ["", " ", "NaN", "INF", "-INF", "1e999", "-1", "0", "99999999999999999999", "1.5", "true", "::", "\x7f"]
WORDS += ["$", "$Speed", "$x", "${", "${}", "${1/0}", "${$Speed}", "\\$x", "${" + "(" * 99 + "}", "../../../etc/passwd"]
ODD_VALUES = st.one_of(st.sampled_from(WORDS), st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=12))


def mutate(data: st.DataObject, text: str) -> bytes:
    """The file with one to four changes to its tree, or to its bytes."""
    if data.draw(st.booleans()):
        return mutate_bytes(data, text.encode())
    root = etree.fromstring(text.encode())
    for _ in range(data.draw(st.integers(1, 4))):
        elements = [element for element in root.iter("{*}*") if element.getparent() is not None]
        if not elements:
            break
        element = data.draw(st.sampled_from(elements))
        parent = element.getparent()
        assert parent is not None
        kind = data.draw(st.sampled_from(["value", "value", "value", "drop", "remove", "double", "rename", "move"]))
        if kind in ("value", "drop") and element.attrib:
            name = data.draw(st.sampled_from(sorted(map(str, element.attrib))))
            if kind == "drop":
                del element.attrib[name]
            else:
                element.set(name, data.draw(ODD_VALUES))
        elif kind == "remove":
            parent.remove(element)
        elif kind == "double":
            parent.append(etree.fromstring(etree.tostring(element)))
        elif kind == "rename":
            element.tag = data.draw(st.sampled_from(["Position", "Event", "Condition", "Unknown", "CatalogReference"]))
        elif kind == "move":
            other = data.draw(st.sampled_from(elements))
            if other is not element and element not in other.iterancestors():
                other.append(element)
    return etree.tostring(root)


def mutate_bytes(data: st.DataObject, content: bytes) -> bytes:
    changed = bytearray(content)
    for _ in range(data.draw(st.integers(1, 6))):
        at = data.draw(st.integers(0, max(0, len(changed) - 1)))
        kind = data.draw(st.sampled_from(["cut", "flip", "insert", "end"]))
        if kind == "cut":
            del changed[at : at + data.draw(st.integers(1, 30))]
        elif kind == "flip" and changed:
            changed[at] = data.draw(st.integers(0, 255))
        elif kind == "insert":
            changed[at:at] = data.draw(st.binary(max_size=8))
        elif kind == "end":
            del changed[at:]
    return bytes(changed)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fuzz")
    shutil.copyfile(DATA / "road.xodr", folder / "road.xodr")
    return folder


def lay_out(folder: Path, scenario: bytes, catalog: bytes, distribution: bytes) -> None:
    (folder / "made.xosc").write_bytes(scenario)
    (folder / "Cars.xosc").write_bytes(catalog)
    (folder / "logical.xosc").write_bytes(distribution)


def loads_or_is_refused_in_one_line(folder: Path, *, distribution: bool = False) -> None:
    began = time.perf_counter()
    try:
        if distribution:
            logical = read_distribution(folder / "logical.xosc")
            for _, values in zip(range(5), logical.parameter_sets(), strict=False):
                read_scenario(logical.scenario_file, values)
        else:
            read_scenario(folder / "made.xosc")
    except FormatError as error:
        message = str(error)
        assert "\n" not in message
        assert len(message) < 2000
        assert error.path is not None
    assert time.perf_counter() - began < SLOWEST


fuzz = settings(
    max_examples=250,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large],
)


def test_the_files_load_before_they_are_mutated(tmp_path: Path) -> None:
    write_scenario(tmp_path, SCENARIO)
    lay_out(tmp_path, SCENARIO.encode(), CATALOG.encode(), DISTRIBUTION.encode())
    assert len(read_scenario(tmp_path / "made.xosc").entities) == 2
    assert len(list(read_distribution(tmp_path / "logical.xosc").parameter_sets())) == 3


@pytest.mark.pages
@fuzz
@given(data=st.data())
def test_mutated_scenarios(folder: Path, data: st.DataObject) -> None:
    lay_out(folder, mutate(data, SCENARIO), CATALOG.encode(), b"")
    loads_or_is_refused_in_one_line(folder)


@settings(fuzz, max_examples=60)
@given(data=st.data())
def test_mutated_scenarios_that_load_are_played_and_written_or_refused(folder: Path, data: st.DataObject) -> None:
    lay_out(folder, mutate(data, SCENARIO), CATALOG.encode(), b"")
    output = folder / "out.xosc"
    output.unlink(missing_ok=True)
    try:
        scenario = read_scenario(folder / "made.xosc")
        if scenario.road_file is None:
            return
        motion = play(scenario, read_opendrive(scenario.road_file), step=0.02, time_limit=2.0)
        paths = {e.name: e for e in motion.entities}
        write_converted(scenario, motion, paths, output, provenance={}, summary="fuzz")
    except XoscLateralError as error:
        assert "\n" not in str(error)
        assert not output.exists()
        return
    read_scenario(output)


@fuzz
@given(data=st.data())
def test_mutated_catalogs(folder: Path, data: st.DataObject) -> None:
    lay_out(folder, SCENARIO.encode(), mutate(data, CATALOG), b"")
    loads_or_is_refused_in_one_line(folder)


@fuzz
@given(data=st.data())
def test_mutated_distributions(folder: Path, data: st.DataObject) -> None:
    lay_out(folder, SCENARIO.encode(), CATALOG.encode(), mutate(data, DISTRIBUTION))
    loads_or_is_refused_in_one_line(folder, distribution=True)


@pytest.mark.parametrize("name", ["cut-in.xosc", "trajectory-test.xosc", "synchronize.xosc", "traffic_lights.xosc"])
def test_mutated_public_scenarios(folder: Path, shared: Path, name: str) -> None:
    source = shared / "corpus" / "esmini" / "xosc" / name

    @settings(fuzz, max_examples=40)
    @given(data=st.data())
    def run(data: st.DataObject) -> None:
        (folder / "made.xosc").write_bytes(mutate(data, source.read_text("utf-8-sig")))
        loads_or_is_refused_in_one_line(folder)

    run()
