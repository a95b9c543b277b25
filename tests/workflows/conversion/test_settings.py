"""One declaration of what a conversion can be told: Python, command line, tables and configuration agree."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import pytest

import xosc_lateral as xl
from xosc_lateral.base.errors import FormatError
from xosc_lateral.cli import verb
from xosc_lateral.extras.recordings.settings import ReconstructKeywords, ReconstructSettings
from xosc_lateral.files.configuration import SETTINGS
from xosc_lateral.files.openscenario.write.draft import Player
from xosc_lateral.workflows.conversion.result import Neighbours
from xosc_lateral.workflows.conversion.settings import OPTIONS, ConvertKeywords, ConvertSettings, OutputMode
from xosc_lateral.workflows.options import SHARED, options_of


def test_python_the_command_line_and_the_configuration_have_the_same_options() -> None:
    assert all(f"\n{name} : " in str(ConvertSettings.__doc__) for name in OPTIONS)
    for call in (xl.convert, xl.convert_many):
        assert OPTIONS.keys() <= inspect.signature(call).parameters.keys()
    on_the_line = {option.name: option.opts for option in verb("convert").params}
    others = {name: option.said_by for name, option in OPTIONS.items() if option.said_by}
    assert OPTIONS.keys() - others.keys() <= on_the_line.keys()
    assert {*others.values()} <= {flag for flags in on_the_line.values() for flag in flags}
    shared = {name for name, option in OPTIONS.items() if name in SHARED and option.words is SHARED[name].words}
    assert shared == SHARED.keys() - {"profile", "columns", "jobs", "with_sensor"}
    assert OPTIONS.keys() >= SETTINGS


def test_what_a_user_says_becomes_plain_values() -> None:
    said = ConvertSettings.of(
        profile=Path("a/b.json"), entity={"A": Path("c.json")}, only=["A", "B"], ego="none", parameters={"x": 2.5},
        allow="here", library=[Path("one"), "two"], mode="lane-offset", player="esmini", version="1.2", seed=3,
    )  # fmt: skip
    assert (said.profile, said.entity, said.only, said.ego) == ("a/b.json", {"A": "c.json"}, {"A", "B"}, frozenset())
    assert (said.parameters, said.allow, said.library) == ({"x": "2.5"}, (Path("here"),), (Path("one"), Path("two")))
    assert (said.mode, said.target.player, said.target.version) == (OutputMode.LANE_OFFSET, Player.ESMINI, (1, 2))
    assert ConvertSettings.of(only=None, ego=None, context=None) == ConvertSettings()
    assert ConvertSettings.of(only=[]).only == frozenset(), "nobody is not everybody"


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"seed": -1}, "seed -1, at least 0"),
        ({"seed": 1.5}, "seed 1.5 is not a whole number"),
        ({"attempts": 0}, "attempts 0, at least 1"),
        ({"time_limit": float("nan")}, "time_limit nan s, expected more than 0"),
        ({"mode": "free"}, "mode 'free', expected one of auto, trajectory, lane-offset"),
        ({"ego": ["none", "A"]}, "ego A, none: 'none' stands alone"),
        ({"version": "9.9"}, "version '9.9' can't be written"),
        ({"player": "carla", "version": "1.2"}, "reads version 1.0 alone"),
    ],
)
def test_what_can_not_be_is_named(option: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ConvertSettings.of(**option)


def test_an_option_that_there_is_not_is_a_wrong_call() -> None:
    with pytest.raises(TypeError, match="no option 'sead'; there are profile, seed"):
        ConvertSettings.of(sead=1)


def test_the_configuration_is_read_again_when_it_changes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    path = tmp_path / "xosc-lateral" / "config.toml"
    path.parent.mkdir()
    path.write_text('ego = "A"\nneighbours = "none"\n')
    assert (ConvertSettings.of().ego, ConvertSettings.of().neighbours) == ({"A"}, Neighbours.NONE)
    assert ConvertSettings.of(ego=["B"], neighbours="borrow") == ConvertSettings(ego=frozenset({"B"}))
    path.write_text('ego = ["A", "BB"]\n')
    assert ConvertSettings.of().ego == {"A", "BB"}
    path.write_text("neighbours = ['none', 'borrow']\n")
    with pytest.raises(FormatError, match=r"config\.toml: neighbours \['none', 'borrow'\], expected one of"):
        ConvertSettings.of()


def test_a_row_says_more_than_the_call_and_paths_are_the_tables() -> None:
    before = ConvertSettings(seed=1, entity={"A": "x"}, parameters={"p": "1", "q": "1"})
    cells = {
        "context": "wind.csv", "mode": "trajectory", "attempts": "3", "time_limit": "2.5", "road": "r.xodr",
        "profile:B": "own.json", "parameters": '{"p": 2}', "parameter:q": "3", "version": "1.1",
    }  # fmt: skip
    row = before.of_row(cells, Path("tables"))
    assert (row.context, row.road) == (Path("tables/wind.csv"), Path("tables/r.xodr"))
    assert (row.mode, row.attempts, row.time_limit, row.version) == (OutputMode.TRAJECTORY, 3, 2.5, "1.1")
    assert row.entity == {"A": "x", "B": str(Path("tables/own.json"))} and row.seed == 1
    assert row.parameters == {"p": "2", "q": "3"}
    assert before.of_row({}, Path("tables")) == before


def test_type_checkers_see_every_option() -> None:
    assert set(ConvertKeywords.__annotations__) == set(OPTIONS)
    assert set(ReconstructKeywords.__annotations__) == set(options_of(ReconstructSettings))
