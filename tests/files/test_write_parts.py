"""Parts of the OpenSCENARIO writer by themselves, on elements whose result is known by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from tests.files.test_openscenario_write import played
from tests.files.test_versions import PROFILE
from tests.kit.scenario_files import action, entity, event, made, private, scenario_text, story, write_scenario
from xosc_lateral.files.openscenario.read import read_scenario
from xosc_lateral.files.openscenario.write import build, versions
from xosc_lateral.files.openscenario.write.draft import Losses
from xosc_lateral.files.openscenario.write.replaced_maneuvers import separable
from xosc_lateral.files.openscenario.write.replay import motion_unknown_to


@pytest.mark.parametrize(
    ("version", "rule", "value"), [((1, 0), "greaterThan", "1.499"), ((1, 1), "greaterOrEqual", "1.5")]
)
def test_a_time_is_reached_and_not_passed_where_the_version_can_say_so(
    version: tuple[int, int], rule: str, value: str
) -> None:
    (condition,) = build.time_trigger(etree.Element("Event"), "StartTrigger", 1.5, version).iter(
        "SimulationTimeCondition"
    )
    assert dict(condition.attrib) == {"rule": rule, "value": value}


def test_positions_have_hundredths_of_a_millimetre_and_angles_microradians() -> None:
    owner = etree.Element("TeleportAction")
    build.world_position(owner, (1.234567, 2.0, 0.0, 0.1234567, 0.0, -0.7654321))
    (position,) = owner.iter("WorldPosition")
    assert dict(position.attrib) == {"x": "1.23457", "y": "2", "z": "0", "h": "0.123457", "p": "0", "r": "-0.765432"}


def test_numbers_half_way_between_two_are_rounded_as_one_by_one() -> None:
    values = (np.arange(1, 4000, 2) * 0.5e-5).reshape(-1, 1) + np.array([0.0, 7.0, 1234.0])
    wanted = tuple(build.decimal(value, 5) for value in values.ravel().tolist())
    assert build.decimals(values, (5, 5, 5)) == wanted


@pytest.mark.parametrize(
    ("content", "empty"),
    [('active="false"', True), ('active="0"', True), ('active="FALSE"', True), ('active="true"', False), ("", False)],
)
def test_an_override_with_nothing_active_overrides_nothing(content: str, empty: bool) -> None:
    text = (
        f'<OverrideControllerValueAction><Throttle {content}/><Brake active="false"/></OverrideControllerValueAction>'
    )
    assert versions.overrides_nothing(etree.fromstring(text)) is empty
    assert not versions.overrides_nothing(
        etree.fromstring('<AssignControllerAction><X active="false"/></AssignControllerAction>')
    )


def test_a_controller_assigned_and_overridden_are_two_actions() -> None:
    text = """<Event><Action name="a"><PrivateAction><ControllerAction><AssignControllerAction/>
    <OverrideControllerValueAction><Brake active="true"/></OverrideControllerValueAction></ControllerAction>
    </PrivateAction></Action></Event>"""
    root = etree.fromstring(text)
    versions._be_strict(Losses(root, Path("x.xosc"), "version 1.1", False))
    kinds = [(item.get("name"), [one.tag for one in item.find(".//ControllerAction")]) for item in root.iter("Action")]
    assert kinds == [
        ("a", ["AssignControllerAction"]),
        ("a OverrideControllerValueAction", ["OverrideControllerValueAction"]),
    ]


def test_a_storyboard_without_an_end_gets_one_that_never_comes_where_a_version_asks_for_it() -> None:
    root = etree.fromstring("<OpenSCENARIO><Storyboard><Init/></Storyboard></OpenSCENARIO>")
    versions._complete_3(Losses(root, Path("x.xosc"), "version 1.2", False))
    assert [one.tag for one in root[0]] == ["Init", "StopTrigger"] and len(root[0][1]) == 0


def test_a_maneuver_that_a_version_does_not_know_is_named_and_no_other(tmp_path: Path) -> None:
    text = scenario_text(minor=3, stories=story(event("slower", action("slower", PROFILE))))
    scenario = read_scenario(write_scenario(tmp_path, text))
    motion = played(scenario)
    assert motion_unknown_to((1, 3), scenario, motion, {"Ego"}) == {}
    assert motion_unknown_to((1, 0), scenario, motion, {"Ego"})["Ego"].startswith("version 1.0 has no")
    assert motion_unknown_to((1, 0), scenario, motion, set()) == {}


def test_who_shares_a_group_or_comes_and_goes_is_not_taken_out(tmp_path: Path) -> None:
    profile = action("slower", PROFILE)
    stories = "".join(
        story(event("slower", profile), actors=actors).replace('name="story"', f'name="story{number}"')
        for number, actors in enumerate((("A",), ("B", "C"), ("D",)))
    )
    gone = action(
        "gone", '<GlobalAction><EntityAction entityRef="E"><DeleteEntityAction/></EntityAction></GlobalAction>'
    )
    stories += story(event("gone", gone), actors=("D",)).replace('name="story"', 'name="last"')
    scenario = made(
        tmp_path,
        entities="".join(map(entity, "ABCDE")),
        init="".join(map(private, "ABCDE")),
        stories=stories,
    )
    assert separable(scenario, "ABCDE") == {"A", "B", "C", "D"}  # E goes by somebody else's action
    assert separable(scenario, "AB") == {"A"}, "B shares its group with C, who stays"
    assert separable(scenario, "D") == {"D"}
