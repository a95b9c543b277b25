"""Written for CARLA's ScenarioRunner: no rule of its published parser is broken. CARLA itself is not run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from tests.files.test_openscenario_write import CUSTOM, LIGHT, STOP_AND_GO, VISIBLE, nominal, played
from tests.files.test_versions import ENVIRONMENT, RICH, tree, written
from tests.kit import scenario_runner
from tests.kit.scenario_files import (
    action,
    declarations,
    entity,
    event,
    parameter,
    private,
    speed_action,
    story,
    teleport,
    time_condition,
)
from xosc_lateral.base.errors import FormatError
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write.draft import target
from xosc_lateral.files.openscenario.write.fit import write_converted

SIGNAL = (
    "<GlobalAction><InfrastructureAction><TrafficSignalAction>"
    '<TrafficSignalStateAction name="{name}" state="green"/>'
    "</TrafficSignalAction></InfrastructureAction></GlobalAction>"
)
SIGNAL_BY_ID = SIGNAL.format(name="id=7")
APPEARING = (
    '<GlobalAction><EntityAction entityRef="Late"><AddEntityAction><Position>'
    '<LanePosition roadId="1" laneId="-2" s="20"/></Position></AddEntityAction></EntityAction></GlobalAction>'
)
SCENARIOS = {
    "stop and go": {"stories": STOP_AND_GO},
    "what newer versions have": RICH,
    "kept actions": {
        "stories": story(
            *(
                event(f"e{n}", action("same name", content), time=1 + n)
                for n, content in enumerate(
                    (LIGHT, VISIBLE, CUSTOM, SIGNAL.format(name="1"), SIGNAL.format(name="id=7"))
                )
            )
        )
    },
    "placed twice": {"stories": story(event("jump", action("jump", teleport(s="300", lane="-2")), time=3.01))},
    "appears late": {
        "entities": entity("Ego") + entity("Late"),
        "stories": story(event("appear", action("appear", APPEARING), time=2.0)),
    },
    "parameters": {
        "parameters": declarations(parameter("top", "28"), parameter("end", "8")),
        "init": private("Ego", teleport(), speed_action("$top")),
        "stop": time_condition(8).replace('value="8"', 'value="$end"'),
    },
    "backwards": {"init": private("Ego", teleport(), speed_action("-5"))},
    "stands": {
        "init": private("Ego", teleport(), speed_action("0")),
        "stories": story(event("x", action("x", CUSTOM))),
    },
    "a date with a zone": {
        "init": ENVIRONMENT.format(name="e").replace(
            "<Weather", '<TimeOfDay animation="false" dateTime="2024-05-01T10:00:00.000+02:00"/><Weather', 1
        )
        + private("Ego")
    },
}


@pytest.mark.parametrize("name", ["backwards", "stop and go"])
def test_who_drives_backwards_is_noted_and_nobody_else(tmp_path: Path, name: str) -> None:
    notes = written(tree(tmp_path, **SCENARIOS[name]), None, "carla")[0].notes
    assert any("drives backwards" in str(note) for note in notes) == (name == "backwards")


@pytest.mark.parametrize("minor", [0, 3])
@pytest.mark.parametrize("name", SCENARIOS)
def test_no_rule_of_the_parser_is_broken(tmp_path: Path, name: str, minor: int) -> None:
    _, root = written(tree(tmp_path, minor, **SCENARIOS[name]), None, "carla")
    assert scenario_runner.broken(root) == []


def test_every_rule_is_broken_by_something() -> None:
    """Else it would hold whatever we write."""
    text = """<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" description=""/><RoadNetwork/><Entities>
      <ScenarioObject name="A"><Vehicle/></ScenarioObject><ScenarioObject name="B"><CatalogReference/></ScenarioObject>
      </Entities><Storyboard><Init><Actions><Private entityRef="A"><PrivateAction><Position/><Position>
      <WorldPosition x="$x" p="0.1"/></Position><AbsoluteTargetSpeed value="-1"/></PrivateAction></Private></Actions>
      </Init><Story name="s"><Act name="a"><ManeuverGroup name="g"><Actors><EntityRef entityRef="A"/></Actors>
      <Maneuver name="m"><Event name="e"><Action name="x"><PrivateAction><VisibilityAction/></PrivateAction></Action>
      <Action name="x"><FollowTrajectoryAction/></Action><StartTrigger/></Event></Maneuver></ManeuverGroup></Act>
      </Story><Environment><TimeOfDay dateTime="now"/></Environment></Storyboard></OpenSCENARIO>"""
    root = etree.fromstring(text)
    for rule in scenario_runner.RULES:
        assert list(rule(root)), rule.__name__


def test_the_usual_output_breaks_rules_that_this_one_keeps(tmp_path: Path) -> None:
    _, root = written(tree(tmp_path, **RICH), None)
    found = " ".join(scenario_runner.broken(root))
    for rule in (
        "OC._check_version",
        "OC._extract_vehicle_information",
        "OS._create_init_behavior",
        "OS._create_behavior",
    ):
        assert rule in found


BRAKING = speed_action("0").replace('dynamicsShape="step"', 'dynamicsShape="linear"').replace('"0"/>', '"4"/>', 1)


def test_the_control_follows_what_is_written_to_2_cm_through_a_stop(tmp_path: Path) -> None:
    stop_and_go = story(
        event("stop", action("stop", BRAKING), time=1.01),
        event("go", action("go", speed_action("12")), time=7.0),
    )
    source = tree(tmp_path, stories=stop_and_go)
    motion = played(read_scenario(source)).entities[0]
    _, root = written(source, None, "carla")
    (polyline,) = root.iter("Polyline")
    places = [vertex.find("Position/WorldPosition") for vertex in polyline]
    times = np.array([float(vertex.get("time")) for vertex in polyline])
    x, y = (np.array([float(place.get(axis)) for place in places]) for axis in ("x", "y"))
    rows = scenario_runner.drive(times, x, y, motion.time[-1])
    error = np.abs(rows[:, 1] - np.interp(rows[:, 0], motion.time, motion.x))
    moves_off = np.abs(rows[:, 0] - 7.15) < 0.16  # from 0 to 12 m/s at once, between two frames
    assert error[~moves_off].max() < 0.02
    # In the middle of the lane of 3.5 m, not on the road's line.
    assert rows[:, 2] == pytest.approx(-1.75, abs=1e-4)


def test_what_it_does_not_know_is_named(tmp_path: Path) -> None:
    found, _ = written(tree(tmp_path, **SCENARIOS["kept actions"]), None, "carla")
    named = " ".join(map(str, found.notes))
    for word in ("VisibilityAction", "CustomCommandAction", "TrafficSignalStateAction", "AppearanceAction"):
        assert word in named
    assert named.count("TrafficSignalStateAction left out") == 1


def test_the_ego_is_the_car_that_is_called_so_unless_one_says_it(tmp_path: Path) -> None:
    two = {"entities": entity("Other") + entity("Ego"), "init": private("Other", teleport(s="90")) + private("Ego")}
    two["stories"] = story(event("x", action("x", speed_action())), actors=("Other",))

    def egos(root: etree._Element) -> list[str]:
        objects = root.iter("ScenarioObject")
        return [item.get("name") for item in objects for p in item.iter("Property") if p.get("value") == "ego_vehicle"]

    assert egos(written(tree(tmp_path, **two), None, "carla")[1]) == ["Ego"]
    said = entity("Other").replace(
        "<Properties/>", '<Properties><Property name="type" value="ego_vehicle"/></Properties>'
    )
    assert egos(written(tree(tmp_path, **{**two, "entities": said + entity("Ego")}), None, "carla")[1]) == ["Other"]


def test_without_a_road_it_can_not_be_played(tmp_path: Path) -> None:
    source = tree(tmp_path)
    motion = played(read_scenario(source))
    text = source.read_text(encoding="utf-8").replace('<LogicFile filepath="road.xodr"/>', "")
    source.write_text(text, encoding="utf-8")
    made_for = target("carla")
    with pytest.raises(FormatError, match="without a road"):
        write_converted(
            read_scenario(source),
            motion,
            nominal(motion),
            tmp_path / "out.xosc",
            provenance={},
            summary="",
            target=made_for,
        )
    assert not (tmp_path / "out.xosc").exists()
