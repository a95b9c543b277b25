"""docs/playing.md names every action, condition and position of OpenSCENARIO 1.3, and says what is done with it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from xosc_lateral.formats.openscenario.conditions import ENTITY_CONDITIONS, VALUE_CONDITIONS
from xosc_lateral.formats.openscenario.private_actions import PRIVATE_ACTIONS

ROOT = Path(__file__).parents[2]
SCHEMA = ROOT / "tests" / "data" / "xsd" / "OpenSCENARIO-1.3.0.xsd"
HOLDERS = {
    *("Action", "AppearanceAction", "ControllerAction", "EntityAction", "GlobalAction", "InfrastructureAction"),
    *("LateralAction", "LongitudinalAction", "ParameterAction", "PrivateAction", "RoutingAction", "TrafficAction"),
    *("TrafficSignalAction", "TrailerAction", "VariableAction"),
    *("ByEntityCondition", "ByValueCondition", "Condition", "EntityCondition", "Position", "InRoutePosition"),
    "RoadCondition",  # of the weather
}
"""Elements that only hold others."""


def _rows() -> dict[str, tuple[str, str]]:
    text = (ROOT / "docs" / "playing.md").read_text(encoding="utf-8")
    found = re.findall(r"^\| `(\w+(?:Action|Condition|Position))` \| (.*?) \| (.*?) \|$", text, re.MULTILINE)
    return {name: (what, how) for name, what, how in found}


def _standard() -> list[str]:
    names = re.findall(r'complexType name="(\w*(?:Action|Condition|Position))"', SCHEMA.read_text(encoding="utf-8"))
    return sorted(set(names) - HOLDERS)


@pytest.mark.parametrize("name", _standard())
def test_every_element_of_the_standard_has_a_row_without_an_empty_cell(name: str) -> None:
    what, how = _rows()[name]
    assert what.strip()
    assert how.strip()


def test_what_is_said_to_be_honoured_is_read() -> None:
    honoured = {name for name, (what, _) in _rows().items() if what.startswith("honoured")}
    read = {*PRIVATE_ACTIONS, *ENTITY_CONDITIONS, *VALUE_CONDITIONS}
    conditions = {name for name in honoured if name.endswith("Condition")}
    assert conditions <= read
    assert {"SpeedAction", "LaneChangeAction", "FollowTrajectoryAction"} <= honoured & read
