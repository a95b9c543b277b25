"""Scenarios outside of what profiles were measured for: proving grounds, speeds and lane widths."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import xosc_lateral as xl


def scenario(folder: Path, *, width: float) -> Path:
    """The template's cut-in, its lanes as wide as asked for."""
    path, road = xl.write_template("cut-in", folder)
    text, count = re.subn(r'(<width [^>]*\ba=")[^"]*"', rf'\g<1>{width:g}"', road.read_text())
    assert count >= 2
    road.write_text(text)
    return path


@pytest.mark.parametrize("width", [3.5, 4.5, 9.0])
def test_a_lane_that_is_none_of_a_road_moves_nobody_unless_named(tmp_path: Path, width: float) -> None:
    path = scenario(tmp_path, width=width)
    made = xl.convert(path, tmp_path / "out.xosc", seed=1, ego="none", time_limit=8.0)
    moved = [entity["name"] for entity in made.to_dict()["entities"] if entity["profile"]]
    if width < 6.0:
        assert moved
    else:
        assert not moved and "a proving ground's: keeps its line (--entity" in str(made)
        named = xl.convert(path, tmp_path / "named.xosc", seed=1, ego="none", time_limit=8.0,
                           entity={"Truck": "motorway"})  # fmt: skip
        assert [one["name"] for one in named.to_dict()["entities"] if one["profile"]] == ["Truck"]
    assert any("m wide (measured: 3.68 to 3.86)" in line for line in made.warnings) == (width == 4.5)
