"""Scenarios written for CARLA: left-handed, on a town; numbers as ScenarioRunner's parser reads them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from math import remainder, tau
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lxml import etree

import xosc_lateral as xl
from tests.kit import carla_stand_in, scenario_runner
from tests.kit.profiles import simulated_profile
from tests.kit.stage import line, map_of, road
from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.read import RoadSearch
from xosc_lateral.workflows.conversion.convert import convert_scenario
from xosc_lateral.workflows.conversion.load import Played, play_scenario
from xosc_lateral.workflows.conversion.settings import ConvertSettings, OutputMode

SCENARIO = """<?xml version="1.0"?>
<OpenSCENARIO>
  <FileHeader revMajor="1" revMinor="0" date="2020-03-20T12:00:00" description="{about}" author=""/>
  <CatalogLocations/>
  <RoadNetwork><LogicFile filepath="Town77"/></RoadNetwork>
  <Entities><ScenarioObject name="hero">
    <Vehicle name="vehicle.lincoln.mkz2017" vehicleCategory="car">
      <BoundingBox><Center x="1.5" y="0" z="0.9"/><Dimensions width="2.1" length="4.5" height="1.8"/></BoundingBox>
      <Performance maxSpeed="69" maxAcceleration="10" maxDeceleration="10"/>
      <Axles><FrontAxle maxSteering="0.5" wheelDiameter="0.6" trackWidth="1.8" positionX="3.1" positionZ="0.3"/>
      <RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.8" positionX="0" positionZ="0.3"/></Axles>
    </Vehicle></ScenarioObject></Entities>
  <Storyboard>
    <Init><Actions><Private entityRef="hero">
      <PrivateAction><TeleportAction><Position>{position}</Position></TeleportAction></PrivateAction>
      <PrivateAction><LongitudinalAction><SpeedAction>
        <SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>
        <SpeedActionTarget><AbsoluteTargetSpeed value="20"/></SpeedActionTarget>
      </SpeedAction></LongitudinalAction></PrivateAction>
    </Private></Actions></Init>
    <StopTrigger><ConditionGroup><Condition name="end" delay="0" conditionEdge="none"><ByValueCondition>
      <SimulationTimeCondition value="20" rule="greaterThan"/></ByValueCondition>
    </Condition></ConditionGroup></StopTrigger>
  </Storyboard>
</OpenSCENARIO>
"""
WORLD = '<WorldPosition x="50" y="{y}" z="0" h="{h}"/>'


@pytest.fixture
def maps(tmp_path: Path) -> RoadSearch:
    folder = tmp_path / "elsewhere" / "maps"
    folder.mkdir(parents=True)
    plan = line(heading=-0.3)
    (folder / "Town77.xodr").write_text(map_of(road("1", plan, 1000.0)), encoding="utf-8")
    return RoadSearch(folders=(folder,))


def _scenario(tmp_path: Path, position: str, about: str = "CARLA:test") -> Path:
    folder = tmp_path / "scenarios"
    folder.mkdir(exist_ok=True)
    path = folder / "carla.xosc"
    path.write_text(SCENARIO.format(position=position, about=about), encoding="utf-8")
    return path


def _start(played: Played) -> tuple[float, float, float]:
    hero = played.motion.entities[0]
    return float(hero.x[0]), float(hero.y[0]), remainder(float(hero.heading[0]), tau)


# On a straight road at -0.3 rad, 2.25 m to the right of its line at s = 100 m: (100 cos 0.3 - 2.25 sin 0.3, ...).
@pytest.mark.parametrize(
    ("position", "expected"),
    [
        (WORLD.format(y=18.0, h=0.3), (50.0, -18.0, -0.3)),
        ('<LanePosition roadId="1" laneId="-1" s="100" offset="0.5"/>', (94.868, -31.702, -0.3)),
        ('<RoadPosition roadId="1" s="100" t="2.25"/>', (94.868, -31.702, -0.3)),
    ],
)
def test_positions_are_mirrored(
    tmp_path: Path, maps: RoadSearch, position: str, expected: tuple[float, float, float]
) -> None:
    played = play_scenario(_scenario(tmp_path, position), roads=maps)
    assert _start(played) == pytest.approx(expected, abs=2e-3)
    assert any("left-handed" in str(note) for note in played.motion.notes)


TO_THE_RIGHT = (
    '<TeleportAction><Position><RelativeLanePosition entityRef="hero" dLane="0" ds="0" offset="0.5"/></Position>'
    "</TeleportAction>",
    '<TeleportAction><Position><RelativeLanePosition entityRef="hero" dLane="0" dsLane="0" offset="0.5"/></Position>'
    "</TeleportAction>",
    '<LateralAction><LaneOffsetAction continuous="false"><LaneOffsetActionDynamics dynamicsShape="step"/>'
    '<LaneOffsetTarget><AbsoluteTargetLaneOffset value="0.5"/></LaneOffsetTarget></LaneOffsetAction></LateralAction>',
)


@pytest.mark.parametrize("lane", [-1, 1])
@pytest.mark.parametrize("action", TO_THE_RIGHT, ids=["ds", "dsLane", "LaneOffsetAction"])
def test_offsets_count_to_the_right_of_the_lanes_direction(
    tmp_path: Path, maps: RoadSearch, lane: int, action: str
) -> None:
    scenario = _scenario(tmp_path, f'<LanePosition roadId="1" laneId="{lane}" s="500"/>')
    first = "</TeleportAction></PrivateAction>"
    text = scenario.read_text(encoding="utf-8")
    text = text.replace(first, f"{first}<PrivateAction>{action}</PrivateAction>")
    scenario.write_text(text, encoding="utf-8")
    hero = play_scenario(scenario, roads=maps, time_limit=1.0).motion.entities[0]
    assert hero.lane[-1] == lane
    assert hero.offset[-1] == pytest.approx(-0.5)  # in a played motion, offsets count to the left of travel


def test_without_the_mark_positions_are_the_standards(tmp_path: Path, maps: RoadSearch) -> None:
    scenario = _scenario(tmp_path, WORLD.format(y=-18.0, h=-0.3), about="a test")
    assert _start(play_scenario(scenario, roads=maps)) == pytest.approx((50.0, -18.0, -0.3), abs=1e-3)


def test_a_conversion_is_left_handed_too_and_keeps_the_town(tmp_path: Path, maps: RoadSearch) -> None:
    source = _scenario(tmp_path, WORLD.format(y=17.5, h=0.3))
    settings = ConvertSettings(profile=simulated_profile(), seed=3, road_path=maps.folders, ego=frozenset())
    out = tmp_path / "out"
    out.mkdir()
    conversion = convert_scenario(source, out / "carla.xosc", settings)
    text = (out / "carla.xosc").read_text(encoding="utf-8")
    assert 'filepath="Town77"' in text
    assert re.search(r'description="CARLA:', text)
    vertices = [float(y) for y in re.findall(r'<Vertex.*?<WorldPosition[^>]* y="([^"]+)"', text, re.DOTALL)]
    assert len(vertices) > 10
    assert min(vertices) > 10.0
    again = play_scenario(out / "carla.xosc", roads=maps).motion.entities[0]
    wanted = conversion.movement.entities[0].trajectory
    n = min(len(again.y), len(wanted.y))
    assert abs(again.y[:n] - wanted.y[:n]).max() < 0.05
    assert again.y[:n].max() < -10.0


def test_a_town_that_is_not_there_costs_one_line(tmp_path: Path, maps: RoadSearch) -> None:
    scenario = _scenario(tmp_path, WORLD.format(y=18.0, h=0.3))
    with pytest.raises(FormatError, match="name its folder or the file by --road"):
        play_scenario(scenario)
    named = RoadSearch(file=maps.folders[0] / "Town77.xodr")
    assert play_scenario(scenario, roads=named).scenario.road_file == named.file


def test_lane_offset_mode_is_refused(tmp_path: Path, maps: RoadSearch) -> None:
    source = _scenario(tmp_path, WORLD.format(y=18.0, h=0.3))
    settings = ConvertSettings(profile=simulated_profile(), mode=OutputMode.LANE_OFFSET, road_path=maps.folders)
    with pytest.raises(FormatError, match="CARLA"):
        convert_scenario(source, tmp_path / "out.xosc", settings)
    assert not (tmp_path / "out.xosc").exists()


ROUTE_POSITION = """<RoutePosition><RouteRef><Route name="route" closed="false">
  <Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" s="100"/></Position></Waypoint>
  <Waypoint routeStrategy="shortest"><Position><LanePosition roadId="1" laneId="-1" s="900"/></Position></Waypoint>
</Route></RouteRef><InRoutePosition><FromLaneCoordinates pathS="50" laneId="-1"/></InRoutePosition></RoutePosition>"""


@pytest.mark.parametrize("about", ["CARLA:test", "test"])
def test_who_stays_as_written_on_a_route_starts_where_that_is(tmp_path: Path, maps: RoadSearch, about: str) -> None:
    source = _scenario(tmp_path, ROUTE_POSITION, about)
    xl.convert(source, tmp_path / "out.xosc", player="carla", road_path=maps.folders, ego=["hero"])
    root = etree.parse(str(tmp_path / "out.xosc")).getroot()
    assert scenario_runner.broken(root) == []
    (place,) = root.iter("WorldPosition")
    hero = play_scenario(source, roads=maps).motion.entities[0]
    assert hero.s[0] == pytest.approx(150.0)
    side = -1.0 if about.startswith("CARLA") else 1.0
    assert [float(place.get(axis, "")) for axis in "xyh"] == pytest.approx(
        [hero.x[0], side * hero.y[0], side * remainder(hero.heading[0], tau)], abs=1e-4
    )


TEMPLATE_NAMES = ["braking-leader", "curves", "cut-in", "dense-traffic", "jam-end", "overtake-truck"]


def _for_carla(name: str, folder: Path) -> tuple[xl.Conversion, Path]:
    scenario, _ = xl.write_template(name, folder)
    output = folder / "for_carla.xosc"
    return xl.convert(scenario, output, seed=1, player="carla"), output


def test_what_ends_the_parsers_run_is_left_out_of_who_stays_as_written(tmp_path: Path) -> None:
    made, output = _for_carla("overtake-truck", tmp_path)  # its Ego changes lanes by the lanes' numbers
    assert scenario_runner.broken(etree.parse(str(output)).getroot()) == []
    assert any("AbsoluteTargetLane left out (ScenarioRunner changes lanes" in str(note) for note in made.messages)


@pytest.mark.skipif("SCENARIO_RUNNER" not in os.environ, reason="SCENARIO_RUNNER names no checkout of ScenarioRunner")
@pytest.mark.parametrize("name", TEMPLATE_NAMES)
def test_its_own_code_ends_within_2_cm(name: str, tmp_path: Path) -> None:
    """`SCENARIO_RUNNER_PYTHON` has what ScenarioRunner needs (py_trees 0.8, xmlschema, networkx, Shapely, six ...)."""
    made, output = _for_carla(name, tmp_path)
    python, table = os.environ.get("SCENARIO_RUNNER_PYTHON", sys.executable), tmp_path / "rows.csv"
    command = [python, carla_stand_in.__file__, os.environ["SCENARIO_RUNNER"], str(output), "300", str(table)]
    subprocess.run(command, check=True, timeout=300, capture_output=True)
    driven = pd.read_csv(table, names=["time", "name", "x", "y"])
    meant = made.to_frame()
    assert driven["time"].iloc[-1] == pytest.approx(meant["time"].max(), abs=0.1)  # its acts end, and it with them
    for called, rows in meant[meant["name"].isin(made.enriched)].groupby("name"):
        frames = driven[(driven["name"] == called) & (driven["time"] <= rows["time"].max())]
        aside = np.hypot(*(frames[axis] - np.interp(frames["time"], rows["time"], rows[axis]) for axis in "xy"))
        assert aside.iloc[-1] < 0.02
        assert aside.max() < 0.05
