"""Scenarios outside of what profiles were measured for: proving grounds, speeds and lane widths."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import xosc_lateral as xl


def scenario(folder: Path, *, width: float, alone: bool) -> Path:
    """The template's cut-in, its lanes as wide as asked for; the truck's alone, or with another beside it."""
    path, road = xl.write_template("cut-in", folder)
    text, count = re.subn(r'(<width [^>]*\ba=")[^"]*"', rf'\g<1>{width:g}"', road.read_text())
    assert count >= 2
    if alone:
        assert '<lane id="-1" type="driving"' in text
        text = text.replace('<lane id="-1" type="driving"', '<lane id="-1" type="stop"')
    road.write_text(text)
    return path


@pytest.mark.parametrize(("width", "alone"), [(3.5, True), (4.5, True), (9.0, True), (4.5, False), (9.0, False)])
def test_a_lone_lane_that_is_none_of_a_road_moves_nobody_unless_named(
    tmp_path: Path, width: float, alone: bool
) -> None:
    path = scenario(tmp_path, width=width, alone=alone)
    made = xl.convert(path, tmp_path / "out.xosc", seed=1, ego="none", time_limit=8.0)
    moved = [entity["name"] for entity in made.to_dict()["entities"] if entity["profile"]]
    if width < 6.0 or not alone:
        assert "Truck" in moved
    else:
        assert not moved and "a proving ground's: keeps its line (--profile" in str(made)
        named = xl.convert(path, tmp_path / "named.xosc", seed=1, ego="none", time_limit=8.0,
                           entity={"Truck": "motorway"})  # fmt: skip
        assert [one["name"] for one in named.to_dict()["entities"] if one["profile"]] == ["Truck"]
    assert any("m wide (measured: 3.69 to 3.85)" in line for line in made.warnings) == (
        width == 4.5 or (width == 9.0 and not alone)
    )
