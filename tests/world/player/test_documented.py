"""docs/elements.csv names every action, condition and position of OpenSCENARIO 1.3, and says what is done with it."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType

import pytest

from xosc_lateral.files.openscenario.storyboard import ENTITY_CONDITIONS, PRIVATE_ACTIONS, VALUE_CONDITIONS
from xosc_lateral.world.player.actions.at_once import (
    RunningForTime,
    controller,
    environment,
    recorded,
    traffic,
    unsupported,
)
from xosc_lateral.world.player.conditions.value import prepare_user_defined
from xosc_lateral.world.player.positions.resolve import POSITIONS
from xosc_lateral.world.player.storyboard_builder import ENTITY_CHECKS, RUNNING, VALUE_CHECKS
from xosc_lateral.world.scenario import conditions, global_actions, position, private_actions

pytestmark = pytest.mark.lint

ROOT = Path(__file__).parents[3]
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
    with (ROOT / "docs" / "elements.csv").open(encoding="utf-8", newline="") as lines:
        _header, *rows = csv.reader(lines)
    return {name: (what, how) for name, what, how in rows}


def _standard() -> list[str]:
    names = re.findall(r'complexType name="(\w*(?:Action|Condition|Position))"', SCHEMA.read_text(encoding="utf-8"))
    return sorted(set(names) - HOLDERS)


def test_every_element_of_the_standard_has_a_row_without_an_empty_cell() -> None:
    rows = _rows()
    assert [name for name in _standard() if not all(cell.strip() for cell in rows.get(name, ("", "")))] == []


PARTS = {"CustomCommandAction": "UserDefinedAction", "RandomRouteAction": "Unsupported"}
"""Actions that the model holds inside another one, or by name alone."""
ACTIONS = {content.__name__: getattr(running, "args", (running,))[0] for content, running in RUNNING.items()}
"""What is done: a kind of action, or the function of one that is done at once."""
NOT_PLAYED, PASSED_ON, PLAYED = "not played", "passed on", "played"


def _said(name: str) -> str:
    """What the code does with an element of the standard, in the words of the table."""
    if name.endswith("Position"):
        return PLAYED if getattr(position, name) in POSITIONS else NOT_PLAYED
    if name.endswith("Condition"):
        checks = {content.__name__: check for content, check in (ENTITY_CHECKS | VALUE_CHECKS).items()}
        return NOT_PLAYED if checks.get(name) in (None, prepare_user_defined) else PLAYED
    if name.startswith("Override"):
        name = "OverrideControllerValueAction"
    elif name.startswith("Traffic") and not name.startswith("TrafficSignal"):
        name = "TrafficAction"
    done = ACTIONS.get(PARTS.get(name, name), unsupported)
    if done in (controller, unsupported, traffic):
        return NOT_PLAYED
    return PASSED_ON if done in (recorded, RunningForTime, environment) else PLAYED


def test_every_row_says_what_the_code_does() -> None:
    rows = {name: _rows()[name] for name in _standard()}
    assert {name: what.removesuffix(", differs") for name, (what, _) in rows.items()} == {n: _said(n) for n in rows}
    assert [name for name, (what, how) in rows.items() if what.endswith("differs") and len(how.split()) < 3] == []


def test_every_condition_and_private_action_that_has_a_row_is_read() -> None:
    rows = {name for name, (what, _) in _rows().items() if what.startswith(PLAYED)}
    read = {*PRIVATE_ACTIONS, *ENTITY_CONDITIONS, *VALUE_CONDITIONS}
    assert {name for name in rows if name.endswith("Condition")} <= read
    private = {content.__name__ for content in RUNNING if hasattr(content, "entity_ref")}
    assert (rows & private) - read <= {
        "AddEntityAction",
        "DeleteEntityAction",
    }


@pytest.mark.parametrize(
    ("module", "known"),
    [(private_actions, RUNNING), (global_actions, RUNNING), (conditions, ENTITY_CHECKS | VALUE_CHECKS)],
    ids=["private", "global", "conditions"],
)
def test_whatever_the_model_holds_is_played(module: ModuleType, known: Mapping[type, object]) -> None:
    """Structs of `world/scenario/` with a place of their own, but for parts of others."""
    held = {
        value
        for value in vars(module).values()
        if isinstance(value, type)
        and value.__module__ == module.__name__
        and value.__name__.endswith(("Action", "Condition"))
    }
    assert len(held) > 8
    assert held <= set(known)
