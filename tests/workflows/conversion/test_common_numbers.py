"""What one vehicle does is not another's business: common random numbers across scenarios."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

import xosc_lateral as xl

SHORT = ('value="50.0" rule', 'value="15.0" rule')


def scenario(folder: Path, *, reordered: bool = False, added: bool = False) -> Path:
    """The overtaking template, 15 s of it; entities in the other order, or one more, half a kilometre ahead."""
    road, path = xl.write_template("overtake-truck", folder, force=True)
    path = path if path.suffix == ".xosc" else road
    text = path.read_text().replace(*SHORT)
    objects = re.findall(r" *<ScenarioObject .*?</ScenarioObject>\n", text, re.DOTALL)
    placed = re.findall(r" *<Private .*?</Private>\n", text, re.DOTALL)
    if reordered:
        text = text.replace("".join(objects), "".join(reversed(objects)))
        text = text.replace("".join(placed), "".join(reversed(placed)))
    if added:
        text = text.replace(objects[-1], objects[-1] + objects[-1].replace("FarAhead", "Added"))
        further = placed[-1].replace("FarAhead", "Added").replace('s="400.0"', 's="1500.0"')
        text = text.replace(placed[-1], placed[-1] + further)
    path.write_text(text)
    return path


def test_neither_the_order_of_entities_nor_one_far_away_changes_anybody(tmp_path: Path) -> None:
    frames = {}
    for name, changed in (("as it is", {}), ("reordered", {"reordered": True}), ("added", {"added": True})):
        (tmp_path / name).mkdir()
        frames[name] = xl.convert(
            scenario(tmp_path / name, **changed), profile="motorway", seed=4, ego="none"
        ).to_frame()
    assert set(frames["added"]["name"]) == {"Ego", "Truck", "FarAhead", "Added"}
    assert frames["reordered"]["name"][0] == "FarAhead"
    for name in ("Ego", "Truck", "FarAhead"):
        whole, *others = (frame.loc[frame["name"] == name, "deviation"].to_numpy() for frame in frames.values())
        assert np.ptp(whole) > 0.02
        for other in others:
            np.testing.assert_array_equal(other, whole)


def test_a_vehicle_that_starts_elsewhere_or_faster_moves_otherwise(tmp_path: Path) -> None:
    path = scenario(tmp_path)
    moved = tmp_path / "moved.xosc"
    moved.write_text(path.read_text().replace('s="100.0"', 's="101.0"'))
    first, second = (xl.convert(one, profile="motorway", seed=4, ego="none").to_frame() for one in (path, moved))
    for name, alike in (("Ego", False), ("FarAhead", True)):
        one, other = (frame.loc[frame["name"] == name, "deviation"].to_numpy() for frame in (first, second))
        assert np.array_equal(one, other) == alike
